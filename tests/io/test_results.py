import numpy as np
import pytest
from meshes import cloth, grid

from clothsim.errors import InputError
from clothsim.io.record import RecordWriter, write_summary
from clothsim.io.results import open_run
from clothsim.io.run_surfaces import world_surfaces
from clothsim.io.trajectory import TrajectoryWriter
from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world

WORLD = make_world([cloth(*grid(2, 2), name="sheet")], [make_body("floor", *grid(1, 1))])


@pytest.fixture
def directory(tmp_path):
    """What a run of three frames leaves when it is stopped."""
    with TrajectoryWriter(tmp_path / "trajectory.vtkhdf", world_surfaces(WORLD)) as writer:
        for i in range(3):
            x = WORLD.start()
            x[: WORLD.n_cloth, 2] -= 0.1 * i
            writer.append(0.04 * i, x, np.full((len(WORLD.triangles), 2), 1.0 + i))
    return tmp_path


def test_a_completed_run_gives_its_frames_and_its_summary(directory):
    write_summary(directory / "summary.json", {"status": "completed", "reason": "It is done.", "steps": 12})
    run = open_run(str(directory))
    assert (run.status, run.reason, run.summary["steps"]) == ("completed", "It is done.", 12)
    assert run.directory == directory
    assert run.cloth_names == ("sheet",)
    assert run.times.tolist() == [0.0, 0.04, 0.08]
    assert np.array_equal(run.triangles, WORLD.triangles)
    for i in range(3):
        assert run.positions(i)[:, 2].tolist() == [-0.1 * i] * WORLD.n_cloth
        assert (run.stretches(i) == 1.0 + i).all()
        [(name, points, triangles)] = run.bodies(i)
        assert name == "floor"
        assert np.array_equal(points, WORLD.bodies[0].positions)
        assert np.array_equal(triangles, WORLD.bodies[0].triangles)


def test_a_failed_run_says_why(directory):
    write_summary(directory / "summary.json", {"status": "failed", "reason": "dt fell below its floor."})
    run = open_run(directory)
    assert (run.status, run.reason) == ("failed", "dt fell below its floor.")
    assert len(run.times) == 3


def test_a_run_that_never_came_to_its_end_is_interrupted(directory):
    run = open_run(directory)
    assert run.status == "interrupted"
    assert "stopped" in run.reason
    assert run.summary == {}
    assert len(run.times) == 3


def test_a_run_killed_before_its_first_frame_opens_too(tmp_path):
    TrajectoryWriter(tmp_path / "trajectory.vtkhdf", world_surfaces(WORLD)).close()
    run = open_run(tmp_path)
    assert run.times.shape == (0,)
    assert np.array_equal(run.triangles, WORLD.triangles)
    with pytest.raises(InputError, match="holds 0 frames"):
        run.positions(-1)


def test_the_record_goes_with_the_run(directory):
    run = open_run(directory)
    assert run.record() == []
    with RecordWriter(directory / "record.jsonl") as writer:
        writer.append({"step": 0})
    assert run.record() == [{"step": 0}]


@pytest.mark.parametrize("content", ["", "{", "[]", "{}"])
def test_a_broken_summary_is_refused(directory, content):
    (directory / "summary.json").write_text(content)
    with pytest.raises(InputError, match=r"summary\.json"):
        open_run(directory)


def test_what_is_no_run_directory_says_so(directory, tmp_path):
    with pytest.raises(InputError, match="no run directory"):
        open_run(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no run directory"):
        open_run(directory / "trajectory.vtkhdf")
    (directory / "trajectory.vtkhdf").write_text("broken")
    with pytest.raises(InputError, match="broken or not"):
        open_run(directory)
    (directory / "trajectory.vtkhdf").unlink()
    with pytest.raises(InputError, match=r"holds no trajectory\.vtkhdf"):
        open_run(directory)
