"""Marker files: syntax, and effect on the transfer."""

from dataclasses import replace

import numpy as np
import pytest
from fitting_cases import capsule_figure, tube_garment

from clothsim.base.errors import InputError
from clothsim.garments.fit.transfer_seed import marked_vertices, read_markers, transferred

FIGURE, OTHER = capsule_figure(), capsule_figure(radius=0.12, segments=20, name="other")


def places_on_both():
    """Points in three directions at two heights, on the source and on the target turned by 90 degrees about z."""
    rows = []
    for z in (-0.3, 0.3):
        for angle in np.radians([0, 90, 180]):
            here, there = ([r * np.cos(a), r * np.sin(a), z] for r, a in ((0.1, angle), (0.12, angle + np.pi / 2)))
            rows.append([*here, *there])
    return np.array(rows)


def test_a_file_is_read_with_comments_and_commas(tmp_path):
    file = tmp_path / "markers.txt"
    file.write_text("# left, right\n0 1 2  3 4 5\n\n1, 2, 3, 4, 5, 6e-1  # nose\n")
    np.testing.assert_array_equal(read_markers(file), [[0, 1, 2, 3, 4, 5], [1, 2, 3, 4, 5, 0.6]])


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "has no marker"), ("1 2 3\n", "Line 1"), ("0 0 0 0 0 0\n1 2 3 4 5 nan\n", "Line 2"), ("a b\n", "Line 1")],
)
def test_a_bad_file_is_named_with_its_line(text, message, tmp_path):
    file = tmp_path / "markers.txt"
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        read_markers(file)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.txt"):
        read_markers(tmp_path / "none.txt")


def test_the_nearest_vertices_are_taken_in_the_units_of_the_files():
    points = places_on_both()
    in_millimetres = replace(FIGURE, scale=1e-3)
    scaled = np.column_stack([1e3 * points[:, :3], points[:, 3:]])
    vertices = marked_vertices(scaled, in_millimetres, OTHER)
    np.testing.assert_array_equal(vertices, marked_vertices(points, FIGURE, OTHER))
    assert np.linalg.norm(FIGURE.positions[vertices[:, 0]] - points[:, :3], axis=1).max() < 0.05


def test_a_marker_off_the_body_is_refused():
    points = places_on_both()
    points[2, 3:] += 1.0
    with pytest.raises(InputError, match=r"\b3\b.* mm .*other"):
        marked_vertices(points, FIGURE, OTHER)


def test_markers_turn_the_garment_with_the_body():
    """A capsule looks the same from all sides: only the markers tell that the other one is turned by 90 degrees."""
    garment = tube_garment(0.115)
    seed = transferred(garment, FIGURE, OTHER, places_on_both())
    assert "6 given markers" in seed.description
    before, after = (np.arctan2(x[:, 1], x[:, 0]) for x in (garment.positions, seed.positions))
    turned = np.angle(np.exp(1j * (after - before)))
    assert abs(np.median(turned) - np.pi / 2) < 0.1
