"""Parts of authored clips: scenes of arrays, and the floor of noise under a run."""
