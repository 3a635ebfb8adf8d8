"""Other simulators on the sheet and the ball of the benchmark: `python -m tests.benchmarks.peers NAME`."""
