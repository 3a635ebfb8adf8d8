"""Doctests of intersection."""

import doctest
from importlib import import_module

import pytest


@pytest.mark.parametrize("name", ["crossings", "intersecting_pairs"])
def test_examples_of_the_docstrings(name):
    result = doctest.testmod(import_module(f"clothsim.geometry.intersection.{name}"))
    assert result.attempted > 0
    assert result.failed == 0
