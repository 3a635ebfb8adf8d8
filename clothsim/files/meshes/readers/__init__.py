"""Readers of mesh files: a module a format; OBJ is written too."""
