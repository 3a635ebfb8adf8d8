"""Programs that measure: each can be imported, so that none is left behind by a move of the code."""

from importlib import import_module
from pathlib import Path

import pytest

HERE = Path(__file__).parent
PROGRAMS = sorted(file for file in HERE.rglob("*.py") if not file.stem.startswith(("test_", "__")))


@pytest.mark.parametrize("file", PROGRAMS, ids=lambda file: file.stem)
def test_a_program_can_be_imported(file):
    import_module(".".join(("tests", "benchmarks", *file.relative_to(HERE).with_suffix("").parts)))
