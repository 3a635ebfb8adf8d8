"""Fabrics by panel of a garment in sewing: masses, stiffnesses and thicknesses against closed forms."""

import numpy as np
import pytest
from sewing_patterns import panel, specification, stitch

from clothsim.base.errors import InputError
from clothsim.garments.dress.sewing_state import Fabrics, as_placed, sewn_cloth
from clothsim.garments.pictures import numbers_of_fabrics
from clothsim.keys.fabric_table import FABRICS
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of
from clothsim.scene.assembly.scene_world import build, world_of
from clothsim.scene.scene import Scene, scene_from_text

EFFECTS = {"membrane": {}, "bending": {"model": "hinge"}, "gravity": {}, "inertia": {}}


def two_panels():
    """Panels of 20 x 30 cm side by side whose seam touches, welded."""
    square = [[0, 0], [20, 0], [20, 30], [0, 30]]
    panels = {"left": panel(square), "right": panel(square, translation=[20, 0, 0])}
    state = as_placed(mesh_pattern(pattern_of(specification(panels, [stitch(("left", 1), ("right", 3))])), 0.05))
    return state.weld([0])


def scene_of(state, fabrics: Fabrics) -> Scene:
    return Scene(cloth=sewn_cloth(state, fabrics), effects=EFFECTS)


def test_each_panel_weighs_what_its_fabric_does():
    state = two_panels()
    world = world_of(scene_of(state, Fabrics("cotton", {"right": "denim"})))
    cotton, denim = FABRICS["cotton"], FABRICS["denim"]
    assert np.isclose(world.masses.sum(), 0.06 * (cotton.density + denim.density), rtol=1e-12)
    x = world.start()[:, 0]
    one, other = world.masses[x < 0.199].sum(), world.masses[x > 0.201].sum()
    assert other / one == pytest.approx(denim.density / cotton.density, rel=0.05)
    for name in ("thickness", "poisson_ratio", "stiffness_along_warp"):
        values = world.per_triangle(name)
        assert (values[state.mesh.faces["left"]] == getattr(cotton, name)).all()
        assert (values[state.mesh.faces["right"]] == getattr(denim, name)).all()


def test_hinges_at_the_seam_bend_in_series():
    state = two_panels()
    world = world_of(scene_of(state, Fabrics("cotton", {"right": "denim"})))
    x = world.start()[world.hinges.vertices[:, :2], 0]
    cotton, denim = FABRICS["cotton"].bending_stiffness, FABRICS["denim"].bending_stiffness
    at_seam = (np.abs(x - 0.2) < 1e-9).all(axis=1)
    stiffness = world.hinges.stiffness
    assert at_seam.sum() == 6
    assert (stiffness[at_seam] > min(cotton, denim)).all()
    assert (stiffness[at_seam] < (cotton + denim) / 2).all()
    assert (stiffness[(x.max(axis=1) <= 0.2) & ~at_seam] == cotton).all()
    assert (stiffness[(x.min(axis=1) >= 0.2) & ~at_seam] == denim).all()


@pytest.mark.parametrize("effect", ["membrane", "bending"])
def test_energy_of_panels_is_the_sum_of_cloths(effect):
    """Panels that are not welded, deformed: one cloth of two fabrics against two cloths of one fabric each."""
    square = [[0, 0], [20, 0], [20, 30], [0, 30]]
    panels = {"left": panel(square), "right": panel(square, translation=[30, 0, 0])}
    state = as_placed(mesh_pattern(pattern_of(specification(panels)), 0.05))
    rng = np.random.default_rng(0)
    moved = state.positions * [1.1, 0.97, 1.0] + 0.003 * rng.standard_normal(state.positions.shape)
    built = build(scene_of(state, Fabrics("cotton", {"right": "denim"})))
    total = built.energies[effect].value(moved)
    parts = []
    for name, fabric in (("left", "cotton"), ("right", "denim")):
        rows = state.mesh.vertices[name]
        alone = as_placed(mesh_pattern(pattern_of(specification({name: panels[name]})), 0.05))
        parts.append(build(scene_of(alone, Fabrics(fabric))).energies[effect].value(moved[rows]))
    assert total == pytest.approx(sum(parts), rel=1e-12)
    assert parts[0] != pytest.approx(parts[1], rel=0.1)


def test_one_fabric_by_panel_is_the_fabric_itself():
    state = two_panels()
    plain, named = (build(scene_of(state, f)) for f in (Fabrics("denim"), Fabrics("cotton", {"*": "denim"})))
    moved = plain.world.start() * [1.05, 1.0, 1.0] + 0.01 * np.sin(40 * plain.world.start()[:, ::-1])
    for effect, energy in plain.energies.items():
        assert energy.value(moved) == named.energies[effect].value(moved)
    assert np.array_equal(plain.world.masses, named.world.masses)


def test_the_text_of_a_scene_keeps_panels_and_fabrics():
    scene = scene_of(two_panels(), Fabrics("cotton", {"right": "denim"}))
    again = scene_from_text(scene.to_text())
    before, after = world_of(scene), world_of(again)
    assert list(after.cloths[0].groups) == ["left", "right"]
    assert np.array_equal(before.per_triangle("density"), after.per_triangle("density"))
    assert np.array_equal(before.hinges.stiffness, after.hinges.stiffness)


@pytest.mark.parametrize("of_panels", [{"middle": "denim"}, {"left": "felt"}, {"l*": "denim", "*t": "wool"}, ["left"]])
def test_unknown_panels_and_fabrics_are_refused(of_panels):
    with pytest.raises(InputError):
        Fabrics("cotton", of_panels).of(two_panels().mesh.pattern)


def test_fabric_of_every_panel():
    pattern = two_panels().mesh.pattern
    found = Fabrics("cotton", {"*": "wool", "left": "denim"}).of(pattern)
    assert {panel: fabric.name for panel, fabric in found.items()} == {"left": "denim", "right": "wool"}


def test_numbers_of_fabrics_in_pictures():
    state = two_panels()
    numbers = numbers_of_fabrics(state, Fabrics("cotton", {"left": "denim"}).of(state.mesh.pattern))
    assert [set(numbers[state.mesh.faces[name]]) for name in ("left", "right")] == [{0}, {1}]
    assert not numbers_of_fabrics(state, {}).any()
