"""The score of the reality page: closed forms, limits of the skill, and a folder without data."""

import json

import numpy as np
import pytest

from tests.reality import causes, specimens
from tests.reality.__main__ import RECORD, main
from tests.reality.borders import DROPPED, Lays, measured_lays, scatter_of_centres, single_lays
from tests.reality.ensembles import BENDING_LENGTHS, MEMBERS, RATIOS, SOFTENING, fitted, sheet
from tests.reality.knits import Pulls, compared
from tests.reality.score import energy_score, mean_scores, scored, skills_over_one_rival


def test_the_energy_score_of_two_points_is_their_distance_less_half_their_spread():
    ensemble, lay = np.array([[0.0, 0, 0], [2.0, 0, 0]]), np.array([[1.0, 0, 0]])
    assert energy_score(ensemble, lay, np.ones(3)) == pytest.approx(1 - 0.5 * 1)
    assert energy_score(ensemble, lay, np.full(3, 2.0)) == pytest.approx(0.25)


def fabrics(n):
    rng = np.random.default_rng(5)
    centres = np.column_stack([rng.uniform(0.2, 0.9, n), rng.uniform(5, 9, n), rng.uniform(4e-3, 12e-3, n)])
    cloud = [centre + rng.normal(0, [0.02, 0.4, 4e-4], (82, 3)) for centre in centres]
    return [Lays(k, each[:2], each[2:42]) for k, each in enumerate(cloud)], [each[42:] for each in cloud]


def test_the_cloth_itself_has_the_skill_of_the_ceiling_and_another_cloth_has_none():
    lays, same = fabrics(8)
    for each in scored(lays, same):
        assert each.simulated == pytest.approx(each.ceiling, rel=0.15)
    away = scored(lays, [each + np.array([0.3, 2, 3e-3]) for each in same])
    assert all(each.skill(each.simulated) < 0 for each in away)


def test_one_rival_is_never_better_than_the_better_of_both_for_each_fabric():
    scores = scored(*fabrics(8))
    rivals, skills = skills_over_one_rival(scores)
    means, in_hindsight = mean_scores(scores)
    assert min(rivals) >= means[2]
    assert all(one >= other for one, other in zip(skills, in_hindsight, strict=True))
    assert skills[0] == pytest.approx((min(rivals) - means[0]) / (min(rivals) - means[3]))


SHARES = np.linspace(0.2, 0.9, len(BENDING_LENGTHS))
TABLE = [[[c + 0.01 * k, 8.0 - k, 0.006 + 0.001 * k] for k in range(len(RATIOS))] for c in SHARES]
"""Lays of every ratio: the larger it is, the fewer and the deeper the folds."""
SCATTER = np.array([0.04, 0.2, 3e-4])


def fabric_of(ratio, off_axis=0.0):
    """Fitted lays of two sides like the simulated one of a ratio."""
    folds, depth = 8.0 - ratio, np.hypot(0.006 + 0.001 * ratio, off_axis)
    return Lays(1, np.array([[0.55, folds, depth], [0.45, folds, depth]]), np.empty((0, 3)), off_axis)


def test_an_ensemble_has_the_coefficients_of_both_sides_and_the_scatter_of_lays():
    fit = fitted(TABLE, fabric_of(2), SCATTER)
    assert fit.ensemble.shape == (MEMBERS, 3)
    assert fit.ensemble[:, 0].mean() == pytest.approx(0.5, abs=1e-3)
    assert fit.ensemble[::2, 0].mean() - fit.ensemble[1::2, 0].mean() == pytest.approx(0.1, abs=0.01)
    assert fit.ensemble[::2, 0].std() == pytest.approx(0.02, rel=0.15)
    assert BENDING_LENGTHS[0] < fit.length < BENDING_LENGTHS[-1]


@pytest.mark.parametrize("k", range(len(RATIOS)))
def test_number_and_depth_of_the_fitted_folds_tell_the_ratio_unless_all_count_alike(k):
    fit, alike = (fitted(TABLE, fabric_of(k), SCATTER, weigh=weigh) for weigh in (True, False))
    assert fit.ratio == pytest.approx(RATIOS[k], rel=0.01)
    assert fit.ensemble[:, 1].mean() == pytest.approx(8.0 - k)
    assert alike.ratio == pytest.approx(np.exp(np.mean(np.log(RATIOS))))
    assert alike.ensemble[:, 1].mean() == pytest.approx(6.0, abs=0.15)


def test_outlines_lie_as_far_off_the_axis_as_the_fitted_ones():
    own = fabric_of(1, 3e-3)
    off, on = (fitted(TABLE, own, SCATTER, centred=centred).ensemble for centred in (False, True))
    assert off[:, 2] == pytest.approx(np.hypot(0.007, 3e-3))
    assert (on[:, 2] < off[:, 2]).all()


def test_a_coefficient_beyond_the_table_has_its_end():
    below, above = (Lays(1, np.array([[c, 7.0, 7e-3]]), np.empty((0, 3))) for c in (0.05, 0.99))
    assert fitted(TABLE, below, SCATTER).length == BENDING_LENGTHS[0]
    assert fitted(TABLE, above, SCATTER).length == BENDING_LENGTHS[-1]


