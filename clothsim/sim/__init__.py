"""Floor 6: steps through time, with retries, and judges what comes out."""
