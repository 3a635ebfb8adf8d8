"""Floor 2: reading meshes, writing trajectories."""
