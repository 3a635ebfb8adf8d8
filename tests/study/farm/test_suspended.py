"""Workers that were suspended: whatever their successors made or are making stays."""

import json
import os
import time
from contextlib import contextmanager

import pytest
from small_scenes import small_scene

from clothsim.base.errors import MachineError
from clothsim.study.farm.claims import Worker, claimed, owns_claim
from clothsim.study.farm.drape import Drape, failed
from clothsim.study.farm.plan import plan
from clothsim.study.farm.publication import attempts, processor
from clothsim.study.farm.reading import read_drape
from clothsim.study.farm.recipe import make_recipe
from clothsim.study.farm.work import make

SLEEPER, SUCCESSOR = Worker(beat=1000.0), Worker(beat=1000.0)


@pytest.fixture
def farm(tmp_path):
    scene = small_scene(run={"duration": 0.04, "frames_per_second": 25})
    return plan(make_recipe(scene, {"count": 1, "until": "time"}, {}, {}), tmp_path)


def refused(*given):
    return Drape(failed("Its folder is gone.", "refused") | {"processor": processor(), "meshes": {}}, None)


def taken_over(farm):
    """The claim of the sleeper becomes stale; its successor has it, and a folder with what it has made so far."""
    job = farm.jobs[0]
    os.utime(farm.directory / "claims" / job.id, (time.time() - 1000,) * 2)
    claim = claimed(farm.directory / "claims", job.id, SUCCESSOR)
    assert claim.__enter__()
    (farm.directory / "tmp" / f"{job.id}.{SUCCESSOR.token}").mkdir()
    return claim


@pytest.mark.parametrize("wakes", ["with a verdict", "without its folder", "without a disk"])
def test_a_suspended_worker_publishes_nothing_once_its_drape_was_taken_over(farm, monkeypatch, wakes):
    job, claims = farm.jobs[0], []

    def suspended(*given):
        claims.append(taken_over(farm))
        if wakes == "without its folder":
            raise FileNotFoundError("trajectory.vtkhdf")
        if wakes == "without a disk":
            raise MachineError("trajectory.vtkhdf cannot be written.")
        return refused()

    with monkeypatch.context() as patched:
        patched.setattr("clothsim.study.farm.work.drape", suspended)
        assert make(farm, job, SLEEPER) is None
    assert farm.published() == set()
    assert owns_claim(farm.directory / "claims", job.id, SUCCESSOR)
    assert (farm.directory / "tmp" / f"{job.id}.{SUCCESSOR.token}").is_dir()
    assert attempts(farm.directory, job.id) == 0
    claims[0].__exit__(None, None, None)
    assert make(farm, job, SUCCESSOR) is not None
    assert read_drape(farm.directory, job.id)[0]["usable"]


def test_a_drape_that_the_successor_has_published_stays(farm, monkeypatch):
    job = farm.jobs[0]

    def suspended(*given):
        monkeypatch.undo()
        os.utime(farm.directory / "claims" / job.id, (time.time() - 1000,) * 2)
        assert make(farm, job, SUCCESSOR) is not None
        return refused()

    monkeypatch.setattr("clothsim.study.farm.work.drape", suspended)
    assert make(farm, job, SLEEPER) is None
    assert read_drape(farm.directory, job.id)[0]["usable"]


def test_a_worker_that_is_suspended_before_it_cleans_up_removes_no_folder_of_its_successor(farm, monkeypatch):
    job, claims, looks = farm.jobs[0], [], []

    def published(*given):
        looks.append(given)
        if len(looks) == 2:  # the look within the claim
            claims.append(taken_over(farm))
        return False

    monkeypatch.setattr("clothsim.study.farm.work.is_published", published)
    assert make(farm, job, SLEEPER) is None
    assert (farm.directory / "tmp" / f"{job.id}.{SUCCESSOR.token}").is_dir()
    assert json.loads((farm.directory / "claims" / job.id).read_text())["token"] == SUCCESSOR.token
    claims[0].__exit__(None, None, None)


def test_a_worker_that_is_suspended_as_it_claims_begins_nothing(farm, monkeypatch):
    job, successors = farm.jobs[0], []

    @contextmanager
    def taken_at_once(*given):
        with claimed(*given) as own:
            successors.append(taken_over(farm))
            yield own

    monkeypatch.setattr("clothsim.study.farm.work.claimed", taken_at_once)
    monkeypatch.setattr("clothsim.study.farm.work.drape", lambda *given: pytest.fail("a drape was begun"))
    assert make(farm, job, SLEEPER) is None
    assert (farm.directory / "tmp" / f"{job.id}.{SUCCESSOR.token}").is_dir()
    successors[0].__exit__(None, None, None)


def test_a_disk_that_fails_while_the_claim_is_held_stops_the_worker(farm, monkeypatch):
    def full(*given):
        raise MachineError("The disk is full.")

    monkeypatch.setattr("clothsim.study.farm.work.drape", full)
    with pytest.raises(MachineError):
        make(farm, farm.jobs[0], SLEEPER)
    assert attempts(farm.directory, farm.jobs[0].id) == 0
