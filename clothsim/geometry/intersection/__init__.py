"""Exact triangle intersection tests. They check the contact code, so they have no code in common with it."""
