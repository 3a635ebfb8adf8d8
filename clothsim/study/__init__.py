"""Floor 8: measures the package: benchmarks now, accuracy against time later."""
