"""Tubes move to the side until they are round the legs; trousers are lowered to the crotch; bodices stay."""

from dataclasses import replace

import numpy as np
import pytest
from capsule_bodies import person
from cuffed_trousers import trousers_with_cuffs
from sewing_patterns import panel, specification, stitch

from clothsim.garments.dress.corrections import lifted
from clothsim.garments.dress.limbs import Wearer, limb_names
from clothsim.garments.dress.rings import arms_between, centred, lowered_to_crotch, open_pairs_of, rings
from clothsim.garments.dress.sewing_state import SewingState, as_placed
from clothsim.garments.inputs import BodyMesh
from clothsim.mesh.generators.table import GENERATORS
from clothsim.patterns.pattern_mesh import PatternMesh, mesh_pattern
from clothsim.patterns.specification import pattern_of
from transfer.signed_distance import body_surface

SKIRT = [[-35, 0], [35, 0], [30, 40], [-30, 40]]
LEVEL = [[-40, 0], [40, 0], [35, 10], [-35, 10]]


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    return BodyMesh("person", *person(0.05), 1.0, ())


def placed(aside: float, top: list[list[float]] = SKIRT, sides: tuple[int, ...] = (1, 3)) -> SewingState:
    """A skirt or trousers, and a level below it that is `aside` cm to the side, each of a front and a back."""
    panels, stitches = {}, []
    for name, outline, at, seams in (("top", top, [0, 45], sides), ("level", LEVEL, [aside, 30], (1, 3))):
        for part, z in (("front", 20), ("back", -20)):
            panels[f"{name}_{part}"] = panel(outline, translation=[*at, z])
        stitches += [stitch((f"{name}_front", k), (f"{name}_back", k), "right_wrong") for k in seams]
    if top is SKIRT:
        stitches += [stitch((f"top_{part}", 0), (f"level_{part}", 2), "right_wrong") for part in ("front", "back")]
    return as_placed(mesh_pattern(pattern_of(specification(panels, stitches)), 0.05))


def moves(state: SewingState, moved: SewingState) -> dict[str, np.ndarray]:
    return {name: (moved.positions - state.positions)[rows] for name, rows in state.mesh.vertices.items()}


@pytest.mark.parametrize("aside", [0, 35])
def test_pieces_are_joined_round_the_body_not_to_what_is_below(body, aside):
    assert rings(placed(aside), body) == [("top_front", "top_back"), ("level_front", "level_back")]


@pytest.mark.parametrize("aside", [-35, 35])
def test_a_level_beside_the_legs_moves_round_them(body, aside):
    state = placed(aside)
    moved, notes = centred(state, body)
    assert len(notes) == 1
    for name, way in moves(state, moved).items():
        if "top" in name:
            assert not way.any()
            continue
        assert np.allclose(way, way[0], atol=1e-12)
        assert np.all(way[:, 1:] == 0)
        assert way[0, 0] * aside < 0
        reach = moved.positions[state.mesh.vertices[name], 0]
        assert abs(reach.min() + reach.max()) < 0.04  # as far on both sides
        reach = moved.positions[state.mesh.vertices[name], 0]
        legs = body.positions[np.abs(body.positions[:, 1] - 0.35) < 0.05, 0]
        assert reach.min() < legs.min()
        assert legs.max() < reach.max()


def test_what_is_round_the_legs_stays(body):
    state = placed(3)
    moved, notes = centred(state, body)
    assert notes == ()
    assert np.array_equal(moved.positions, state.positions)


@pytest.mark.parametrize(("aside", "count"), [(0, 0), (25, 2)])
def test_trousers_stay_and_their_cuffs_go_round_one_leg_each(body, aside, count):
    state = trousers_with_cuffs(aside)
    moved, notes = centred(state, body)
    assert len(notes) == count
    for name, way in moves(state, moved).items():
        assert way.any() == ("top" not in name and count > 0)
        if "top" not in name:
            reach = moved.positions[state.mesh.vertices[name], 0] * (1 if "left" in name else -1)
            assert reach.min() > -0.1  # the other leg is outside
            leg = body.positions[np.abs(body.positions[:, 1] - 0.35) < 0.05, 0]
            assert reach.min() < leg[leg > 0].min()
            assert leg.max() < reach.max()


def test_a_cuff_narrower_than_its_leg_goes_to_the_middle_of_the_leg(body):
    """The leg slants, and its outer side lacks most at the upper end, its inner side at the lower one."""
    slanting = body.positions.copy()
    slanting[:, 0] += np.sign(slanting[:, 0]) * np.maximum(0.6 - slanting[:, 1], 0.0) ** 2
    legs = replace(body, positions=slanting)
    state = trousers_with_cuffs(12, half=8)
    moved, notes = centred(state, legs)
    assert len(notes) == 2
    at = moved.positions[open_pairs_of(state, ("left_front", "left_back"))].mean(axis=1)
    slices = [slanting[(slanting[:, 0] > 0) & (np.abs(slanting[:, 1] - point[1]) < 0.04), 0] for point in at]
    middles = [(part.min() + part.max()) / 2 for part in slices]
    cuff = moved.positions[state.mesh.vertices["left_front"], 0]
    assert (cuff.min() + cuff.max()) / 2 == pytest.approx(np.mean(middles), abs=1e-3)


