"""Hard cases that must stay stable: `python -m clothsim.study.stability` runs them and prints the table."""
