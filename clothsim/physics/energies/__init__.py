"""Energies whose sum a step minimises: one file an effect."""
