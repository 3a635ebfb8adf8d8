"""Scenes of a fit: stiffness of contact with a moving body."""

import pytest
from fitting_cases import capsule_figure, tube_garment

from clothsim.garments.fit.moving_body import StageSettings, carrying_stiffness, moved_with_body
from clothsim.keys.fabric_table import FABRICS

BODY = capsule_figure(segments=8)


def test_contact_balances_the_fabric_stretched_around_a_limb():
    smaller = carrying_stiffness("cotton", 0.5 * BODY.positions)
    assert smaller == pytest.approx(2 * carrying_stiffness("cotton", BODY.positions))
    assert all(carrying_stiffness(name, BODY.positions) > 0 for name in FABRICS)


def test_a_body_that_pushes_a_tight_tube_keeps_a_gap(tmp_path):
    """With a stiffness that rises slowly the gap shrank to micrometres, and blocked the body."""
    tube = tube_garment(0.102, height=0.12, cells=(10, 3))
    worn = StageSettings(tube, tube.positions, "cotton", BODY.triangles, self_contact=True)
    wide = BODY.positions * [1.25, 1.25, 1.0]
    run = moved_with_body(worn, tube.positions, [BODY.positions * [0.95, 0.95, 1.0], wide], tmp_path, None)
    assert run.status == "completed"
    gaps = [entry["minimum_gap"] for entry in run.record() if entry["minimum_gap"] is not None]
    assert min(gaps) > 1e-4
    assert not any(entry["failures"] for entry in run.record())
    assert len(run.record()) == 10
