"""Mutation run: formulas broken on purpose, one at a time, and whether the tests of their file see it."""
