"""Arrays, errors, compiled functions and safe files: imports no other room."""
