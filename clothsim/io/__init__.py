"""Mesh files, and the files of a run."""
