"""The refinement study on its own small body."""

import pytest

from clothsim.errors import InputError
from clothsim.mesh.shapes import capsule, slab
from clothsim.study.refine import METHODS, as_text, main, measure, torso
from transfer.distance import body_surface

BODY = capsule(radius=0.1, height=1.2, segments=16)


def test_each_method_is_judged_at_each_depth():
    rows = measure(*BODY, [0.01, 0.03])
    assert [row.method for row in rows] == ["before", *METHODS] * 2
    assert rows[0].left.depth == pytest.approx(0.005, abs=2e-4)
    assert all(row.left.penetrating_vertices > 0 for row in rows if row.method == "before")
    assert all(row.left.on_body for row in rows if row.method == "edges and triangles too")
    assert all(1 < row.cost.high < 1.5 for row in rows if row.passes)
    assert len(as_text(rows).splitlines()) == 2 + len(rows)


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
