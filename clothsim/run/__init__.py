"""Simulation of a scene, resumption, summaries and archives."""
