"""Fitting a garment onto a body: where the package `transfer` and the simulator meet."""
