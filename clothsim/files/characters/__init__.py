"""Animated characters: skeletons, skinning and motion clips as arrays."""
