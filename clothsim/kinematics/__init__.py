"""Floor 2: how a cloth is deformed: F and its stretches per triangle, frames per vertex ring, thickness."""
