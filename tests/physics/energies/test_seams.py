"""Seams: stitched vertices, closing over time, remaining gaps, and refused input."""

import json
from dataclasses import replace

import numpy as np
import pytest
from effect_builders import bending, gravity, membrane, seams
from meshes import UNIT, cloth, grid
from small_scenes import SHEET, SOLVER, small_scene
from solving import equilibrium, held, step_at

from clothsim import Scene, simulate
from clothsim.base.errors import InputError
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off
from clothsim.physics.energies.hinge_kernels import angles

LEFT, RIGHT = {"side": "left"}, {"side": "right"}


def sheet(nx=4, ny=3):
    return make_world([cloth(*grid(nx, ny))])


def two():
    """A sheet with 3 cells along its right side and one with 2 along its left, a metre apart."""
    first, (positions, triangles) = cloth(*grid(2, 3), name="a"), grid(2, 2)
    return make_world([first, cloth(positions + np.array([2.0, 0, 0]), triangles, name="b")])


def sewn(world, **keys):
    made = seams(world, seam=[{"from": LEFT, "to": RIGHT, **keys}], built={"bending": bending(world)})
    assert not isinstance(made, Off)
    return made


def at(energy, world, time, dt=0.1):
    step = step_at(world.start(), dt=dt)
    return energy.begin(type(step)(**{**vars(step), "time": time}))


def test_equal_borders_meet_vertex_by_vertex():
    world = sheet()
    energy = sewn(world)
    assert len(energy.rows) == 4
    assert np.allclose(energy.lines(world.start()), [[-1.0, 0, 0]] * 4)
    assert len(energy.across.vertices) == 3


def test_a_single_pair_is_a_stitch_of_two_vertices():
    world = two()
    table = {"from": {"cloth": "a", "vertices": [3]}, "to": {"cloth": "b", "vertices": [0]}, "match": "vertices"}
    energy = seams(world, seam=[table])
    x = world.start()
    assert np.allclose(energy.lines(x), [x[3] - x[len(world.cloths[0].rest_positions)]])
    with pytest.raises(InputError):
        seams(world, seam=[{**table, "match": "length"}])


def test_flipped_it_is_a_moebius_strip():
    world = sheet()
    lines = sewn(world, flip=True).lines(world.start())
    assert np.allclose(lines, [[-1.0, y, 0] for y in (-1, -1 / 3, 1 / 3, 1)])


def test_unequal_borders_meet_at_equal_fractions_of_their_lengths():
    world = two()
    energy = sewn(world, **{"from": {"cloth": "a", "side": "right"}, "to": {"cloth": "b", "side": "left"}})
    assert np.allclose(energy.lines(world.start()), [[-1.0, 0, 0]] * 4)
    assert np.allclose(energy.weights.sum(axis=1), 0)
    assert not len(energy.across.vertices)
    other = sewn(world, **{"from": {"cloth": "b", "side": "left"}, "to": {"cloth": "a", "side": "right"}})
    assert np.array_equal(energy.rows, other.rows)


def test_a_line_may_be_drawn_or_numbered():
    world = sheet()
    drawn = sewn(world, to={"through": [[1.0, 0, 0], [1.0, 1.0, 0]]})
    numbered = sewn(world, to={"vertices": [16, 17, 18, 19]})
    assert np.array_equal(drawn.rows, sewn(world).rows)
    assert np.array_equal(numbered.rows, drawn.rows)


def test_a_dart_does_not_sew_its_tip_to_itself():
    world = sheet()
    bottom, left = {"side": "bottom"}, {"vertices": [0, 1, 2, 3]}
    energy = sewn(world, **{"from": bottom, "to": left})
    assert len(energy.rows) == 4
    assert np.linalg.norm(energy.lines(world.start()), axis=1).min() > 0.1


def test_the_strings_are_shortened_from_start_to_end():
    world = sheet()
    energy = sewn(world, start=1.0, end=2.0)
    assert at(energy, world, 0.5).idle
    assert not at(energy, world, 0.5).bending.stiffnesses.size
    assert np.allclose(at(energy, world, 0.95).lengths, 0.95)
    assert np.allclose(at(energy, world, 1.5).lengths, 0.8)
    closed = at(energy, world, 1.9)
    assert not closed.lengths.any()
    assert len(closed.bending.stiffnesses) == 3
    assert closed.drives
    place = world.start(), np.zeros_like(world.start())
    assert len(closed.couplings(*place)) == 4 + 3
    assert not len(at(energy, world, 0.5).couplings(*place))
    assert energy.final_notes(world.start(), 1.0) == ("seam[0] gapes by 1e+03 mm at most",)


