"""Levels are counted from the floor of a body: one that stands a metre higher, with its panels, is dressed alike."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from sewing_patterns import panel, specification, stitch
from sewn_tubes import tube

from clothsim.base.arrays import Floats
from clothsim.garments.dress.corrections import separated
from clothsim.garments.dress.fans import folded_fans
from clothsim.garments.dress.limbs import Wearer, legs_beside
from clothsim.garments.dress.measurements import girths
from clothsim.garments.dress.pipeline import not_worn
from clothsim.garments.dress.placement import turned_to_legs
from clothsim.garments.dress.sewing_state import SewingState, as_placed
from clothsim.garments.inputs import BodyMesh
from clothsim.mesh.generators.table import GENERATORS
from clothsim.patterns.pattern_mesh import PatternMesh, mesh_pattern
from clothsim.patterns.specification import pattern_of
from transfer.signed_distance import body_surface

UP = np.array([0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def wearers() -> tuple[Wearer, Wearer]:
    """The mannequin, y upward, on the floor and a metre above it."""
    positions, triangles = GENERATORS["mannequin"]()
    made = []
    for level in (0.0, 1.0):
        points = positions[:, [0, 2, 1]] * [1, 1, -1] + level * UP
        made.append(Wearer(BodyMesh("mannequin", points, triangles, 1.0, ()), body_surface(points, triangles)))
    return made[0], made[1]


def fans(level: float) -> PatternMesh:
    """Two halves of a ring of 300 degrees below a band at the waist."""
    radius = 45.0 / np.radians(300)
    ends = np.radians(-90 + 150 * np.array([-1, 1]))
    around = np.column_stack([np.cos(ends), np.sin(ends)])
    panels, sewn = {}, []
    for part, z in (("front", 25), ("back", -25)):
        place = {"translation": [0, 95 + 100 * level, z]}
        fan = panel([*(radius * around).tolist(), *((radius + 50) * around[::-1]).tolist()], **place)
        fan["edges"][0]["curvature"] = {"type": "circle", "params": [radius, 1, 1]}
        fan["edges"][2]["curvature"] = {"type": "circle", "params": [radius + 50, 1, 0]}
        panels[f"skirt_{part}"] = fan
        panels[f"band_{part}"] = panel([[-22, 0], [22, 0], [22, 4], [-22, 4]], **place)
        sewn.append(stitch((f"band_{part}", 0), (f"skirt_{part}", 0)))
    sewn += [stitch(("skirt_front", k), ("skirt_back", k), "right_wrong") for k in (1, 3)]
    return mesh_pattern(pattern_of(specification(panels, sewn)), 0.04)


def trousers(level: float) -> PatternMesh:
    """Four panels of legs, wider apart than those of the body, from the ankles to the crotch."""
    panels, sewn = {}, []
    for side, sign in (("right", -1), ("left", 1)):
        loop = [[0, 75], [sign * 25, 0], [sign * 47, 0], [sign * 30, 75]]
        for name, z in (("f", 25), ("b", -25)):
            panels[f"{side}_leg_{name}"] = panel(loop, translation=[0, 5 + 100 * level, z], label="leg")
        sewn += [stitch((f"{side}_leg_f", k), (f"{side}_leg_b", k), "right_wrong") for k in (0, 2)]
    return mesh_pattern(pattern_of(specification(panels, sewn)), 0.04)


def across(level: float, height: float) -> SewingState:
    """A level panel through the body, at a height above its floor [cm]."""
    flat = panel(
        [[-40, -30], [40, -30], [40, 30], [-40, 30]], translation=[0, height + 100 * level, 0], rotation=[90, 0, 0]
    )
    return as_placed(mesh_pattern(pattern_of(specification({"flat": flat})), 0.05))


def moved(state: SewingState, level: float) -> SewingState:
    mesh = replace(state.mesh, positions=state.mesh.positions + level * UP)
    return replace(state, mesh=mesh).moved_to(state.positions + level * UP)


FOUND: dict[str, Callable[[Wearer, float], Floats]] = {
    "folded_fans": lambda on, at: folded_fans(fans(at), on.body, on.surface)[0].positions - at * UP,
    "turned_to_legs": lambda on, at: turned_to_legs(trousers(at), on.body, on.surface)[0].positions - at * UP,
    "separated": lambda on, at: np.concatenate(
        [separated(across(at, height), on.body, on.surface)[0].positions - at * UP for height in (90, 148)]
    ),
    "girths": lambda on, at: np.array(
        [[each.level, each.body, each.garment] for each in girths(moved(tube(0.3, 0.6, 1.4), at), on.body)]
    ),
    "not_worn": lambda on, at: np.array(
        [
            bool(not_worn(moved(tube(0.3, low, high), at), on.body))
            for low, high in ((0.6, 1.2), (1.3, 1.9), (1.75, 2.4))
        ],
        float,
    ),
    "legs_beside": lambda on, at: np.array(
        [
            bool(legs_beside(as_placed(moved(tube(0.3, low, high), at).mesh), on.body))
            for low, high in ((0.2, 0.5), (0.9, 1.2))
        ],
        float,
    ),
}


@pytest.mark.parametrize("name", FOUND)
def test_a_body_a_metre_higher_is_dressed_alike(wearers, name):
    low, high = (FOUND[name](wearer, level) for level, wearer in enumerate(wearers))
    np.testing.assert_allclose(high, low, atol=1e-6)


def test_these_panels_are_moved(wearers):
    """Else a level that is not counted from the floor would leave them where they are in both places."""
    on = wearers[0]
    for name, mesh in (("folded_fans", fans(0.0)), ("turned_to_legs", trousers(0.0))):
        assert np.abs(FOUND[name](on, 0.0) - mesh.positions).max() > 0.01, name
    assert set(FOUND["not_worn"](on, 0.0)) == set(FOUND["legs_beside"](on, 0.0)) == {0.0, 1.0}
