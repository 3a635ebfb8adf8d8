"""A world and its energies, built from a scene."""
