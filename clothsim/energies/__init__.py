"""Floor 3: the energies whose sum a step minimises. One file, one effect: `ls` is the list of the physics."""
