"""Sparse linear systems of a Newton iteration."""
