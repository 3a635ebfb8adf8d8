"""Bodies by their measures: met ones, conflicts, sections against trimesh, and surfaces that do not cross."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from clothsim import InputError, measured_body
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.keys.generator_keys import Proportions
from clothsim.mesh.generators.mannequin.generator import (
    LEVELS,
    TEMPLATE_HEIGHT,
    TEMPLATE_SOLE,
    mannequin,
)
from clothsim.mesh.generators.mannequin.measures import MEASURES, measures_of

PERSON = {
    "height": 1.66, "neck": 0.34, "shoulder_width": 0.36, "chest": 0.88, "waist": 0.74, "hips": 0.95,
    "upper_arm": 0.27, "arm_length": 0.52, "thigh": 0.53, "calf": 0.35, "inside_leg": 0.755, "waist_height": 1.03,
}  # fmt: skip


def test_all_twelve_measures_are_met():
    body = measured_body(**PERSON)
    assert set(PERSON) == set(MEASURES)
    assert max(map(abs, body.residuals.values())) < 2e-4
    assert body.at_bounds == ()
    assert len(intersecting_pairs(*body.mesh())) == 0


def test_what_is_not_given_follows_the_height():
    usual, body = measures_of(Proportions(height=1.5)), measured_body(height=1.5, calf=0.33)
    assert body.keys == {"height": 1.5, "calf": pytest.approx(0.33 / usual["calf"], abs=0.03)}
    for name in ("chest", "thigh", "inside_leg", "neck"):
        assert body.measures[name] == pytest.approx(usual[name], rel=1e-9)


@pytest.mark.parametrize(("name", "reach"), [("neck", 0.2), ("waist", 0.23), ("hips", 0.23), ("thigh", 0.2)])
def test_a_girth_is_that_of_the_section_of_the_whole_mesh(name, reach):
    figure = {"height": 1.6, "waist": 1.2, "hips": 1.1, "thigh": 1.05, "neck": 1.1}
    positions, triangles = mannequin(**figure)
    z = ({**LEVELS, "neck": 1.47, "thigh": 0.72}[name] - TEMPLATE_SOLE) * 1.6 / TEMPLATE_HEIGHT
    edges = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    heights = positions[edges, 2] - z
    cut = (heights > 0).sum(axis=1) == 1
    t = (heights[cut, 0] / (heights[cut, 0] - heights[cut, 1]))[:, None]
    points = (1 - t) * positions[edges[cut, 0]] + t * positions[edges[cut, 1]]
    own = (np.abs(points[:, 0]) < reach) & ((points[:, 0] > 0) | (name != "thigh"))
    measured = measures_of(Proportions(**figure))[name]
    assert ConvexHull(points[own, :2]).area == pytest.approx(measured, rel=0.003)


def test_measures_that_exclude_one_another_leave_residuals():
    body = measured_body(height=1.55, waist=1.4)
    assert body.at_bounds == ("waist",)
    assert body.residuals["waist"] < -0.3
    assert body.residuals["height"] == 0


def test_bodies_of_drawn_measures_do_not_cross_themselves():
    rng = np.random.default_rng(5)
    drawn = {name: rng.uniform(0.93, 1.08, 2) * PERSON[name] for name in ("height", "chest", "waist", "hips", "thigh")}
    for k in range(2):
        body = measured_body(**{name: values[k] for name, values in drawn.items()})
        assert len(intersecting_pairs(*body.mesh())) == 0
        assert body.measures["height"] == drawn["height"][k]


@pytest.mark.parametrize(
    "wrong",
    [
        {"chst": 1.0},
        {"chest": 0.0},
        {"chest": float("nan")},
        {"height": 9.0},
        {"height": 170.0},
        {"hips": "x"},
        {"chest": 96.0},
        {"neck": 1e-3},
        {"arm_length": 1e9},
    ],
)
def test_what_is_no_measure_or_in_another_unit_is_refused(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        measured_body(**wrong)
