"""Runs whose files grow beyond a limit: one sentence, whole files, and the same bits after resuming."""

import errno
import os
import sys
from pathlib import Path
from subprocess import run as run_process

import h5py
import numpy as np
import pytest
from small_scenes import RUN, SHEET, small_scene

from clothsim import InputError, open_run, resume, simulate
from clothsim.base import file_writing as disk_space
from clothsim.base.record import RecordWriter
from clothsim.files.runs import trajectory
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.files.runs.trajectory import TRAJECTORY_NAME

resource = pytest.importorskip("resource", reason="limits the size of files")

ROOT = Path(__file__).parents[2]
SCENE = {
    "cloth": SHEET | {"cells": [16, 16]},
    "body": (),
    "effects": {"inertia": {}, "gravity": {}, "membrane": {}, "pins": {"select": "left"}},
    "run": {**RUN, "duration": 0.2, "frames_per_second": 50},
}
LIMITED = """
import resource, sys
from small_scenes import small_scene
from clothsim import InputError, simulate
sys.path.insert(0, "tests/run")
from test_full_disk import SCENE
scene = small_scene(**SCENE)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    simulate(scene, sys.argv[1])
except InputError as error:
    print(error.sentence + "|" + error.remedy)
"""


def frames(run):
    return np.array([run.positions(k) for k in range(len(run.times))])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return simulate(small_scene(**SCENE), tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize("limit", [40_000, 120_000, 140_000])
def test_a_run_at_the_limit_on_the_size_of_files_goes_on_from_whole_files(tmp_path, whole, limit):
    """The first limit leaves the trajectory no room at all, the others a few frames."""
    home = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests" / "support")])}
    command = [sys.executable, "-c", LIMITED, str(tmp_path), str(limit)]
    done = run_process(command, cwd=ROOT, env=home, capture_output=True, text=True, check=True, timeout=120)
    assert done.stderr == ""
    sentence, remedy = done.stdout.strip().split("|")
    assert TRAJECTORY_NAME in sentence
    assert os.strerror(errno.EFBIG) in sentence
    assert f"clothsim resume {tmp_path}" in remedy
    saved = read_checkpoint(tmp_path / CHECKPOINT_NAME)
    if limit > 100_000:
        assert len(open_run(tmp_path).times) == saved.state.frame + 1 > 1
    resumed = resume(tmp_path)
    assert resumed.status == "completed"
    assert np.array_equal(frames(resumed), frames(whole))


def test_the_space_reserved_for_a_frame_is_enough(tmp_path, monkeypatch):
    """Noise, which gzip cannot compress, over two growths of the tables."""
    sizes = []

    def reserved(path, size):
        sizes.append((path.stat().st_size, size))

    monkeypatch.setattr(trajectory, "require_space", reserved)
    surface = trajectory.SurfaceRows("cloth", "cloth", slice(0, 500), np.arange(498)[:, None] + [0, 1, 2], True)
    noise = np.random.default_rng(0)
    with trajectory.TrajectoryWriter(tmp_path / "a", [surface]) as writer:
        for frame in range(520):
            writer.append(float(frame), noise.random((500, 3)), noise.random((498, 2)))
    (layout, *_), frames_of = sizes[0], sizes[1:]
    ends = [size for size, _ in frames_of][1:]
    grown = [end - start for end, (start, _) in zip(ends, frames_of, strict=False)]
    assert len(grown) == 519
    assert max(grown) <= min(size for _, size in frames_of)
    assert frames_of[0][0] <= sizes[0][1] + layout


def test_an_error_of_h5py_is_a_sentence(tmp_path, monkeypatch):
    def failing(*_):
        raise RuntimeError("Can't decrement id ref count (unable to extend file properly)")

    monkeypatch.setattr(trajectory, "write_frame", failing)
    with pytest.raises(InputError, match=TRAJECTORY_NAME):
        simulate(small_scene(**SCENE), tmp_path)
    monkeypatch.undo()
    assert resume(tmp_path).status == "completed"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="writes to /dev/full")
def test_a_line_of_the_record_on_a_full_disk_is_a_sentence(tmp_path):
    with RecordWriter(tmp_path / "record") as record:
        record.append({"step": 1})
        record.close()
        record._file = open("/dev/full", "wb", buffering=0)  # noqa: SIM115
        with pytest.raises(InputError, match=r"record.*No space"):
            record.append({"step": 2})


def test_a_file_keeps_its_length_and_a_system_that_cannot_reserve_is_no_error(tmp_path, monkeypatch):
    file = tmp_path / "file"
    with h5py.File(file, "w") as handle:
        handle["x"] = np.arange(10)
    before = file.read_bytes()
    disk_space.require_space(file, 1 << 20)
    assert file.read_bytes() == before
    monkeypatch.setattr(os, "posix_fallocate", None, raising=False)
    monkeypatch.delattr(os, "posix_fallocate")
    disk_space.require_space(file, 3 << 20)
    assert file.read_bytes() == before

    def unable(*_):
        raise OSError(errno.EOPNOTSUPP, "not supported")

    monkeypatch.setattr(os, "posix_fallocate", unable, raising=False)
    disk_space.require_space(file, 1 << 20)
    assert file.read_bytes() == before