def test_a_sheet_has_the_bending_length_and_the_ratio_that_were_asked_for_and_softens():
    keys = sheet(0.02, 1.72)
    mean = (keys["bending_warp"] * keys["bending_weft"]) ** 0.5
    assert mean == pytest.approx(keys["density"] * 9.81 * 0.02**3)
    assert keys["bending_warp"] / keys["bending_weft"] == pytest.approx(1.72)
    assert keys["bending_slope_bias"] == pytest.approx(-SOFTENING * keys["bending_bias"])


def test_with_all_three_means_right_nothing_is_lost_but_spread():
    lays, _ = fabrics(8)
    rows = {row[0]: float(row[1]) for row in causes.rows(TABLE, lays)}
    assert rows["mean corrected: all three"] < min(v for k, v in rows.items() if k != "mean corrected: all three")


def test_the_scatter_of_centres_is_that_of_the_other_fabrics():
    off = np.array([0.03, 0.6, 1e-3])
    lays = [Lays(k, np.tile(k * off, (2, 1)), np.zeros((4, 3))) for k in range(3)]
    found = scatter_of_centres(lays)
    assert [each / off for each in found] == [pytest.approx(np.full(3, (m / 2) ** 0.5)) for m in (5, 4, 1)]


THETA = 2 * np.pi * np.arange(360) / 360


def test_observations_of_one_lay_count_once_and_no_copies():
    series = [[1, 2, 4, capture] for capture in (1, 2, 3)] + [[1, 2, 5, 1]]
    labels = np.array([*series, [1, 1, 4, 1], [1, 1, 4, 2], [2, 2, 4, 1], [2, 2, 4, 2], *DROPPED])
    assert single_lays(labels).tolist() == [False, False, True, True] + [True] * 4 + [False] * len(DROPPED)


def test_the_fit_sees_both_sides_of_the_first_specimen_of_the_first_session():
    labels = np.array([[1, 2, 1, 1], [1, 1, 3, 3], [1, 1, 2, 1], [1, 1, 2, 2], [1, 1, 2, 3], [1, 2, 2, 1]])
    radii = 0.12 + 1e-3 * np.arange(6)[:, None] + 0.01 * np.cos(7 * THETA)
    (own,) = measured_lays(labels, radii)
    sizes = (radii**2).mean(axis=1)
    order = [np.argsort(sizes)[k] for k in (2, 4)]
    assert own.fitted[:, 0] == pytest.approx((sizes[order] - 0.09**2) / (0.15**2 - 0.09**2))
    assert len(own.others) == 4


def outlines_of_specimens(n, sign):
    """Two lays of each side of n specimens of one fabric: turned over, an outline is mirrored, its sign is `sign`."""
    rng = np.random.default_rng(3)
    labels, radii = [], []
    for k in range(n):
        waves = sum(rng.standard_normal() * np.cos(m * THETA + rng.uniform(0, 6)) for m in range(5, 10))
        other = sign * np.roll(waves[::-1], 1)
        for capture in (1, 2, 3, 4):
            labels.append([7, 1, k, capture])
            radii.append(0.12 + 0.002 * (waves if capture < 3 else other) + 1e-5 * rng.standard_normal())
    return np.array(labels), np.array(radii)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_specimen_turned_over_is_known_by_its_mirrored_outline_of_the_other_sign(sign):
    (row,) = specimens.rows(*outlines_of_specimens(6, sign))
    assert row[:2] == ["7", "1.00"]
    assert float(row[3].split()[0]) == pytest.approx(-sign)
    assert abs(float(row[2])) < 0.5
    assert abs(float(row[4])) < 0.5


def test_the_fold_slope_is_that_within_groups():
    n = np.array([6.0, 7, 8, 9])
    groups = [np.column_stack([start + 0.013 * n, n]) for start in (0.2, 0.9)]
    assert specimens.slope(groups) == pytest.approx((1.3, 0), abs=1e-9)


def test_without_data_it_says_so(tmp_path, capsys):
    assert main(["--data", str(tmp_path)]) == 0
    assert "cusick_borders.npz" in capsys.readouterr().out


@pytest.mark.parametrize("wide", [0.2, 0.06])
def test_a_specimen_of_pulls_alike_has_their_force_and_their_width_between_its_clamps(wide):
    rng = np.random.default_rng(2)
    strains = np.tile(np.linspace(0, 0.4, 60), (5, 1))
    level = 1 + 0.02 * rng.standard_normal((5, 1))
    forces = 20 * strains * (0.3 + strains) * level
    pulls = Pulls("knit_x", wide, 0.1, strains, forces, 1 - 0.3 * strains)
    (found,) = compared([pulls])
    expected = 20 * found.strains * (0.3 + found.strains) * level[:3].mean()
    assert found.simulated == pytest.approx(expected, rel=0.02, abs=0.02)
    assert found.measured_width == pytest.approx(1 - 0.3 * 0.38)
    assert found.width == pytest.approx(found.measured_width, abs=0.005)
    assert found.within >= 3


def test_the_stored_ensembles_are_those_of_the_lengths_and_stiffer_cloth_covers_more():
    stored = json.loads(RECORD.read_text(encoding="utf-8"))
    assert tuple(stored["lengths_mm"]) == BENDING_LENGTHS
    assert tuple(stored["ratios"]) == RATIOS
    values = np.array(stored["lays"])
    assert values.shape[0] == len(BENDING_LENGTHS)
    assert (np.diff(values[:, :, 0].mean(axis=1)) > 0).all()
