"""What accuracy costs in time: how wrong a scene's result is, by what, and what half the error would cost."""
