"""Contact: barrier, friction, candidate search, continuous collision detection. Only this folder imports ipctk."""
