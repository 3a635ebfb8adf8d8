"""Floor 6: time stepping with retries, and the checks of its results."""
