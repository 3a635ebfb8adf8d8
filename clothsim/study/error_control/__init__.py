"""Choice of time step, cells, d_hat and Newton's tolerance for a requested error, by pilot runs."""
