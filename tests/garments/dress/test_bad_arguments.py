"""Arguments of `dress` that are refused in one sentence, before anything is made."""

import numpy as np
import pytest
from capsule_bodies import person
from sewing_patterns import panel, skirt, specification, stitch

import clothsim
from clothsim.base.errors import InputError
from clothsim.garments.dress.placement import refuse_unsuitable
from clothsim.garments.inputs import BodyMesh, read_body_mesh
from clothsim.patterns.specification import pattern_of

POSITIONS, TRIANGLES = person(0.1)
CONE = specification({"a": panel()}, [stitch(("a", 0), ("a", 1))])


def worn(positions=POSITIONS):
    """The person in memory."""
    return clothsim.Body(np.ascontiguousarray(positions), TRIANGLES, name="person")


CASES = {
    "pattern is a number": ({"pattern": 3}, "pattern"),
    "pattern is not there": ({"pattern": "nowhere.json"}, "nowhere.json"),
    "seam within a triangle": ({"pattern": pattern_of(CONE)}, "a.0 to a.1"),
    "size of 0": ({"size": 0.0}, "size"),
    "negative size": ({"size": -0.02}, "size"),
    "size in words": ({"size": "2cm"}, "size"),
    "size of a thousandth of a millimetre": ({"size": 1e-6}, "size"),
    "unknown fabric": ({"fabric": "steel"}, "steel"),
    "no budget": ({"budget": 0.0}, "budget"),
    "budget in words": ({"budget": "90s"}, "budget"),
    "unknown origin": ({"origin": "head"}, "head"),
    "body in centimetres": ({"on": worn(100 * POSITIONS)}, "tall"),
    "body in kilometres": ({"on": worn(POSITIONS / 1000)}, "tall"),
    "body at the end of the world": ({"on": worn(POSITIONS + 1e7)}, "origin"),
    "flat body": ({"on": worn(POSITIONS * [1, 1, 0])}, "person"),
    "output is a number": ({"output": 3}, "output"),
}


@pytest.mark.parametrize("case", CASES)
def test_refused_by_name(case, tmp_path):
    changed, word = CASES[case]
    arguments = {"pattern": pattern_of(skirt()), "on": worn(), "output": tmp_path / "new", **changed}
    with pytest.raises(InputError) as caught:
        clothsim.dress(arguments.pop("pattern"), arguments.pop("on"), **arguments)
    assert word in str(caught.value)
    assert not (tmp_path / "new").exists()


def test_an_output_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    for output in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / ("x" * 300)):
        with pytest.raises(InputError):
            clothsim.dress(pattern_of(skirt()), worn(), output, size=0.1)


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), "cm"])
def test_scale_must_be_positive(scale):
    with pytest.raises(InputError):
        read_body_mesh("body.obj", scale=scale)


def test_a_doll_is_a_body():
    refuse_unsuitable(BodyMesh("doll", POSITIONS / 6, TRIANGLES, 1.0, ()))
