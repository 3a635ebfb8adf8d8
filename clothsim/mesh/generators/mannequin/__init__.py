"""Mannequin: a shipped template mesh, warped to a figure and posed by linear blend skinning."""
