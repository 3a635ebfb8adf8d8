"""Implicit time steps: minimisation of a sum of energies, linear systems, stepping, pinches."""
