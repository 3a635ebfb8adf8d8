"""Worlds and energies built from scenes."""
