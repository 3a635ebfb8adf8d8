"""Floor 2: which triangles intersect, exactly. It judges contact, so it shares no code with it."""
