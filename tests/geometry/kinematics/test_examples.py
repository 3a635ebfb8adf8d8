"""Doctests of the kinematics."""

import doctest
from importlib import import_module

import pytest


@pytest.mark.parametrize("name", ["deformation_gradient", "stretch", "kabsch_frames"])
def test_examples_of_the_docstrings(name):
    result = doctest.testmod(import_module(f"clothsim.geometry.kinematics.{name}"))
    assert result.attempted > 0
    assert result.failed == 0
