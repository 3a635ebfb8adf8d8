"""Benchmark: cost of a Newton iteration by part, against other revisions of the package."""
