"""Tight cuffs begin closed round their legs, and are held there by friction; wide ones stay flat."""

import numpy as np
import pytest
from capsule_bodies import person
from cuffed_trousers import trousers_with_cuffs

from clothsim.garments.dress.closing import sewing_phases
from clothsim.garments.dress.limbs import Wearer, goes_round
from clothsim.garments.dress.pipeline import STAGES, DressState, DressTask
from clothsim.garments.dress.rings import closed_round_legs
from clothsim.garments.dress.sewing_state import Fabrics
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.penetration import count_penetrations
from transfer.signed_distance import BodySurface, body_surface

CUFFS = ("left_front", "left_back", "right_front", "right_back")


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    return BodyMesh("person", *person(0.05), 1.0, ())


@pytest.mark.parametrize(("half", "aside"), [(5, 0), (5, 4), (6, -3)])
def test_a_cuff_narrower_than_its_leg_begins_closed_round_it(body, half, aside):
    surface = body_surface(body.positions, body.triangles)
    state = trousers_with_cuffs(aside, half=half, size=0.02)
    closed, notes = closed_round_legs(state, body, surface)
    assert len(notes) == 2
    assert closed.tight == CUFFS
    assert count_penetrations(closed.positions, closed.triangles, surface).clean
    names = {seam.name for k, seam in enumerate(closed.mesh.seams) if k in closed.welded}
    assert len(names) == 4
    assert all("top" not in name for name in names)
    for side, sign in (("left", 1), ("right", -1)):
        leg = body.positions[(sign * body.positions[:, 0] > 0) & (np.abs(body.positions[:, 1] - 0.35) < 0.04)]
        axis = (leg.min(axis=0) + leg.max(axis=0)) / 2
        faces = np.concatenate([closed.triangles[closed.mesh.faces[f"{side}_{part}"]] for part in ("front", "back")])
        lines = closed.positions[np.concatenate([faces[:, :2], faces[:, 1:]])] - axis
        assert goes_round(lines[..., [0, 2]])
    assert np.allclose(closed.positions[closed.number, 1], state.positions[:, 1], atol=1e-9)
    assert all(phase.friction for phase in sewing_phases(closed, surface))


@pytest.mark.parametrize("half", [12, 20])
def test_a_cuff_wider_than_its_leg_stays_flat(body, half):
    surface = body_surface(body.positions, body.triangles)
    state = trousers_with_cuffs(0, half=half, size=0.02)
    closed, notes = closed_round_legs(state, body, surface)
    assert notes == ()
    assert closed is state
    assert not any(phase.friction for phase in sewing_phases(closed, surface))


def test_a_cuff_without_room_between_the_legs_stays_flat():
    """The legs have grown together: a tube round one would run through the other."""
    body = BodyMesh("person", *person(0.05, leg_spread=0.02), 1.0, ())
    state = trousers_with_cuffs(-13, half=4, size=0.02)
    closed, notes = closed_round_legs(state, body, body_surface(body.positions, body.triangles))
    assert notes == ()
    assert closed is state


def test_an_axis_outside_the_body_leaves_the_cuff_flat(body, monkeypatch):
    """As between a leg and a hand beside it: no ray from there leaves the body."""
    monkeypatch.setattr(BodySurface, "exits", lambda self, points, out: (np.full(len(points), np.inf), None))
    state = trousers_with_cuffs(0, half=5, size=0.02)
    closed, notes = closed_round_legs(state, body, body_surface(body.positions, body.triangles))
    assert notes == ()
    assert closed is state


def test_the_placement_closes_tight_cuffs(body, tmp_path):
    wearer = Wearer(body, body_surface(body.positions, body.triangles))
    task = DressTask(*wearer[:2], Fabrics("cotton"), False, tmp_path, lambda stage: None, None, None)
    done = STAGES[0].run(task, DressState(trousers_with_cuffs(0, half=5, size=0.02), wearer, ()))
    assert done.state.tight == CUFFS
    assert sum("closed round the leg" in note for note in done.notes) == 2
