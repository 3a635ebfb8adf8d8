"""Floor 5: minimisation of a sum of energies; contact enters as an energy with a step limit."""
