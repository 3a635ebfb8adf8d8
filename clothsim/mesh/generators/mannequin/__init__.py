"""Mannequin: a shipped template mesh, warped to proportions and posed by linear blend skinning."""
