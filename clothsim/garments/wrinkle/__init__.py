"""Wrinkles: the geometry that coarse cloth misses (Rohmer et al. 2010), as targets of a finer cloth."""
