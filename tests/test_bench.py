"""The bench on a tiny size: its table has every row, with a positive number and a unit. Nothing is timed here."""

import json
from dataclasses import asdict

import pytest

from clothsim.io.record import to_json
from clothsim.study.bench import bench
from clothsim.study.text_table import text_table

PARTS = (
    "all", "elasticity", "barrier", "candidates", "CCD", "assembly", "linear solve",
    "inertia, gravity, line search, control",
)  # fmt: skip


@pytest.fixture(scope="module")
def result():
    return bench(cells=(8,), steps=1, lead=1, repeats=1, kernel=3)


def test_every_row_is_there_and_positive(result):
    rows = {row.name: row for row in result.rows}
    expected = {f"ball 8x8: {part}" for part in PARTS}
    expected |= {f"membrane, 18 triangles: {part}" for part in ("value", "gradient", "projected Hessian", "all three")}
    expected |= {f"start of python{code}" for code in ("", ", import clothsim", ", from clothsim import simulate")}
    expected |= {
        f"ball 8x8: {name}" for name in ("Newton iterations", "contact pairs", "peak memory of the bench so far")
    }
    assert set(rows) == expected
    assert all(row.value > 0 and row.unit for row in result.rows)
    split = sum(rows[f"ball 8x8: {part}"].value for part in PARTS[1:])
    assert split == pytest.approx(rows["ball 8x8: all"].value)


def test_the_table_has_date_cores_and_units(result):
    text = result.as_text()
    assert text.startswith(f"{result.date}, {result.cores} cores; python ")
    assert text.count("ms / Newton iteration") == len(PARTS)
    assert json.loads(to_json(asdict(result)))["rows"][0]["unit"] == "s"


def test_columns_of_numbers_stand_to_the_right():
    text = text_table(("name", "value"), [("a", "1.5"), ("long name", "1,234")])
    assert text.splitlines() == ["name       value", "----------------", "a            1.5", "long name  1,234"]
