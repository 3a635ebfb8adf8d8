"""Standard tests of a fabric, simulated: drape, cantilever, bias extension, tension, shear."""