def test_with_a_gap_of_contact_the_strings_depend_on_the_start_as_differences_say():
    """Fractions of what the start gapes beyond the gap, of the derivative of the force by the start."""
    world = two()
    energy = sewn(world, **{"from": {"cloth": "a", "side": "right"}, "to": {"cloth": "b", "side": "left"}, "end": 2.0})
    energy = replace(energy, gap=0.2)
    rng = np.random.default_rng(0)
    start, x, a, d = (world.start() + 0.05 * rng.standard_normal(world.start().shape) for _ in range(4))
    step = replace(step_at(start, dt=0.3), time=0.4)

    def power(h):
        return np.vdot(a, energy.begin(replace(step, positions=start + h * d)).gradient(x))

    found = np.vdot(energy.begin(step).past_sensitivity(step, x, a).positions, d)
    assert abs(found) > 1e-3
    assert found == pytest.approx((power(1e-6) - power(-1e-6)) / 2e-6, rel=1e-7)


def test_a_closed_seam_bends_where_a_region_holds_none_of_its_stitches():
    """The far corner of a hinge over the seam moves alone: no stitch is around it."""
    world = sheet()
    closed = at(sewn(world, start=1.0, end=2.0), world, 1.9)
    assert not closed.idle
    stitched, bent = np.unique(closed.rows), np.unique(closed.bending.vertices)
    corner = np.setdiff1d(bent, stitched)[:1]
    x = world.start() + 0.01 * np.random.default_rng(0).standard_normal(world.start().shape)
    part = closed.restricted_to(np.isin(np.arange(len(x)), corner), x)
    assert not len(part.rows)
    assert not part.idle
    np.testing.assert_allclose(part.gradient(x)[corner], closed.gradient(x)[corner], rtol=1e-12)
    assert np.abs(part.gradient(x)[corner]).max() > 0


def test_a_closed_seam_gapes_by_its_force_over_its_stiffness():
    """A panel hangs along x from another one: the stitches, of unequal borders, carry its weight."""
    first, (positions, triangles) = cloth(*grid(2, 3), name="a"), grid(2, 2)
    world = make_world([first, cloth(positions + np.array([1.0, 0, 0]), triangles, name="b")])
    lines = {"from": {"cloth": "a", "side": "right"}, "to": {"cloth": "b", "side": "left"}}
    energies = {
        "membrane": membrane(world),
        "gravity": gravity(world, acceleration=(0.03, 0.0, 0.0)),
        "seams": sewn(world, stiffness=50.0, **lines),
    }
    x = equilibrium(world, energies, world.start(), held(world.start(), np.flatnonzero(world.start()[:, 0] == 0)))
    weight = 0.03 * world.masses[world.cloth_slices[1]].sum()
    gaps = energies["seams"].lines(x)
    assert np.abs(gaps[:, 0]).sum() == pytest.approx(weight / 50.0, rel=1e-6)
    largest = 1e3 * np.linalg.norm(gaps, axis=1).max()
    assert energies["seams"].final_notes(x, 1.0) == (f"seam[0] gapes by {largest:.3g} mm at most",)


RING = {
    "cloth": {
        "mesh": "rectangle",
        "size": [0.6, 0.05],
        "cells": [36, 3],
        "density": 0.2,
        "youngs_modulus": 5e5,
        "bending_stiffness": 1e-3,
        "poisson_ratio": 0.0,
    },
    "effects": {
        "inertia": {},
        "membrane": {},
        "bending": {"model": "hinge"},  # as over the seam: with "midedge" the radii differ by 1.3 %
        "damping": {"rate": 10.0},
        "seams": {"seam": [{"from": LEFT, "to": RIGHT, "end": 0.5}]},
    },
    "solver": {**SOLVER, "dt": 0.02},
    "run": {"duration": 2.0, "frames_per_second": 5},
}


