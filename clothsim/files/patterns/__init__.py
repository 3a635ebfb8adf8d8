"""Sewing patterns in files."""
