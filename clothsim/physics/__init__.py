"""Physics: energies of cloth, and contact."""
