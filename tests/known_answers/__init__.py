"""Known answers (docs/validation.md): `python -m tests.known_answers` computes each of them and prints the table."""
