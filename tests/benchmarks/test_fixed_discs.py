"""Fixed tests of an element: a small disc, and the bar."""

import numpy as np
import pytest

from tests.benchmarks import fixed_discs


@pytest.mark.parametrize("name", fixed_discs.MESHES)
def test_both_meshes_cover_the_disc_and_hold_the_rim_of_the_plate(name):
    points, triangles = fixed_discs.mesh(name, 5)
    first, second = (points[triangles[:, k], :2] - points[triangles[:, 0], :2] for k in (1, 2))
    areas = 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    assert areas.min() > 0
    assert areas.sum() == pytest.approx(0.5 * 30 * 0.15**2 * np.sin(2 * np.pi / 30))
    assert (np.abs(np.hypot(*points[:, :2].T) - 0.09) < 1e-9).sum() == 18


def test_short_waves_bring_a_coarse_stiff_disc_nearer_to_its_limit():
    case = fixed_discs.CASES["stiff, 7 folds"]
    plain, restored = (fixed_discs.coefficient(case, "rings", 5, short_waves=f) for f in (0.0, 1.0))
    assert plain < case.limit - 5
    assert abs(restored - case.limit) < abs(plain - case.limit)


def test_the_exit_code_is_that_of_the_bar(monkeypatch, capsys):
    found = {"rings": 0.0, "Delaunay": 3.4}
    monkeypatch.setattr(fixed_discs, "coefficient", lambda case, name, *_: case.limit + found[name])
    assert fixed_discs.main([]) == 0
    found["rings"] = -3.6
    assert fixed_discs.main(["--elements", "pairs"]) == 1
    assert "331" in capsys.readouterr().out


def test_cases_are_chosen_by_name_and_a_warp_turns_with_its_folds(monkeypatch):
    angles = []
    monkeypatch.setattr(fixed_discs, "coefficient", lambda case, *_: angles.append(case.degrees) or case.limit)
    rows, passed = fixed_discs.table([10], "triangles", 1.0, ["warp"])
    assert (len(rows), passed) == (3, True)
    assert sorted(set(angles)) == [0.0, 22.0, 45.0]
    assert {row[0] for row in fixed_discs.table([10], "triangles", 1.0)[0]} == set(list(fixed_discs.CASES)[:3])
