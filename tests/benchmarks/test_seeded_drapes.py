"""Transfer seed against a cold start, on the small case."""

import numpy as np
import pytest

from clothsim.garments.stages import Garment
from clothsim.mesh.generators.sheets import tube
from tests.benchmarks.seeded_drapes import as_text, compare, main, steps_to_rest, tube_on_capsule


@pytest.mark.parametrize(
    ("fastest", "steps"), [([1, 1, 0.1, 0.1], 3), ([0.1, 0.1], 1), ([0.1, 1, 0.1], 3), ([1, 1], None), ([0.1, 1], None)]
)
def test_rest_is_where_nothing_is_fast_until_the_end(fastest, steps):
    assert steps_to_rest(fastest, 0.5) == steps


def test_both_starts_are_counted():
    case = tube_on_capsule()
    x, triangles = tube(radius=0.17, height=0.15, cells=(12, 3))
    small = type(case)(Garment("tube", x[:, [2, 0, 1]], triangles), case.source, case.target)
    seeded, cold = compare(small, duration=0.03, bound=10.0)
    assert seeded.preparing_iterations == 0
    assert cold.preparing_iterations > 0
    assert (seeded.rest_at, cold.rest_at) == pytest.approx((0.03, 0.03))
    assert np.linalg.norm(seeded.positions - cold.positions, axis=1).max() < 0.03
    output = as_text([seeded, cold])
    assert "times fewer Newton iterations" in output
    assert "mm apart" in output


def test_bad_arguments_end_in_a_sentence():
    with pytest.raises(SystemExit):
        main(["--duration", "-1"])
    with pytest.raises(SystemExit):
        main(["--case", "coat"])
