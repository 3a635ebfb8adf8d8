"""Refinement benchmark on its own small body."""

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.garments.penetration import count_penetrations
from clothsim.mesh.checks import examine
from clothsim.mesh.generators.shapes import capsule, slab
from tests.benchmarks.drape_refinement import CHAIN, METHODS, as_text, main, measure, torso
from transfer.signed_distance import body_surface

BODY = capsule(radius=0.1, height=1.2, segments=16)


def test_each_method_is_checked_at_each_depth():
    rows = measure(*BODY, [0.01, 0.03])
    assert [row.method for row in rows] == ["before", *METHODS] * 2
    assert rows[0].left.depth == pytest.approx(0.005, abs=2e-4)
    assert all(row.left.penetrating_vertices > 0 for row in rows if row.method == "before")
    assert all(row.left.on_body for row in rows if row.method == "edges and triangles too")
    assert all(1 < row.cost.high < 1.5 for row in rows if row.passes)
    assert len(as_text(rows).splitlines()) == 2 + len(rows)


def test_the_whole_chain_is_a_row_of_its_own(capsys):
    assert main(["--depths", "10", "--chain"]) == 0
    output = capsys.readouterr()
    assert len([line for line in output.out.splitlines() if CHAIN in line]) == 1
    assert output.err.startswith(f"10 mm, {CHAIN}: 0 vertices inside, 0 pairs with the body, 0 with itself; garment ")


def test_the_torso_is_clear_of_its_body_and_of_itself():
    """A body with a deep waist, where a shell outside it folds over itself."""
    waist = 1 - 0.8 * np.exp(-((BODY[0][:, 2] / 0.012) ** 2))
    body = body_surface(BODY[0] * np.column_stack([waist, waist, np.ones(len(waist))]), BODY[1])
    garment = torso(body)
    assert count_penetrations(garment.positions, garment.triangles, body).clean
    assert not examine("torso", garment.positions, garment.triangles).errors


def test_the_torso_is_round_the_middle():
    garment = torso(body_surface(*BODY))
    assert abs(garment.positions[:, 2]).max() < 0.4
    with pytest.raises(InputError, match="has no torso"):
        torso(body_surface(*slab(size=(3, 3, 4), cells=(1, 1, 1))))


def test_bad_arguments_end_in_a_sentence(capsys):
    assert main(["--body", "nowhere.obj"]) == 2
    assert "nowhere.obj" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["--depths", "ten"])
