"""Floor 1: cloths, bodies and the world they make; topology, generators and the mesh doctor."""
