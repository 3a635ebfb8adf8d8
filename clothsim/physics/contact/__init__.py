"""Contact: barrier, friction, candidate search, continuous collision detection."""
