"""Generators of sheets, solids, garments and the mannequin."""
