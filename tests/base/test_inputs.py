"""Earlier names of keywords: they work with a warning, and not beside the present ones."""

import inspect

import pytest

import clothsim
from clothsim.base.inputs import renamed


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
