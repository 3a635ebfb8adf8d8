"""Errors of both bending models in twist, vibration and buckling: that of mid-edge vanishes, that of hinges stays."""

import pytest

from tests.benchmarks.hinge_errors import buckling, mode, twist


@pytest.mark.parametrize("diagonals", ["right", "delaunay"])
def test_a_twisted_plate(diagonals):
    assert abs(twist(6, diagonals, "midedge")) < 1e-5
    assert twist(6, diagonals, "hinge") > 1


def test_a_strip_that_vibrates_and_buckles():
    assert abs(mode(10, "alternating", "midedge")) < 0.01
    assert mode(10, "alternating", "hinge") < -0.15
    assert abs(buckling(10, "alternating", "midedge")) < 0.02
    assert buckling(10, "alternating", "hinge") < -0.3
