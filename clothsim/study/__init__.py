"""Floor 8: measures the package: benchmarks, hard cases, and what accuracy costs in time."""
