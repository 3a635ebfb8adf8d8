"""Newton's method for one step."""
