import numpy as np
import pytest
from PIL import Image

from clothsim.mesh.generators.table import GENERATORS
from clothsim.render.marks import INK, draw_closeup
from clothsim.render.styles import margins
from clothsim.render.surface_look import Surface

SIZE = (192, 144)


def surface(name, role, mesh, shift=(0.0, 0.0, 0.0), **keys):
    positions, triangles = GENERATORS[mesh](**keys)
    stretches = np.full((len(triangles), 2), 1.01) if role == "cloth" else np.zeros((0, 2))
    return Surface(name, positions + np.array(shift), triangles, role, stretches)


def sheet(**keys):
    return surface("sheet", "cloth", "rectangle", size=(1.0, 1.0), cells=(20, 20), **keys)


def drawn(tmp_path, surfaces, place, **keys):
    note = draw_closeup(tmp_path / "place.png", surfaces, np.array(place), size=SIZE, renderer="ray", **keys)
    assert "ray" in note
    return np.asarray(Image.open(tmp_path / "place.png").convert("RGB")).astype(int)


def marked(image):
    """Pixels (row, column) of the ring's colour."""
    return np.argwhere(np.abs(image - INK).sum(axis=2) < 30)


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (0.5, -0.5, 0.0), (-0.4, 0.2, 0.0)])
def test_the_ring_is_in_the_middle_of_what_is_free(tmp_path, place):
    """Left of the bar."""
    rows, columns = marked(drawn(tmp_path, [sheet()], place)).mean(axis=0)
    room = margins(SIZE, True, "")
    assert rows == pytest.approx(0.5 * SIZE[1], abs=0.1 * SIZE[1])
    assert columns == pytest.approx(0.5 * SIZE[0] * (1 + (room.left - room.right) / 2), abs=0.05 * SIZE[0])


def test_the_place_is_seen_close(tmp_path):
    """A place at the middle of a sheet: sheet all round, no background at the left edge of the picture."""
    image = drawn(tmp_path, [sheet()], (0.0, 0.0, 0.0))
    low = image[-30:, : SIZE[0] // 2]
    assert (np.ptp(low, axis=2) > 8).mean() > 0.9  # the sheet's colour, not the grey of the backdrop


def test_a_view_is_taken_from_which_nothing_hides_the_place(tmp_path):
    """A wall on the side of the usual view: the sheet is still seen round the ring."""
    wall = surface("wall", "body", "slab", shift=(0.0, -0.3, 0.4), size=(4.0, 0.05, 2.0))
    image = drawn(tmp_path, [sheet(), wall], (0.0, 0.0, 0.0))
    rows, columns = marked(image).mean(axis=0).astype(int)
    around = image[rows + 9 : rows + 14, columns - 12 : columns + 12]
    assert (np.ptp(around, axis=2) > 8).mean() > 0.8


def test_a_body_all_round_the_place_is_cut_open(tmp_path):
    ball = surface("ball", "body", "sphere", radius=0.3, subdivisions=2)
    inside = drawn(tmp_path, [sheet(), ball], (0.0, 0.0, 0.0), title="held")
    assert len(marked(inside)) > 20
    rows, columns = marked(inside).mean(axis=0).astype(int)
    around = inside[rows + 9 : rows + 14, columns - 12 : columns + 12]
    assert (np.ptp(around, axis=2) > 8).mean() > 0.8
