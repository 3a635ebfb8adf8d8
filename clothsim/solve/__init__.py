"""Floor 5: minimises a sum of energies. It knows energies only as a sum and contact only as a step limit."""