def test_a_narrow_cuff_below_the_floor_goes_to_the_foot(body):
    state = trousers_with_cuffs(12, half=8, level=-60)
    moved, notes = centred(state, body)
    assert len(notes) == 2
    assert np.isfinite(moved.positions).all()
    foot = body.positions[(body.positions[:, 0] > 0) & (body.positions[:, 1] < body.positions[:, 1].min() + 0.04), 0]
    cuff = moved.positions[state.mesh.vertices["left_front"], 0]
    assert (cuff.min() + cuff.max()) / 2 == pytest.approx((foot.min() + foot.max()) / 2, abs=1e-3)


def test_skirts_are_not_lifted(body):
    surface = body_surface(body.positions, body.triangles)
    state = placed(-35)
    moved, note = lifted(state, body, surface)
    assert note == ""
    assert moved is state


@pytest.fixture(scope="module")
def mannequin() -> BodyMesh:
    positions, triangles = GENERATORS["mannequin"]()
    return BodyMesh("mannequin", positions[:, [0, 2, 1]] * [1, 1, -1], triangles, 1.0, ())


def low_trousers(rise: float, crotch: float, bodice: bool) -> PatternMesh:
    """Trousers of a rise above a crotch at a level [cm], alone or below a bodice."""
    outline = [[-40, 0], [-10, 0], [0, 30], [10, 0], [40, 0], [40, 30 + rise], [-40, 30 + rise]]
    panels = {f"pants_{part}": panel(outline, translation=[0, crotch - 30, z]) for part, z in (("f", 25), ("b", -25))}
    stitches = [stitch(("pants_f", k), ("pants_b", k), "right_wrong") for k in (1, 2, 4, 6)]
    if bodice:
        torso = [[-40, 0], [40, 0], [40, 45], [-40, 45]]
        panels |= {
            f"top_{part}": panel(torso, translation=[0, crotch + rise, z]) for part, z in (("f", 25), ("b", -25))
        }
        stitches += [stitch(("top_f", k), ("top_b", k), "right_wrong") for k in (1, 3)]
        stitches += [stitch((f"top_{part}", 0), (f"pants_{part}", 5)) for part in ("f", "b")]
    return mesh_pattern(pattern_of(specification(panels, stitches)), 0.05)


@pytest.mark.parametrize(("above", "bodice", "lowered"), [(8, False, 9), (-1, False, 0), (8, True, 0)])
def test_trousers_of_a_low_rise_are_lowered_to_the_crotch(mannequin, above, bodice, lowered):
    crotch = 100 * mannequin.parts.landmarks["crotch"]
    mesh = low_trousers(18, crotch + above, bodice)
    moved, notes = lowered_to_crotch(mesh, mannequin)
    assert len(notes) == (lowered > 0)
    assert np.allclose(mesh.positions - moved.positions, [0, lowered / 100, 0], atol=0.012)  # strings end below it


def test_graded_trousers_are_lowered_to_where_the_thighs_part(mannequin):
    crotch = 100 * mannequin.parts.landmarks["crotch"]
    mesh = low_trousers(18, crotch - 1, bodice=False)
    moved, notes = lowered_to_crotch(mesh, mannequin, crotch / 100 - 0.1)
    assert len(notes) == 1
    assert np.allclose(mesh.positions - moved.positions, [0, 0.1, 0], atol=0.012)


@pytest.mark.parametrize(
    ("limb", "height", "label", "found"),
    [("hand", 2, "", True), ("hand", 2, "arm", False), ("arm", 2, "", True), ("arm", 60, "", False)],
)
def test_limbs_in_the_way_of_strings_are_found(mannequin, limb, height, label, found):
    """Hands always; an upper arm where most strings of a seam run through it."""
    wearer = Wearer(mannequin, body_surface(mannequin.positions, mannequin.triangles))
    x, y, _ = 100 * mannequin.positions[limb_names(mannequin) == f"left {limb}"].mean(axis=0)
    outline = [[0, 0], [10, 0], [10, height], [0, height]]
    panels = {
        part: panel(outline, translation=[x, y - height / 2, z], **({"label": label} if label else {}))
        for part, z in (("front", 40), ("back", -40))
    }
    stitches = [stitch(("front", 3), ("back", 3), "right_wrong")]
    state = as_placed(mesh_pattern(pattern_of(specification(panels, stitches)), 0.05))
    assert arms_between(state, wearer) == ((f"left {limb}",) if found else ())
