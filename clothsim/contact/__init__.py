"""Floor 4: what keeps surfaces apart. The only folder that imports ipctk."""