@pytest.fixture(scope="module")
def ring(tmp_path_factory):
    """A strip whose ends are sewn together: bent a little at the start, so that it is clear which way it goes."""
    folder = tmp_path_factory.mktemp("ring")
    from clothsim.mesh.generators.shapes import rectangle

    points, _ = rectangle([0.6, 0.05], [36, 3])
    angle = points[:, 0] / 0.6  # a radian of arc
    arc = np.column_stack([0.6 * np.sin(angle), points[:, 1], 0.6 * (1 - np.cos(angle))])
    (folder / "arc.obj").write_text("".join("v {!r} {!r} {!r}\n".format(*p) for p in arc.tolist()) + "f 1 2 3\n")
    scene = Scene(**RING, seed={"from": "file", "file": "arc.obj"}, directory=folder)
    run = simulate(scene, folder / "out")
    assert run.status == "completed", run.reason
    return run


def test_a_sewn_strip_is_a_ring_of_its_length_over_two_pi(ring):
    x = ring.positions(-1)
    middle = x[ring.positions(0)[:, 0] < 0.28].mean(axis=0)  # the right end is where the left one is already
    radii = np.hypot(*(x - middle)[:, [0, 2]].T)
    assert np.abs(radii / (0.6 / (2 * np.pi)) - 1).max() < 0.01


def test_its_seam_is_closed_to_a_hundredth_of_a_millimetre_and_reports_it(ring):
    x, start = ring.positions(-1), ring.positions(0)
    left, right = (np.flatnonzero(np.abs(start[:, 0] - end) < 1e-6) for end in (start[:, 0].min(), start[:, 0].max()))
    gaps = np.linalg.norm(x[left] - x[right], axis=1)
    assert gaps.max() < 1e-5
    (output,) = json.loads((ring.directory / "summary.json").read_text())["found"]
    assert output == f"seams: seam[0] gapes by {1e3 * gaps.max():.3g} mm at most."


def test_a_closed_seam_bends_like_the_rest(ring):
    """36 angles of about 10 degrees; without hinges over the seam it is a drop with a corner of a hundred."""
    hinges = seams(
        make_world([cloth(ring.positions(0), ring.triangles)]), **RING["effects"]["seams"], built={"bending": None}
    ).across.vertices
    assert len(hinges) == 3
    assert np.abs(np.abs(np.degrees(angles(hinges, ring.positions(-1)))) - 10).max() < 2.5


def test_with_self_contact_a_seam_stays_open_by_what_contact_keeps(tmp_path):
    """Of a sheet that is folded over itself the two sides come to d_hat, not to one another, and nothing crosses."""
    fold = {"through": [[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]], "angle_degrees": [[0.0, 0.0], [0.3, 90.0]]}
    seam = {"from": {"side": "left"}, "to": {"side": "right"}, "start": 0.3, "end": 0.6}
    effects = {"inertia": {}, "membrane": {}, "bending": {}, "damping": {"rate": 10.0}, "self_contact": {"d_hat": 0.01}}
    effects |= {"rest_angle": {"crease": [fold]}, "seams": {"seam": [seam]}}
    sheet_of = {**SHEET, "cells": [8, 4], "bending_stiffness": 0.02}
    run = simulate(small_scene(cloth=sheet_of, body=(), effects=effects, run={"duration": 1.0}), tmp_path)
    assert run.status == "completed", run.reason
    assert run.summary["certificate"]["intersection_free"]
    x, start = run.positions(-1), run.positions(0)
    left, right = (np.flatnonzero(np.abs(start[:, 0] - end) < 1e-9) for end in (-0.5, 0.5))
    gaps = np.linalg.norm(x[left] - x[right], axis=1)
    assert np.abs(gaps / 0.01 - 1).max() < 0.05


