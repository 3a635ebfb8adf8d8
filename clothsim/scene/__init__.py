"""Scenes: data, their schema, and the table of effects that names the energies."""
