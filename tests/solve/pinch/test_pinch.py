"""Cloth flypapered through a pinch (contact.pinch): two plates of one body that close on a sheet and open again."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from contacts import two_sheets
from effect_builders import self_contact
from import_graph import FILES, reached, run_roots

import clothsim
from clothsim.base.errors import InputError
from clothsim.cli import main
from clothsim.cli.run_command import verdict
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.generators.shapes import slab
from clothsim.physics.contact.candidate_subsets import ExclusionMask
from clothsim.solve.newton.outcome import Ending, outcome
from clothsim.solve.pinch import pinch
from clothsim.solve.pinch.flypaper import Flypapered, PinchRecord, attached, flypapered_in
from clothsim.solve.pinch.pinch import _contacts
from clothsim.solve.pinch.pinch_gaps import (
    CHUNK,
    INSIDE,
    OUTSIDE,
    Faces,
    closest,
    line_hits,
    nearest_faces,
    pinched,
    sides,
)

EFFECTS = {
    "inertia": {},
    "membrane": {},
    "bending": {"model": "hinge"},
    "gravity": {},
    "damping": {"rate": 2.0},
    "body_contact": {"d_hat": 4e-3},
    "self_contact": {"d_hat": 4e-3},
    "pins": {"select": "corners"},
}
CARRY = {"pinch": "carry"}


def jaws(lowest, frames=7):
    """Positions of both plates of one mesh, whose gap goes from 30 mm to `lowest` and back, and the triangles."""
    plate, triangles = slab((0.12, 0.12, 0.02), (3, 3, 1))
    fraction = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(frames) / (frames - 1))
    heights = 0.5 * (0.03 * (1 - fraction) + lowest * fraction) + 0.01
    along = np.array([0.0, 0.0, 1.0])
    both = [np.concatenate([plate + h * along, plate - h * along]) for h in heights]
    return np.array(both), np.concatenate([triangles, triangles + len(plate)])


def scene(lowest, contact, effects=EFFECTS, duration=0.28):
    frames, triangles = jaws(lowest)
    return clothsim.Scene(
        cloth={"mesh": "rectangle", "size": [0.2, 0.2], "cells": [8, 8]},
        body=clothsim.Body(frames[0], triangles, name="jaws", frames=frames, frames_per_second=25),
        effects=effects,
        contact=contact,
        solver={"dt": 0.01, "threads": 1, "linear": "superlu"},
        run={"duration": duration, "frames_per_second": 25},
    )


def positions(run):
    return np.array([run.positions(k) for k in range(len(run.times))])


@pytest.fixture(scope="module")
def flypapered(tmp_path_factory):
    return clothsim.simulate(scene(-0.004, CARRY), tmp_path_factory.mktemp("carried"))


def test_without_the_policy_the_run_stops(tmp_path):
    run = clothsim.simulate(scene(-0.004, {}, duration=0.16), tmp_path)
    assert run.status == "failed"
    assert run.summary["failure"]["cause"] == "blocked"
    assert "pinch" in run.summary["failure"]["remedy"]
    assert "carried" not in run.summary["certificate"]
    assert "carried" not in run.trajectory.fields


def test_plates_that_cross_complete_and_release_the_sheet(flypapered):
    assert flypapered.status == "completed", flypapered.summary["reason"]
    record = flypapered.summary["certificate"]["carried"]
    assert record["policy"] == "carry"
    assert record["most"] <= record["vertices"] <= 81
    assert record["released"] >= record["vertices"] > 8
    assert record["now"] == 0
    assert 0.08 < record["first_time"] < record["last_time"] < 0.2
    assert abs(np.array(record["first_position"])).max() < 0.03


def test_all_that_intersects_is_carried_and_the_certificate_says_so(flypapered):
    certificate = flypapered.summary["certificate"]
    assert certificate["intersection_free"] is False
    assert certificate["intersections"]["carried"]["states"] == certificate["carried"]["exempt_states"] > 0
    assert certificate["intersections"]["carried"]["most_pairs"] == certificate["carried"]["exempt_pairs"]
    for kind in ("cloth_body", "cloth_cloth", "excluded"):
        assert certificate["intersections"][kind]["states"] == 0
    assert set(certificate["intersecting_frames"]) < set(range(len(flypapered)))
    assert len(flypapered) - 1 not in certificate["intersecting_frames"]


def test_every_frame_says_which_vertices_are_carried(flypapered):
    masks = np.array([flypapered.field("carried", k) for k in range(len(flypapered))])
    assert set(np.unique(masks)) == {0.0, 1.0}
    assert not masks[0].any()
    assert not masks[-1].any()
    x = positions(flypapered)
    inside = (abs(x[..., :2]) < 0.07).all(axis=2)
    assert (inside | (masks == 0)).all()
    counts = {entry["time"]: entry["carried"] for entry in flypapered.record()}
    last = {float(time): int(mask.sum()) for time, mask in zip(flypapered.times[1:], masks[1:], strict=True)}
    assert {time: counts[time] for time in last} == last


@pytest.mark.parametrize("ending", [Ending.BLOCKED, Ending.SINGULAR])
def test_a_blocked_step_is_repeated_at_full_length_with_more_vertices(tmp_path, monkeypatch, ending):
    tries, whole = [], pinch.advance

    def failing_once(integrator, state, until, retries=True):
        report = whole(integrator, state, until, retries)
        if state.time < 0.075:
            return report
        tries.append((state.time, retries, sum(len(one.at(until).vertices) for one in integrator.constraints.values())))
        if len(tries) > 1:
            return report
        return replace(report, result=replace(report.result, outcome=outcome(ending)), failures=("blocked",))

    monkeypatch.setattr(pinch, "advance", failing_once)
    monkeypatch.setattr(pinch, "squeezed", lambda *arguments: np.arange(81))
    run = clothsim.simulate(scene(0.0, CARRY, duration=0.12), tmp_path / "run")
    assert run.status == "completed"
    first, second = tries[:2]
    assert first[:2] == (pytest.approx(0.08), False)
    assert second[:2] == (pytest.approx(0.08), True)
    assert (second[2] > first[2]) == (ending is Ending.BLOCKED)
    step = run.record()[8]
    assert step["dt"] == pytest.approx(0.01)
    assert list(step["failures"]) == (["blocked"] if ending is Ending.BLOCKED else [])


def test_a_gap_that_stays_open_carries_nothing_bit_for_bit(tmp_path):
    runs = [clothsim.simulate(scene(0.012, contact), tmp_path / str(k)) for k, contact in enumerate(({}, CARRY))]
    assert np.array_equal(*map(positions, runs))
    assert runs[0].summary["newton_iterations"] == runs[1].summary["newton_iterations"]
    assert runs[1].summary["certificate"]["carried"]["vertices"] == 0
    assert runs[1].summary["certificate"]["intersection_free"] is True


def test_a_resumed_run_remembers_the_carried_vertices(tmp_path, flypapered):
    def stop(progress):
        if progress.time > 0.135:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        clothsim.simulate(scene(-0.004, CARRY), tmp_path, progress=stop)
    again = clothsim.resume(tmp_path)
    assert np.array_equal(positions(again), positions(flypapered))
    assert again.summary["certificate"]["carried"] == flypapered.summary["certificate"]["carried"]


def test_by_hand_the_history_is_the_same(flypapered):
    simulation = clothsim.Simulation(scene(-0.004, CARRY))
    states = list(simulation)
    assert np.array_equal(states[-1].positions["cloth"], flypapered.positions(-1))
    assert simulation.intersection_free is False
    assert (
        simulation.intersections["carried"]["states"] == flypapered.summary["certificate"]["carried"]["exempt_states"]
    )


def test_what_cannot_be_carried_is_refused(tmp_path):
    without = {name: keys for name, keys in EFFECTS.items() if name != "body_contact"}
    with pytest.raises(InputError, match=r"contact\.pinch"):
        clothsim.simulate(scene(-0.004, CARRY, without), tmp_path)


def test_a_run_without_the_policy_imports_nothing_of_it():
    roots = *run_roots(), "clothsim.run.simulation", "clothsim.physics.contact.setup", "clothsim.cli"
    policy = {module for module in FILES if module.startswith("clothsim.solve.pinch.")}
    assert policy <= reached(*roots, within_functions=True)
    assert not policy & reached(*roots, within_functions=False)


def test_the_command_line_names_the_carried_vertices(flypapered, capsys):
    assert main(["check", str(flypapered.directory)]) == 0
    assert "contact.pinch" in capsys.readouterr().out
    record = flypapered.summary["certificate"]["carried"]
    line = next(line for line in verdict(flypapered, []).splitlines() if line.strip().startswith("pinch"))
    assert f"{record['vertices']} vertices" in line


# --- parts ----------------------------------------------------------------------------------------------------------


def test_carried_vertices_follow_a_rigid_motion():
    random = np.random.default_rng(1)
    x, triangles = random.normal(size=(12, 3)), np.array([[4, 5, 6], [7, 8, 9]])
    weights = random.dirichlet(np.ones(3), 2)
    flypapered = attached(x, np.array([0, 2]), (triangles, weights), (triangles[::-1], weights))
    turned = x @ rotation_matrix(np.array([0.3, -1.0, 0.5])).T + [1.0, 2.0, 3.0]
    assert np.abs(flypapered.positions(x) - x[[0, 2]]).max() < 1e-14
    assert np.abs(flypapered.positions(turned) - turned[[0, 2]]).max() < 1e-13
    by, start = np.array([0.1, -0.2]), x[triangles]
    normal = np.cross(start[:, 1] - start[:, 0], start[:, 2] - start[:, 0])
    along = normal / np.linalg.norm(normal, axis=1)[:, None]
    assert flypapered.raised(by).positions(x) == pytest.approx(flypapered.positions(x) + by[:, None] * along, rel=1e-12)
    again = flypapered_in({"contact.pinch": flypapered.as_array()})
    assert all(
        np.array_equal(getattr(again, name), getattr(flypapered, name)) for name in Flypapered.__dataclass_fields__
    )


def faces(x, triangles):
    """All triangles, which every row of x may touch."""
    return Faces(triangles, np.arange(len(triangles)), np.zeros(len(x), np.int64), np.ones((1, 1), bool))


def test_queries_of_faces_find_what_all_triangles_have():
    random = np.random.default_rng(2)
    corners = random.normal(size=(5 * CHUNK + 3, 1, 3)) + 0.4 * random.normal(size=(5 * CHUNK + 3, 3, 3))
    points = 2 * random.normal(size=(40, 3))
    x, rows = np.concatenate([points, corners.reshape(-1, 3)]), np.arange(40)
    triangles = 40 + np.arange(3 * len(corners)).reshape(-1, 3)
    indices, weights, distances = closest(faces(x, triangles), x, rows, 0.8)
    on_all = trimesh.triangles.closest_point(np.tile(corners, (40, 1, 1)), points.repeat(len(corners), axis=0))
    wanted = np.linalg.norm(on_all.reshape(40, -1, 3) - points[:, None], axis=2)
    near = wanted.min(axis=1) < 0.8
    assert 0 < near.sum() < 40
    assert np.array_equal(indices >= 0, near)
    assert np.allclose(distances[near], wanted.min(axis=1)[near], atol=1e-12)
    assert np.array_equal(indices[near], wanted.argmin(axis=1)[near])
    on = np.einsum("kc,kcd->kd", weights[near], corners[indices[near]])
    assert np.allclose(np.linalg.norm(on - points[near], axis=1), distances[near], atol=1e-12)
    along = 0.3 * random.normal(size=(40, 3)) - points  # most towards the middle
    for entering in (True, False):
        hits = line_hits(faces(x, triangles), x, rows, (points, along), (-0.5, 2.0), entering)
        assert np.allclose(hits, [least_hit(corners, o, d, entering) for o, d in zip(points, along, strict=True)])
        assert 5 < np.isfinite(hits).sum() < 40
    none = closest(faces(x, triangles[:0]), x, rows, 1.0)[0]
    assert (none == -1).all()


def least_hit(corners, o, d, entering):
    """Least t from -0.5 to 2 at which o + t d meets a triangle, by solving for each."""
    found = np.inf
    for a, b, c in corners:
        t, v, w = np.linalg.solve(np.column_stack([-d, b - a, c - a]), o - a)
        if min(v, w, 1 - v - w) >= 0 and -0.5 <= t <= 2.0 and (np.cross(b - a, c - a) @ d < 0 or not entering):
            found = min(found, t)
    return found


def test_vertices_of_objects_that_may_not_touch_are_passed_over():
    x = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, 0.1], [-1, -1, 0], [1, -1, 0], [0, 1, 0]])
    own = Faces(np.array([[2, 3, 4]]), np.zeros(1, np.int64), np.array([0, 1, 2, 2, 2]), np.eye(3, k=2, dtype=bool))
    assert closest(own, x, np.array([0, 1]), 1.0)[0].tolist() == [0, -1]
    lines = x[:2], np.tile([0.0, 0.0, -1.0], (2, 1))
    assert line_hits(own, x, np.array([0, 1]), lines, (0.0, 1.0), entering=True).tolist() == [0.1, np.inf]


@pytest.mark.parametrize("numbers", [[0, 1], [1, 0]])
def test_of_equal_distances_that_of_the_lowest_triangle_counts(numbers):
    x = np.array([[0.0, 0.0, 0.1], [-1, -1, 0], [1, -1, 0], [0, 1, 0]])
    twice = Faces(np.array([[1, 2, 3], [1, 2, 3]]), np.array(numbers), np.zeros(4, np.int64), np.ones((1, 1), bool))
    assert closest(twice, x, np.array([0]), 1.0)[0].tolist() == [numbers.index(0)]


def test_points_inside_and_outside_of_a_box():
    box, triangles = slab((1.0, 1.0, 1.0))
    origins, along = np.array([[0.1, 0.2, 0.3], [0.1, 0.2, -3.0], [0.1, 0.2, 3.0]]), np.tile([0.0, 0.0, 1.0], (3, 1))
    assert sides(box, origins, along, triangles, 1e-9).tolist() == [INSIDE, OUTSIDE, 0]


@pytest.mark.parametrize(("first", "last", "gap"), [(0.02, 0.001, 0.001), (0.02, -0.003, -0.003), (0.02, 0.02, None)])
def test_the_gap_of_two_plates(first, last, gap):
    """A vertex 5 mm above the lower one of two parallel triangles; the upper one comes down."""
    corners = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    start, end = (np.concatenate([[[0.0, 0.0, 0.005]], corners, corners[[0, 2, 1]] + [0, 0, z]]) for z in (first, last))
    plates = faces(start, np.array([[1, 2, 3], [4, 5, 6]]))
    found = pinched(plates, nearest_faces(plates, start, np.array([0]), 0.03), start, end, 0.006, 0.03)
    assert len(found.vertices) == (gap is not None)
    if gap is not None:
        assert abs(found.gaps[0] - gap) < 1e-15
        assert found.near.tolist() == [[1, 2, 3]]
        assert found.far.tolist() == [[4, 5, 6]]


@pytest.mark.parametrize(("beside", "count"), [(0.99, 1), (1.01, 0)])
def test_a_vertex_beside_a_plate_by_more_than_the_limit_is_not_in_its_gap(beside, count):
    limit = 0.006
    corners = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    above = 2 * corners[[0, 2, 1]]
    vertex = [[0.0, -1.0 - beside * limit, 0.005]]
    start, end = (np.concatenate([vertex, corners, above + np.array([0, 0, z])]) for z in (0.02, 0.001))
    plates = faces(start, np.array([[1, 2, 3], [4, 5, 6]]))
    near = nearest_faces(plates, start, np.array([0]), 0.03)
    assert len(pinched(plates, near, start, end, limit, 0.03).vertices) == count


def test_pairs_are_excluded_by_their_definition():
    """Pair by pair: rows 0..5 are cloth, 0..2 flypapered; 6..9 body, 6 and 7 of the patch of 0."""
    flypapered = np.arange(10) < 3
    own = {(0, 6), (0, 7)}
    exclusion = ExclusionMask(flypapered, np.array(sorted(v * 10 + q for v, q in own)))
    random = np.random.default_rng(3)
    cloth, body = random.integers(0, 6, (400, 3)), random.integers(6, 10, (400, 3))
    kinds = {"point": (1, 3), "triangle": (3, 1), "edges": (2, 2)}
    elements, wanted = [], []
    for kind, (n_cloth, n_body) in kinds.items():
        for c, b in zip(cloth[:, :n_cloth], body[:, :n_body], strict=True):
            elements.append([*b, *c] if kind == "triangle" else [*c, *b])
            held = [v for v in c if flypapered[v]]
            wanted.append(len(held) == n_cloth or any((v, q) not in own for v in held for q in b))
    mask = exclusion.mask(np.array(elements), 800, is_self=False)
    assert mask.tolist() == wanted
    assert 0 < sum(wanted) < len(wanted)
    self_pairs = random.integers(0, 6, (200, 4))
    assert np.array_equal(exclusion.mask(self_pairs, 100, is_self=True), (self_pairs < 3).all(axis=1))


@pytest.mark.parametrize("offset", [0.0, 0.1])
def test_a_contact_has_the_vertices_that_bear_it(offset):
    """Sheets vertex over vertex: of each pair of a point and a triangle one vertex on either side."""
    world = two_sheets(gap=offset + 0.001)
    contact, x = self_contact(world, d_hat=0.01, offset=offset, stiffness=1.0), world.start()
    for rows, places, directions, partners in _contacts(contact, x, world.n_cloth):
        assert len(rows) > 10
        assert ((rows >= 0) & (partners >= 0)).sum() == 0
        assert ((rows >= 0).sum(axis=1) == 1).all()
        assert ((partners >= 0).sum(axis=1) == 1).all()
        assert places == pytest.approx(x[rows.max(axis=1)])
        assert np.abs(directions) == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(rows), 1)))


def test_the_record_has_the_first_place_and_the_most_of_the_carried_vertices(monkeypatch):
    monkeypatch.setattr(
        "clothsim.solve.pinch.flypaper.flypapered_in", lambda rows: SimpleNamespace(vertices=np.array(rows))
    )
    x, world = np.arange(12.0).reshape(4, 3), SimpleNamespace(origin=np.array([10.0, 20.0, 30.0]))
    memories = [[], [1, 3], [1], [0, 1, 2]]
    states = [SimpleNamespace(memory=rows, positions=x + k, time=0.5 * k) for k, rows in enumerate(memories)]
    record = PinchRecord()
    for before, state in pairwise(states):
        record = record.after(world, before, state, [])
    assert record.vertices == (0, 1, 2, 3)
    assert (record.most, record.now, record.steps, record.released) == (3, 3, 3, 1)
    assert (record.first_time, record.last_time) == (0.5, 1.5)
    assert record.first_position == tuple((x[[1, 3]].mean(axis=0) + 1.0 + world.origin).tolist())
