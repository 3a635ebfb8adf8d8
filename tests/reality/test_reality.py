"""The score of the reality page: closed forms, limits of the skill, and a folder without data."""

import json

import numpy as np
import pytest

from tests.reality.__main__ import RECORD, main
from tests.reality.borders import Lays
from tests.reality.ensembles import BENDING_LENGTHS, of_coefficient
from tests.reality.knits import Pulls, compared, table_of
from tests.reality.score import energy_score, scored


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


def test_an_ensemble_has_the_coefficient_that_was_asked_for():
    shares = np.linspace(0.2, 0.9, len(BENDING_LENGTHS))
    table = [[[c - 0.01, 7.0, 0.01], [c + 0.01, 8.0, 0.01]] for c in shares]
    length, ensemble = of_coefficient(table, 0.5)
    assert ensemble[:, 0].mean() == pytest.approx(0.5)
    assert BENDING_LENGTHS[0] < length < BENDING_LENGTHS[-1]
    assert of_coefficient(table, 0.1)[0] == BENDING_LENGTHS[0]


def test_without_data_it_says_so(tmp_path, capsys):
    assert main(["--data", str(tmp_path)]) == 0
    assert "cusick_borders.npz" in capsys.readouterr().out


def test_a_specimen_of_pulls_alike_has_their_force_between_its_clamps():
    rng = np.random.default_rng(2)
    strains = np.tile(np.linspace(0, 0.4, 60), (5, 1))
    forces = 20 * strains**2 * (1 + 0.02 * rng.standard_normal((5, 1)))
    pulls = Pulls("knit_x", 0.06, 0.1, strains, forces, 1 - 0.5 * strains)
    found = compared(pulls, table_of(pulls))
    assert found.simulated == pytest.approx(
        forces[:3].mean(axis=0)[-1] * (found.strains / 0.4) ** 2, rel=0.02, abs=0.02
    )
    assert found.measured_width == pytest.approx(0.81)
    assert found.width == pytest.approx(1.0, abs=0.01)
    assert found.within >= 3


def test_the_stored_ensembles_are_those_of_the_lengths_and_stiffer_cloth_covers_more():
    stored = json.loads(RECORD.read_text(encoding="utf-8"))
    assert tuple(stored["lengths_mm"]) == BENDING_LENGTHS
    values = np.array(stored["lays"])
    assert values.shape[0] == len(BENDING_LENGTHS)
    assert (np.diff(values[:, :, 0].mean(axis=1)) > 0).all()
