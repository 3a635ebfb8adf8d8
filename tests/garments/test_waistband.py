"""Waistbands: closed to the girth below them, on what hangs from the hips and on nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from clothsim.garments.inputs import BodyMesh
from clothsim.garments.waistband import LEAST, TIGHT, border_loops, girth_at, loose_edge, turns_about, with_waistbands
from clothsim.mesh.generators.shapes import tube
from clothsim.mesh.generators.table import GENERATORS
from transfer.body_frame import girth, level_set, loops
from transfer.body_parts import body_parts

BODY = BodyMesh("mannequin", *GENERATORS["mannequin"](), 1.0, ())
PARTS = body_parts(BODY.positions, BODY.triangles)
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def loop_length(positions, loop):
    return np.linalg.norm(np.diff(positions[loop], axis=1), axis=2).sum()


@pytest.mark.parametrize("name", ["skirt", "trousers"])
def test_a_band_is_a_little_shorter_than_the_girth_below_it_and_the_hem_is_as_it_was(name):
    positions, triangles = GENERATORS[name]()
    band = max(border_loops(triangles), key=lambda loop: positions[loop, 2].mean())
    rest, factors = with_waistbands(positions, triangles, BODY, PARTS)
    section = level_set(BODY.positions, BODY.triangles, BODY.positions[:, 2], positions[band, 2].mean())
    on_body = girth(loops(section, BODY.triangles)[0])  # the arms are the others
    assert loop_length(rest, band) == pytest.approx(TIGHT * on_body, rel=5e-3)
    assert factors == pytest.approx([loop_length(rest, band) / loop_length(positions, band)], rel=5e-3)
    below = positions[:, 2] < positions[band, 2].mean() - 0.1
    assert np.allclose(rest[below], positions[below], atol=1e-12)
    assert np.allclose(rest[:, 2], positions[:, 2], atol=1e-12)  # as long as it was


def test_a_turned_body_gets_the_band_turned_alike():
    positions, triangles = GENERATORS["skirt"]()
    rest = with_waistbands(positions, triangles, BODY, PARTS).rest
    other = replace(BODY, positions=BODY.positions @ TURN.T)
    parts = body_parts(other.positions, other.triangles)
    turned = with_waistbands(positions @ TURN.T, triangles, other, parts).rest
    assert np.abs(turned - rest @ TURN.T).max() < 1e-3


def test_shoulders_a_bell_and_a_tight_band_are_left_as_they_are():
    shirt = GENERATORS["shirt"]()
    kept = with_waistbands(*shirt, BODY, PARTS)
    assert kept.factors == ()
    assert kept.rest is shirt[0]
    points, triangles = tube(radius=0.1, height=0.3, cells=(24, 6))
    middle = girth_at(PARTS.frame.local(BODY.positions), BODY.triangles, np.array([0.0, 1.05, 0.0])) / (2.0 * np.pi)
    centre = [0.0, 0.0, 0.9]
    widths = {0.9 * TIGHT * middle: 0, 1.2 * middle: 1, 1.1 * TIGHT * middle / LEAST: 0}
    for radius, bands in widths.items():
        shape = points * [radius / 0.1, radius / 0.1, 1.0] + centre
        assert len(with_waistbands(shape, triangles, BODY, PARTS).factors) == bands
        assert bool(loose_edge(shape, triangles, BODY)) == (radius > 1.2 * middle)
    assert loose_edge(*shirt, BODY) == ""
    assert loose_edge(points, triangles, BodyMesh("tube", points, triangles, 1.0, ())) == ""


def test_a_loop_that_does_not_surround_an_axis_makes_no_turn():
    angles = np.linspace(0.0, 2.0 * np.pi, 13)
    loop = np.stack([np.cos(angles), 0.1 * angles, np.sin(angles)], axis=1)
    edges = np.stack([loop[:-1], loop[1:]], axis=1)
    assert abs(turns_about(edges)) == pytest.approx(1.0)
    assert turns_about(edges + np.array([3.0, 0.0, 0.0])) == pytest.approx(0.0, abs=1e-12)
