"""Earlier names of keywords: they work with a warning, and not beside the present ones."""

import inspect

import pytest

import clothsim
from clothsim.base.inputs import called, renamed


@renamed(cut_for="made_for")
def dressed(pattern, made_for=None):
    return pattern, made_for


def test_an_earlier_keyword_is_taken_with_a_warning():
    assert dressed("shirt", made_for="his") == ("shirt", "his")
    with pytest.warns(DeprecationWarning, match="made_for"):
        assert dressed("shirt", cut_for="his") == ("shirt", "his")
    with pytest.raises(clothsim.InputError, match="cut_for"):
        dressed("shirt", cut_for="his", made_for="hers")


def test_the_public_functions_show_the_present_names():
    assert {"made_for", "waistband"} <= set(inspect.signature(clothsim.dress).parameters)
    assert {"parameters", "progress"} <= set(inspect.signature(clothsim.study_accuracy).parameters)


def test_what_a_function_of_the_users_raises_is_told_with_its_name():
    def gusts(time):
        raise KeyError("north")

    with pytest.raises(clothsim.InputError, match=r"wind: .*gusts raised KeyError: 'north'") as caught:
        called("wind", gusts, 0.1)
    assert isinstance(caught.value.__cause__, KeyError)
    assert called("wind", lambda time: 2 * time, 0.1) == 0.2
