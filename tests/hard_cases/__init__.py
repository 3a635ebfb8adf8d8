"""Hard cases that must stay stable: `python -m tests.hard_cases` runs them and prints the table."""
