"""Energy of changes of the contact stiffness: a stiff card that rattles within d_hat, with small steps."""

from dataclasses import replace

import numpy as np
import pytest

import clothsim
from tests.hard_cases.rubbing import on_wall


def rattling():
    """B12e for .3 s, with steps of .003 s."""
    scene = on_wall(True, 0.5)
    return replace(
        scene, solver={**scene.solver, "dt": 0.003, "threads": 1}, run={"duration": 0.3, "frames_per_second": 50}
    )


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return clothsim.simulate(rattling(), tmp_path_factory.mktemp("whole"))


def test_the_record_balances_the_energy(run):
    """E(n+1) - E(n) less what the change of the stiffness added is the change in the step, which damps."""
    record = run.record()
    energy, changes = (np.array([entry[key] for entry in record]) for key in ("energy", "stiffness_energy"))
    in_step = np.diff(energy) - changes[1:]
    assert in_step.max() < 1e-9 * np.abs(energy).max()
    assert changes.max() > 1e-3 * np.abs(energy).max()
    certificate = run.summary["certificate"]["stiffness_changes"]
    assert certificate["added"] == pytest.approx(changes[changes > 0].sum(), rel=1e-12)
    assert certificate["removed"] == pytest.approx(-changes[changes < 0].sum(), rel=1e-12)


def test_a_stiff_card_comes_to_rest_with_small_steps(run):
    """With a stiffness that follows the loads at once 40 times the energy was added, and it was ten times as fast."""
    record = run.record()
    assert run.summary["certificate"]["stiffness_changes"]["added"] < 2e-5
    assert max(entry["fastest"] for entry in record[-20:]) < 0.02


def test_a_resumed_run_has_the_same_bits(run, tmp_path):
    """The stiffness of a step depends on that of the step before."""

    def stop(progress):
        if progress.time > 0.1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        clothsim.simulate(rattling(), tmp_path, progress=stop)
    resumed = clothsim.resume(tmp_path)
    assert np.array_equal(resumed.positions(-1), run.positions(-1))
    assert resumed.summary["certificate"] == run.summary["certificate"]
    keys = ("energy", "stiffness_energy")
    assert [[e[k] for k in keys] for e in resumed.record()] == [[e[k] for k in keys] for e in run.record()]
