"""Cloth between bodies that overlap."""
