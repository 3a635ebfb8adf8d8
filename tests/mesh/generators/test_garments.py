"""Garments: sound, symmetric, with clean borders, and clear of themselves and of the body by the exact test."""

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.mesh.checks import examine
from clothsim.mesh.generators.mannequin.generator import mannequin
from clothsim.mesh.generators.table import GENERATORS
from clothsim.mesh.topology import border_edges, components, unique_edges
from tests.benchmarks.make_mannequin import body_field

LOOPS = {"shirt": 4, "skirt": 2, "trousers": 3}
BODY_KEYS = ("height", "chest", "waist", "hips", "shoulder_width", "limb_girth")
FIGURES = [
    {},
    {"height": 1.85, "chest": 1.2, "waist": 1.3, "hips": 1.2, "limb_girth": 1.15},
    {"height": 1.5, "chest": 0.85, "waist": 0.8, "hips": 0.85, "limb_girth": 0.75, "shoulder_width": 0.95},
    {"chest": 1.35, "waist": 1.6, "hips": 1.45, "limb_girth": 1.2, "shoulder_width": 1.15},
    {"chest": 0.85, "waist": 1.2, "hips": 1.45, "limb_girth": 1.2, "shoulder_width": 1.1},
]


def smallest_angle(positions, triangles):
    corners = positions[triangles]
    angles = []
    for k in range(3):
        one, two = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        angles.append(np.arctan2(np.linalg.norm(np.cross(one, two), axis=1), (one * two).sum(axis=1)))
    return np.degrees(np.min(angles))


def loops(positions, triangles):
    """The border loops, each as its vertices."""
    border = border_edges(triangles)[0]
    number = components(border[:, [0, 1, 1]], len(positions))
    return [np.unique(border[number[border[:, 0]] == k]) for k in np.unique(number[border[:, 0]])]


@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.parametrize("edge", [0.018, 0.025])
def test_a_garment_is_a_sound_cloth_with_clean_borders(name, edge):
    positions, triangles = GENERATORS[name](edge=edge)
    assert examine(name, positions, triangles).findings == ()
    borders = loops(positions, triangles)
    assert len(borders) == LOOPS[name]
    assert len(positions) - len(unique_edges(triangles)) + len(triangles) == 2 - len(borders)
    for loop in borders:  # flat: a border is where one plane cuts
        singular = np.linalg.svd(positions[loop] - positions[loop].mean(axis=0), compute_uv=False)
        assert singular[2] / np.sqrt(len(loop)) < 1e-4
    assert smallest_angle(positions, triangles) > 12
    ends = positions[unique_edges(triangles)]
    lengths = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    assert np.median(lengths) == pytest.approx(edge, rel=0.12)
    assert lengths.max() < 2 * edge


@pytest.mark.parametrize("name", LOOPS)
def test_a_garment_has_the_promised_size_and_ease(name):
    positions, triangles = GENERATORS[name]()
    assert 2000 <= len(positions) <= 4000
    template = positions * (1.69085 / 1.7) + (0, 0, 0.00413)
    distance = body_field(template)[0]
    assert distance.min() > (0.012 if name == "shirt" else 0.008) - 5e-4
    outward = np.cross(*(positions[triangles[:, k]] - positions[triangles[:, 0]] for k in (1, 2)))
    centres = template[triangles].mean(axis=1)
    assert ((outward * body_field(centres)[1]).sum(axis=1) > 0).mean() > 0.97


@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.parametrize("figure", FIGURES, ids=range(len(FIGURES)))
def test_a_garment_is_clear_of_its_body_and_of_itself(name, figure):
    cloth, triangles = GENERATORS[name](**figure)
    body, skin = mannequin(**figure)
    assert len(intersecting_pairs(cloth, triangles)) == 0
    both = np.concatenate([cloth, body])
    assert len(intersecting_pairs(both, triangles, skin + len(cloth))) == 0


@pytest.mark.parametrize("name", LOOPS)
def test_a_tight_coarse_garment_is_still_clear(name):
    cloth, triangles = GENERATORS[name](edge=0.03, ease=0.0058)
    body, skin = mannequin()
    both = np.concatenate([cloth, body])
    assert len(intersecting_pairs(both, triangles, skin + len(cloth))) == 0


def test_a_garment_is_symmetric_and_the_same_each_time():
    positions, _ = GENERATORS["shirt"](edge=0.03)
    again, _ = GENERATORS["shirt"](edge=0.03)
    np.testing.assert_array_equal(positions, again)
    rounded = np.round(positions, 9) + 0.0
    image = np.round(positions * (-1, 1, 1), 9) + 0.0
    assert set(map(tuple, rounded)) == set(map(tuple, image))


def test_the_sleeve_and_the_hem_are_where_they_were_asked_for():
    short, long = (GENERATORS["shirt"](edge=0.03, sleeve=length)[0] for length in (0.15, 0.45))
    assert long[:, 0].max() - short[:, 0].max() == pytest.approx(0.3 * np.cos(np.radians(50)), abs=0.04)
    skirt, _ = GENERATORS["skirt"](edge=0.03, hem=0.3)
    assert skirt[:, 2].min() == pytest.approx((0.3 - 0.00413) * 1.7 / 1.69085, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "keys", "words"),
    [
        ("shirt", {"edge": 0.001}, ["edge", "0.006", "0.04"]),
        ("shirt", {"edge": "fine"}, ["edge", "fine"]),
        ("shirt", {"ease": 0.001}, ["ease", "0.0040", "0.06", "0.018", "0.001"]),
        ("shirt", {"ease": 0.5}, ["ease", "0.06"]),
        ("shirt", {"sleeve": 1.0}, ["sleeve", "0.13", "0.46"]),
        ("shirt", {"opening": 0.01}, ["opening", "0.018", "0.01"]),
        ("shirt", {"chest": 2}, ["chest", "0.8"]),
        ("skirt", {"hem": 0.9}, ["hem", "0.15", "0.75"]),
        ("trousers", {"hem": 0.01}, ["hem", "0.1", "0.6"]),
    ],
)
def test_a_bad_key_is_named(name, keys, words):
    with pytest.raises(InputError) as caught:
        GENERATORS[name](**keys)
    assert caught.value.sentence.split()[0].removeprefix(f"{name}.") == words[0]
    assert [word for word in words if word not in str(caught.value)] == []


@pytest.mark.parametrize(
    ("keys", "n_borders"), [({"hood": True}, 4), ({"opening": 0.05}, 3), ({"hood": True, "opening": 0.05}, 3)]
)
def test_a_hoody_and_a_jacket_are_sound_and_clear_of_the_body(keys, n_borders):
    positions, triangles = GENERATORS["shirt"](edge=0.03, ease=0.02, sleeve=0.46, **keys)
    assert examine("shirt", positions, triangles).findings == ()
    borders = loops(positions, triangles)
    assert len(borders) == n_borders
    assert smallest_angle(positions, triangles) > 12
    body, skin = mannequin()
    both = np.concatenate([positions, body])
    assert len(intersecting_pairs(both, triangles, skin + len(positions))) == 0
    assert (positions[:, 2].max() > body[:, 2].max()) == ("hood" in keys)
    front = positions[(positions[:, 1] < 0) & (abs(positions[:, 2] - 1.2) < 0.1)]
    assert 2 * abs(front[:, 0]).min() == pytest.approx(keys.get("opening", 0.0), abs=1e-3)
