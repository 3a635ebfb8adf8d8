"""Surface meshes in files."""
