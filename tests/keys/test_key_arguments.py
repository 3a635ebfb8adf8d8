"""Arguments of sections in Python that they do not take: errors of clothsim, with the word that was meant."""

import copy
import pickle

import pytest

import clothsim
from clothsim import InputError

TRIANGLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]


@pytest.mark.parametrize(
    ("make", "named", "meant"),
    [
        (lambda: clothsim.Cloth(*TRIANGLE, fabirc="denim"), "fabirc", "'fabric'"),
        (lambda: clothsim.Cloth(fabirc="denim"), "fabirc", "'fabric'"),
        (lambda: clothsim.Cloth(fabric="denim"), "vertices", "clothsim.Cloth(vertices=...)"),
        (lambda: clothsim.Gravity(9.81), "9.81", "Gravity(acceleration=(0.0, 0.0, -9.81))"),
        (lambda: clothsim.Gravity(accelerat=[0, 0, 1]), "accelerat", "'acceleration'"),
        (lambda: clothsim.Pins("top"), "top", "Pins("),
        (lambda: clothsim.Solver(0.02), "0.02", "Solver(dt=0.01)"),
        (lambda: clothsim.RunSettings(durations=2), "durations", "'duration'"),
        (lambda: clothsim.Body(*TRIANGLE, [1], [2]), "clothsim.Body", "frames_per_second=25.0"),
        (lambda: clothsim.Scene(cloths={"mesh": "rectangle"}), "cloths", "'cloth'"),
    ],
)
def test_what_a_section_does_not_take_is_an_input_error(make, named, meant):
    with pytest.raises(InputError) as caught:
        make()
    assert named in caught.value.sentence
    assert meant in caught.value.remedy


@pytest.mark.parametrize(
    "made", [clothsim.Gravity(), clothsim.Gravity(acceleration=[0, 0, -1]), clothsim.Solver(dt=0.02, threads=1)]
)
def test_copies_and_pickles_stay(made):
    assert pickle.loads(pickle.dumps(made)) == made
    assert copy.deepcopy(made) == made
