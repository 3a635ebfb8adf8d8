"""Known answers (VALIDATION A): `python -m clothsim.study.validation` computes each of them and prints the table."""
