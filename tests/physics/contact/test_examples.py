"""Doctests of contact."""

import doctest
from importlib import import_module

import pytest

NAMES = ("body_contact", "friction_coefficients", "self_contact", "stiffness", "surface")


@pytest.mark.parametrize("name", NAMES)
def test_examples_of_the_docstrings(name):
    result = doctest.testmod(import_module(f"clothsim.physics.contact.{name}"))
    assert result.attempted > 0
    assert result.failed == 0
