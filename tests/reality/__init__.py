"""Simulated fabrics against measured ones."""
