"""Known answers (docs/results/validation.md): `python -m tests.known_answers` computes each and prints the table."""
