"""Cloths, bodies and the world that they form; topology, generators and mesh checks."""
