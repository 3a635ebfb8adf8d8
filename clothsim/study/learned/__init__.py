"""Drapes learned from a data set."""
