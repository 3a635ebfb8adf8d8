"""Files: meshes, characters and motion, sewing patterns, runs, exchange formats."""
