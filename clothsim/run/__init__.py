"""Simulation, stepping by hand, resumption, results and archives."""
