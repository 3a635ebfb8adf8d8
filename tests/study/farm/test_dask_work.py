"""Work by real workers of Dask: killed ones are started again, a lost scheduler is one sentence."""

import json
import logging
import platform
import subprocess
import sys

import pytest
from small_scenes import small_scene

from clothsim.cli import main
from clothsim.study.farm import dask_work
from clothsim.study.farm.dask_work import LostWorkersError, OwnWorkers, work_with_dask
from clothsim.study.farm.plan import plan
from clothsim.study.farm.publication import attempts, note_attempt
from clothsim.study.farm.recipe import make_recipe
from clothsim.study.farm.status import status

distributed = pytest.importorskip("distributed", reason="workers of Dask: pip install 'clothsim[farm]'")


@pytest.fixture
def farm(tmp_path):
    scene = small_scene(run={"duration": 0.04, "frames_per_second": 25})
    vary = {"cloth.density": {"uniform": [0.1, 0.3]}}
    return plan(make_recipe(scene, {"count": 3, "until": "time"}, {}, vary), tmp_path)


def test_workers_that_are_killed_as_they_start_are_started_again(farm, monkeypatch):
    start, started = OwnWorkers._started, []

    def killed_at_first(own):
        process = start(own)
        started.append(process)
        if len(started) < 3:
            process.kill()
        return process

    monkeypatch.setattr(OwnWorkers, "_started", killed_at_first)
    work_with_dask(farm, None, 1)
    assert (status(farm).usable, len(started)) == (3, 3)
    assert all(process.poll() is not None for process in started)


def test_workers_that_never_live_end_the_work(farm, monkeypatch):
    start = OwnWorkers._started

    def killed(own):
        process = start(own)
        process.kill()
        process.wait()
        return process

    monkeypatch.setattr(OwnWorkers, "_started", killed)
    monkeypatch.setattr(dask_work, "FRUITLESS", 2)
    with pytest.raises(LostWorkersError, match="-9"):
        work_with_dask(farm, None, 2)


def test_nothing_listens_beyond_this_machine(farm):
    """Its dashboard was served on 0.0.0.0:8787."""
    psutil = pytest.importorskip("psutil")
    with dask_work._own_workers(farm, 1) as own, distributed.Client(own.address) as client:
        client.wait_for_workers(1, timeout=60)
        processes = [psutil.Process(), *(psutil.Process(each.pid) for each in own.processes)]
        listening = [each.laddr for one in processes for each in one.net_connections("tcp") if each.status == "LISTEN"]
    assert len(listening) >= 2
    assert {address.ip for address in listening} == {"127.0.0.1"}


def test_a_scheduler_that_is_lost_is_exit_code_1_and_one_sentence(farm, monkeypatch, capsys):
    cluster = distributed.LocalCluster(n_workers=0, processes=True, dashboard_address=None, host="127.0.0.1")

    def lost(*given):
        cluster.close()
        logging.getLogger("distributed.client").error("a traceback")

    monkeypatch.setattr(dask_work, "_greet", lost)
    monkeypatch.setattr(dask_work, "PATIENCE", 0.1)
    words = ["farm", "work", str(farm.directory), "--scheduler", cluster.scheduler_address, "--quiet"]
    assert main(words) == 1
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert "3 of 3 drapes are left" in said[0]


def test_an_attempt_that_is_stopped_with_its_worker_is_no_attempt(farm, tmp_path):
    job = farm.jobs[0]

    def claimed_by(pid):
        claim = {"token": "t", "host": platform.node(), "pid": pid}
        (farm.directory / "claims" / job.id).write_text(json.dumps(claim))
        note_attempt(farm.directory, job.id, "started")

    for foreign in (False, True):
        own = OwnWorkers("", str(tmp_path), 1, farm)
        process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
        own.processes.append(process)
        claimed_by(1 if foreign else process.pid)
        own.end()
        assert process.poll() is not None
        assert attempts(farm.directory, job.id) == foreign
        assert (farm.directory / "claims" / job.id).exists() is foreign
