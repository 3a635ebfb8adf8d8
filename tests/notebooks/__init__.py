"""Notebooks of the documentation: executed by `python -m tests.notebooks`, and their code run by the tests."""

from pathlib import Path

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
