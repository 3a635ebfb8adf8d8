"""Time stepping with retries, and rest."""
