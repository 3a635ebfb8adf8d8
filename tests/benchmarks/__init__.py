"""Benchmarks of the package, each run by `python -m tests.benchmarks.NAME` from a clone."""
