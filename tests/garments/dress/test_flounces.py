"""Flounces wider than what they hang from: their ends are sewn last."""

import pytest
from capsule_bodies import person
from sewing_patterns import panel, specification, stitch

from clothsim.garments.dress.closing import sewing_phases
from clothsim.garments.dress.sewing_state import as_placed
from clothsim.garments.inputs import BodyMesh
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of
from transfer.signed_distance import body_surface

SPACING = 0.06


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    """A person of capsules, 1.7 m tall, arms half raised."""
    return BodyMesh("person", *person(0.05), 1.0, ())


@pytest.mark.parametrize(("inner", "later"), [(8, 2), (12, 2), (40, 0)])
def test_a_flounce_whose_ends_lie_before_the_legs_is_sewn_to_its_skirt_first(body, inner, later):
    """A flounce of two U-shaped pieces, the ends of the U `inner` to `inner` + 8 cm from the middle.

    From 12 cm on one string in three passes the leg on its outer side.
    """
    low, outer = [[-inner - 8, -10], [inner + 8, -10]], [[inner + 8, 20], [inner, 20]]
    flounce = [*low, *outer, [inner, 0], [-inner, 0], [-inner, 20], [-inner - 8, 20]]
    panels, sides = {}, []
    for name, outline, level, edges in (
        ("skirt", [[-35, 0], [35, 0], [30, 40], [-30, 40]], 45, (1, 3)),
        ("flounce", flounce, 30, (2, 6)),
    ):
        for part, depth in (("front", 20), ("back", -20)):
            panels[f"{name}_{part}"] = panel(outline, translation=[0, level, depth])
        sides += [stitch((f"{name}_front", k), (f"{name}_back", k), "right_wrong") for k in edges]
    onto = [stitch((f"skirt_{part}", 0), (f"flounce_{part}", 4)) for part in ("front", "back")]
    state = as_placed(mesh_pattern(pattern_of(specification(panels, [*sides, *onto])), SPACING))
    phases = sewing_phases(state, body_surface(body.positions, body.triangles))
    assert [len(phase.closing) for phase in phases] == ([2, 2, 2] if later else [4, 2])
    if later:
        assert all(side.panel.startswith("flounce") for seam in phases[-1].closing for side in seam.stitch.sides)


@pytest.mark.parametrize(("above", "inner", "later"), [(2, -20, 1), (2, 0, 0), (-20, 0, 0)])
def test_a_flounce_of_one_leg_that_reaches_past_the_other_is_sewn_to_its_leg_first(body, above, inner, later):
    """A trouser leg and its flounce, whose inner edges are at x = `above` and `inner`: the other leg is at -20 cm.

    What the flounce hangs from is closed first, also where its own springs run through the other leg.
    """
    panels, sides = {}, []
    for name, outline, level in (
        ("leg", [[above, 0], [40, 0], [40, 15], [above, 15]], 35),
        ("flounce", [[inner, 0], [50, 0], [45, 15], [inner + 5, 15]], 15),
    ):
        for part, depth in (("front", 15), ("back", -15)):
            panels[f"{name}_{part}"] = panel(outline, translation=[0, level, depth])
        sides += [stitch((f"{name}_front", k), (f"{name}_back", k), "right_wrong") for k in (1, 3)]
    onto = [stitch((f"leg_{part}", 0), (f"flounce_{part}", 2)) for part in ("front", "back")]
    state = as_placed(mesh_pattern(pattern_of(specification(panels, [*sides, *onto])), SPACING))
    phases = sewing_phases(state, body_surface(body.positions, body.triangles))
    last = [seam.name for phase in phases[2:] for seam in phase.closing]
    assert last == ["flounce_front.3 to flounce_back.3"] * later