def test_no_seam_is_off():
    assert seams(sheet()) == Off("there is no seam")


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"from": {"side": "left"}}, r"seam\[0\] has no to"),
        ({"from": LEFT, "to": RIGHT, "stop": 1}, "no key 'stop'"),
        ({"from": LEFT, "to": "right"}, r"seam\[0\].to must be a table, not 'right'"),
        ({"from": LEFT, "to": {"border": "right"}}, r"seam\[0\]\.to has no key 'border'.*cloth, side"),
        ({"from": LEFT, "to": {"side": "right", "edge": 1}}, "panel with edge"),
        ({"from": LEFT, "to": {"panel": "front"}}, "panel with edge"),
        ({"from": LEFT, "to": {"panel": "front", "edge": 1}}, "which no cloth has"),
        ({"from": LEFT, "to": {}}, "needs one of side, through, vertices"),
        ({"from": LEFT, "to": {"side": "corners"}}, "side is 'corners'"),
        ({"from": LEFT, "to": {"side": "right", "cloth": "b"}}, "'b', which is not a cloth"),
        ({"from": LEFT, "to": {"vertices": [3]}}, "is not a line: it has 1 vertices"),
        ({"from": LEFT, "to": {"vertices": [3, 77]}}, r"vertices\[1\] = 77"),
        ({"from": LEFT, "to": {"through": [[9, 0, 0], [1, 1, 0]]}}, r"through\[0\] is 8 m from the mesh"),
        ({"from": LEFT, "to": LEFT}, r"seam\[0\] .*itself"),
        ({"from": LEFT, "to": RIGHT, "start": 2}, r"seam\[0\] .*2 s to 1 s"),
        ({"from": LEFT, "to": RIGHT, "stiffness": 0}, "stiffness must be above 0"),
        ({"from": LEFT, "to": RIGHT, "flip": 1}, "flip must be true or false"),
    ],
)
def test_bad_seams_are_refused_in_one_sentence(keys, words):
    with pytest.raises(InputError, match=words):
        seams(sheet(), seam=[keys])


def test_a_fabric_without_stiffness_gives_a_seam_none():
    world = make_world([cloth(*grid(4, 3), replace(UNIT, youngs_modulus=0.0))])
    with pytest.raises(InputError, match=r"seam\[0\] has no stiffness: the fabric has none.*N/m"):
        seams(world, seam=[{"from": LEFT, "to": RIGHT}])
    assert not isinstance(seams(world, seam=[{"from": LEFT, "to": RIGHT, "stiffness": 3.0}]), Off)


def test_several_cloths_must_be_named():
    with pytest.raises(InputError, match=r"seam\[0\]\.from .*Cloths: "):
        seams(two(), seam=[{"from": LEFT, "to": RIGHT}])


def strap_on_sheet():
    """A sheet, and a strap 5 mm above it that overlaps with its right side."""
    points, triangles = grid(8, 8)
    strap, more = grid(6, 1)
    placed = strap * np.array([0.6, 0.1, 1.0]) + np.array([0.85, 0.43, 0.005])
    return make_world([cloth(points, triangles), cloth(placed, more, name="strap")]), len(points)


def test_vertices_are_stitched_to_the_nearest_edge_of_another_piece():
    world, n = strap_on_sheet()
    ends = [0, 1, 7, 8]
    made = seams(world, seam=[{"from": {"cloth": "strap", "vertices": ends}, "to": {"nearest": True}}])
    assert (made.rows[:, 0] == np.array(ends) + n).all()
    assert (made.rows[:, 1:] < n).all()
    np.testing.assert_allclose(made.weights.sum(axis=1), 0.0, atol=1e-15)
    x = world.start()
    edges = world.triangles[:128]
    corners = np.linspace(0, 1, 2001)[:, None, None]
    for row, weight, end in zip(made.rows, made.weights, ends, strict=True):
        pairs = np.concatenate([edges[:, [0, 1]], edges[:, [1, 2]], edges[:, [2, 0]]])
        points = (1 - corners) * x[pairs[:, 0]] + corners * x[pairs[:, 1]]
        nearest = np.linalg.norm(points - x[end + n], axis=2).min()
        assert np.linalg.norm(weight @ x[row]) == pytest.approx(nearest, rel=1e-3)
    assert len(made.across.stiffnesses) == 0


def test_the_nearest_of_a_single_piece_is_refused():
    with pytest.raises(InputError, match="no other piece"):
        seams(sheet(), seam=[{"from": {"vertices": [0, 1]}, "to": {"nearest": True}}])


@pytest.mark.parametrize("sides", [({"nearest": True}, RIGHT), (LEFT, {"nearest": False}), (LEFT, {"nearest": 1.5})])
def test_nearest_is_of_the_second_line_alone(sides):
    with pytest.raises(InputError, match="nearest"):
        seams(sheet(), seam=[{"from": sides[0], "to": sides[1]}])
