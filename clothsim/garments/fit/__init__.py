"""Fitting of garments to bodies, by the package `transfer` and the simulator."""
