"""Gradients of what a run does with respect to what it was given."""
