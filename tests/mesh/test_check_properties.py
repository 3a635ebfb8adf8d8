"""Mesh checks on arrays of any content: they never raise, and clean meshes can be simulated."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import bending, gravity, inertia, membrane
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from meshes import cloth, grid
from solving import integrator_of, run_of

from clothsim.base.errors import InputError
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.mesh.checks import examine, refuse
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Energy

MANY = settings(max_examples=300, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
SOME = settings(MANY, max_examples=60)
COORDINATE = st.sampled_from([0.0, 0.5, 1.0, -1.0, 1e-7, 1e-300, 1e300, -0.0, np.nan, np.inf, -np.inf])
ROLES = st.sampled_from(["cloth", "sewn cloth", "body"])


def points(n):
    return arrays(np.float64, (n, 3), elements=st.one_of(COORDINATE, st.floats(-2, 2)))


@st.composite
def anything(draw):
    """Points, some at one place or not finite, and triangles over a few of them, some out of range."""
    n = draw(st.integers(1, 8))
    faces = draw(arrays(np.int64, st.tuples(st.integers(1, 12), st.just(3)), elements=st.integers(-1, n)))
    return draw(points(n)), faces


EDITS = ("leave out", "repeat", "turn", "fin", "bow-tie", "join", "merge", "flatten", "nan", "beyond", "loose", "soup")


@st.composite
def spoilt_grid(draw):
    """A grid after up to four edits, each of which makes one kind of fault, or none."""
    x, faces = grid(draw(st.integers(1, 3)), draw(st.integers(1, 3)))
    x = x + 0.02 * draw(arrays(np.float64, x.shape, elements=st.sampled_from([0.0, 1.0, -1.0, 0.3])))
    for edit in draw(st.lists(st.sampled_from(EDITS), max_size=4)):
        k, v = draw(st.integers(0, len(faces) - 1)), draw(st.integers(0, len(x) - 1))
        a, b, c = faces[k] % len(x)
        if edit == "leave out" and len(faces) > 1:
            faces = np.delete(faces, k, axis=0)
        elif edit == "repeat":
            faces = np.vstack([faces, np.roll(faces[k], draw(st.integers(0, 2)))])
        elif edit == "turn":
            faces[k] = faces[k, ::-1]
        elif edit in ("fin", "bow-tie"):
            corner = [a, b, len(x)] if edit == "fin" else [a, len(x), len(x) + 1]
            x, faces = np.vstack([x, [[0.3, 0.4, 1.0], [0.5, 0.4, 1.5]]]), np.vstack([faces, corner])
        elif edit == "join":
            faces[faces == c] = v
        elif edit == "merge":
            x[v] = x[b]
        elif edit == "flatten":
            x[b] = 0.5 * (x[a] + x[c])
        elif edit == "nan":
            x[v, 2] = np.nan
        elif edit == "beyond":
            faces[k, 0] = len(x)
        elif edit == "soup":
            x, faces = x[faces % len(x)].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
        elif edit == "loose":
            x = np.vstack([x, [9.0, 9.0, 9.0]])
    return x, faces


def assert_readable(report, x, faces):
    for finding in report.findings:
        assert finding.sentence.startswith(tuple("abcdefghijklmnopqrstuvwxyz(")) or finding.kind in finding.sentence
        assert len(finding.sentence) < 200
        assert finding.remedy
        assert finding.indices.size == 0 or finding.indices.min() >= 0
        assert finding.indices.size == 0 or finding.indices.max() < max(len(x), len(faces))


@MANY
@given(mesh=st.one_of(anything(), spoilt_grid()), role=ROLES)
def test_it_reports_and_never_raises(mesh, role):
    x, faces = mesh
    before = x.copy(), faces.copy()
    report = examine("mesh", x, faces, role)
    assert_readable(report, x, faces)
    np.testing.assert_array_equal(x, before[0])
    np.testing.assert_array_equal(faces, before[1])
    if report.errors:
        with pytest.raises(InputError, match="mesh: "):
            refuse(report)
    else:
        refuse(report)


NESTED = st.recursive(st.none() | st.floats() | st.integers(), lambda inner: st.lists(inner, max_size=4), max_leaves=8)
KINDS = st.sampled_from([np.float32, np.int8, np.complex128, np.bool_, "U2", "M8[s]"])
SHAPES = st.sampled_from([(), (3,), (2, 3), (2, 3, 3)])


@SOME
@given(values=st.one_of(NESTED, st.text(max_size=5), arrays(KINDS, SHAPES)), role=ROLES)
def test_values_of_any_kind(values, role):
    x, faces = grid(1, 1)
    for report in (examine("mesh", values, faces, role), examine("mesh", x, values, role)):
        assert all(finding.sentence and finding.remedy for finding in report.findings)


@MANY
@given(mesh=st.one_of(anything(), spoilt_grid()), turn=st.integers(0, 2), seed=st.integers(0, 100))
def test_the_verdict_depends_on_neither_order_nor_corner(mesh, turn, seed):
    """Triangles in another order, each from another corner: the same kinds of faults, in as many places."""
    x, faces = mesh
    order = np.random.default_rng(seed).permutation(len(faces))
    one, other = examine("mesh", x, faces), examine("mesh", x, np.roll(faces[order], turn, axis=1))

    def kinds(report):
        # of two equal triangles the first in order stays, and which of two halves is turned is a tie
        skip = ("duplicate", "flipped duplicate", "mixed winding")
        return {f.kind: len(f.indices) for f in report.findings if f.kind not in skip}

    if not any(finding.kind in ("flipped duplicate", "one-sided") for finding in one.findings):
        assert kinds(one) == kinds(other)
    assert bool(one.errors) == bool(other.errors)


def simulated(x, faces, stretch):
    """The end of one step of 10 ms of a sheet that starts stretched, under its weight."""
    sheet = replace(cloth(x, faces), positions=x * stretch)
    world = make_world([sheet])
    energies = {
        "inertia": inertia(world),
        "membrane": membrane(world),
        "bending": bending(world),
        "gravity": gravity(world),
    }
    energies = {
        name: energy for name, energy in energies.items() if isinstance(energy, Energy)
    }  # one triangle: no hinge
    return run_of(integrator_of(world, energies, 0.01), 0.01)[-1].state


@SOME
@given(mesh=spoilt_grid(), stretch=st.sampled_from([1.0, 1.02, 0.95]))
def test_what_is_clean_can_be_simulated(mesh, stretch):
    x, faces = mesh
    if examine("mesh", x, faces).errors:
        return
    state = simulated(x, faces, stretch)
    assert np.isfinite(state.positions).all()
    assert np.isfinite(state.velocities).all()


def test_some_of_the_spoilt_grids_are_clean_and_each_fault_occurs():
    """So the properties above are not held by nothing."""
    kinds, clean = set(), 0

    @MANY
    @given(mesh=st.one_of(anything(), spoilt_grid()))
    def collect(mesh):
        nonlocal clean
        report = examine("mesh", *mesh)
        kinds.update(finding.kind for finding in report.findings)
        clean += not report.errors

    collect()
    # too rare among random faces to count on
    both = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 1]])
    kinds.update(finding.kind for finding in examine("mesh", *both).findings)
    assert clean > 20
    expected = {"not finite", "negative index", "index out of range", "repeated corner", "no area", "duplicate"}
    expected |= {"flipped duplicate", "isolated vertex", "soup", "fin", "bow-tie", "mixed winding", "coincident"}
    assert kinds >= expected


@MANY
@given(mesh=st.one_of(anything(), spoilt_grid()))
def test_the_exact_test_takes_what_the_doctor_calls_measurable(mesh):
    """Bad arrays are an InputError, all others an answer: pairs in range, sorted, each once."""
    x, faces = mesh
    sound = np.isfinite(x).all() and faces.min() >= 0 and faces.max() < len(x)
    if not sound:
        with pytest.raises(InputError):
            intersecting_pairs(x, faces)
        return
    pairs = intersecting_pairs(x, faces)
    assert (pairs[:, 0] < pairs[:, 1]).all()
    assert len(np.unique(pairs, axis=0)) == len(pairs)
    again = intersecting_pairs(x, faces, faces)
    both = {tuple(pair) for pair in again.tolist() if pair[0] < pair[1]}
    assert {tuple(pair) for pair in pairs.tolist()} == both
