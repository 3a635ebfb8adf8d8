"""Drawings of sewing patterns."""

from itertools import combinations
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from sewing_patterns import skirt

from clothsim.base.errors import InputError
from clothsim.patterns.pattern import Side
from clothsim.patterns.specification import pattern_of
from clothsim.render.pattern_drawing import draw_pattern, laid_out, seam_colours


def test_svg_opens_and_has_the_names_and_numbers(tmp_path):
    file = draw_pattern(tmp_path / "skirt.svg", pattern_of(skirt()), "Skirt")
    words = [
        "".join(node.itertext()).strip() for node in ElementTree.parse(file).iter("{http://www.w3.org/2000/svg}text")
    ]
    assert sorted(words) == ["0", "0", "1", "1", "Skirt", "back", "front"]


def test_svg_has_the_same_bytes_each_time(tmp_path):
    first, second = (draw_pattern(tmp_path / f"{k}.svg", pattern_of(skirt())).read_bytes() for k in range(2))
    assert first == second


def test_png(tmp_path):
    with Image.open(draw_pattern(tmp_path / "skirt.png", pattern_of(skirt()))) as image:
        pixels = np.asarray(image.convert("RGB"))
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 10


def test_panels_do_not_overlap_on_the_sheet():
    outlines = {name: panel.outline for name, panel in pattern_of(skirt()).panels.items()}
    shifts, size = laid_out(outlines)
    boxes = [
        np.array([(points + shifts[name]).min(0), (points + shifts[name]).max(0)]) for name, points in outlines.items()
    ]
    for a, b in combinations(boxes, 2):
        assert ((a[1] < b[0]) | (b[1] < a[0])).any()
    assert all((box[0] >= 0).all() and (box[1] <= size).all() for box in boxes)


def test_both_sides_of_a_seam_have_its_number_and_colour():
    colours = seam_colours(pattern_of(skirt()))
    assert colours[Side("front", 1)] == colours[Side("back", 3)]
    assert colours[Side("front", 1)] != colours[Side("front", 3)]
    assert Side("front", 0) not in colours


def test_other_formats_are_refused(tmp_path):
    with pytest.raises(InputError):
        draw_pattern(tmp_path / "skirt.bmp", pattern_of(skirt()))
