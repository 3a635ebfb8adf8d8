"""Known answers (VALIDATION A): `python -m tests.known_answers` computes each of them and prints the table."""
