"""Clips in gradients: numbers of fabric, forces and rest lengths, and rest shapes that follow edited frames."""
