"""Mesh generators: sheets, solids, garments and the mannequin."""
