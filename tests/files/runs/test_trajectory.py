import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from written_frames import TIMES, WORLD, frame, write

from clothsim.base.errors import InputError
from clothsim.files.runs.trajectory import TrajectoryWriter, read_trajectory
from clothsim.mesh.world import SurfaceRows, make_world, world_surfaces

HERE = Path(__file__).parent
SUPPORT = HERE.parents[1] / "support"


def assert_holds(path, count):
    run = read_trajectory(path)
    assert run.times.tolist() == TIMES[:count]
    for i in range(count):
        x, stretches = frame(i)
        assert np.array_equal(run.positions(i), x[: WORLD.n_cloth])
        assert np.array_equal(run.stretches(i), stretches.astype(np.float32))
        for (name, points, triangles), body, rows in zip(run.bodies(i), WORLD.bodies, WORLD.body_slices, strict=True):
            assert name == body.name
            assert np.array_equal(points, x[rows])
            assert np.array_equal(triangles, body.triangles)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "trajectory.vtkhdf"


def test_what_is_read_is_what_was_written_to_the_last_bit(path):
    write(path)
    assert_holds(path, len(TIMES))
    run = read_trajectory(path)
    assert run.cloth_names == ("skirt", "top/left")
    assert np.array_equal(run.triangles, WORLD.triangles)
    assert run.positions(0).dtype == np.float64
    assert run.stretches(0).dtype == np.float32
    assert np.array_equal(run.positions(-1), run.positions(len(TIMES) - 1))


@pytest.mark.parametrize("number", [4, -5])
def test_a_frame_that_is_not_there_is_refused(path, number):
    write(path)
    run = read_trajectory(path)
    for read in (run.positions, run.bodies, run.stretches):
        with pytest.raises(InputError, match=rf"{number}\b"):
            read(number)


def test_a_still_body_is_stored_once(path):
    write(path)
    with h5py.File(path) as file:
        floor, kick = file["VTKHDF/surface2/Points"], file["VTKHDF/surface3/Points"]
        assert len(floor) == len(WORLD.bodies[0].positions)
        assert len(kick) == len(TIMES) * len(WORLD.bodies[1].positions)


def blocks_of(output):
    """Name, points, triangles and stretches of each block of a vtkMultiBlockDataSet."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet

    for k in range(output.GetNumberOfBlocks()):
        block = output.GetBlock(k)
        stretches = block.GetCellData().GetArray("principal_stretches")
        yield (
            output.GetMetaData(k).Get(vtkCompositeDataSet.NAME()),
            vtk_to_numpy(block.GetPoints().GetData()),
            vtk_to_numpy(block.GetPolys().GetConnectivityArray()).reshape(-1, 3),
            None if stretches is None else vtk_to_numpy(stretches),
        )


def assert_shows(output, i):
    x, stretches = frame(i)
    parts = list(blocks_of(output))
    assert [part[0] for part in parts] == ["skirt", "top_left", "floor", "kick"]
    things = [*zip(WORLD.cloths, WORLD.cloth_slices, strict=True), *zip(WORLD.bodies, WORLD.body_slices, strict=True)]
    for (_, points, triangles, _), (thing, rows) in zip(parts, things, strict=True):
        assert points.dtype == np.float64
        assert np.array_equal(points, x[rows])
        assert np.array_equal(triangles, thing.triangles)
    assert np.array_equal(np.concatenate([parts[0][3], parts[1][3]]), stretches.astype(np.float32))


# Forwards, backwards and the same one twice: VTK caches geometry between time steps.
ORDER = [0, 3, 1, 2, 2, 0]


@pytest.mark.parametrize("through_a_filter", [False, True], ids=["reader", "pipeline"])
def test_vtk_shows_every_frame(path, through_a_filter):
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkFiltersCore import vtkPassThrough
    from vtkmodules.vtkIOHDF import vtkHDFReader

    write(path)
    reader = vtkHDFReader()
    assert reader.CanReadFile(str(path))
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    key = vtkStreamingDemandDrivenPipeline.TIME_STEPS()
    information = reader.GetOutputInformation(0)
    assert [information.Get(key, i) for i in range(information.Length(key))] == TIMES
    end = reader
    if through_a_filter:
        end = vtkPassThrough()
        end.SetInputConnection(reader.GetOutputPort())
    for i in ORDER:
        end.UpdateTimeStep(TIMES[i])
        assert_shows(end.GetOutputDataObject(0), i)


def test_pyvista_shows_every_frame(path):
    import pyvista

    write(path)
    assert_shows(pyvista.read(path), 0)
    reader = pyvista.get_reader(path)
    for i in ORDER:
        reader.reader.SetStep(i)
        shown = reader.read()
        assert shown.keys() == ["skirt", "top_left", "floor", "kick"]
        assert_shows(shown, i)


def test_vtk_shows_a_single_frame_and_one_behind_the_first_pages_of_the_tables(path, monkeypatch):
    from vtkmodules.vtkIOHDF import vtkHDFReader

    monkeypatch.setattr("clothsim.files.runs.vtkhdf._TABLE_ROWS", 4)
    x, stretches = frame(0)
    with TrajectoryWriter(path, world_surfaces(WORLD)) as writer:
        for i in range(10):
            moved = x + i * np.array([1.0, 0.0, 0.0])
            moved[WORLD.body_slices[0]] = x[WORLD.body_slices[0]]
            writer.append(float(i), moved, stretches + i)
            if i not in (0, 9):
                continue
            reader = vtkHDFReader()
            reader.SetFileName(str(path))
            reader.UpdateTimeStep(float(i))
            parts = list(blocks_of(reader.GetOutputDataObject(0)))
            assert np.array_equal(parts[0][1], moved[WORLD.cloth_slices[0]])
            assert np.array_equal(parts[1][3], (stretches + i).astype(np.float32)[-len(parts[1][3]) :])
            assert np.array_equal(parts[2][1], x[WORLD.body_slices[0]])
            assert np.array_equal(parts[3][1], moved[WORLD.body_slices[1]])


def test_a_run_can_be_read_while_it_goes_on(path):
    with TrajectoryWriter(path, world_surfaces(WORLD)) as writer:
        assert len(read_trajectory(path).times) == 0
        for i in range(len(TIMES)):
            writer.append(TIMES[i], *frame(i))
            assert_holds(path, i + 1)


@pytest.mark.parametrize("kept", [0, 1, 3, 4])
def test_a_resumed_run_goes_on_behind_the_frames_it_keeps(path, kept):
    write(path)
    with TrajectoryWriter(path, world_surfaces(WORLD), resume_at=kept) as writer:
        assert writer.n_frames == kept
        assert_holds(path, kept)
        for i in range(kept, len(TIMES)):
            writer.append(TIMES[i], *frame(i))
    assert_holds(path, len(TIMES))


def test_a_new_run_takes_nothing_over_from_the_old_file(path):
    write(path)
    write(path, range(2))
    assert_holds(path, 2)


def test_a_frame_cut_short_is_not_there_and_does_not_hinder_the_next(path):
    write(path, range(2))
    whole = frame(2)[0]
    with h5py.File(path, "r+") as file:
        # What is in the file when a run dies after the points and before the number of frames.
        points = file["VTKHDF/surface0/Points"]
        n = len(points) // 2
        points.resize(3 * n, axis=0)
        points[2 * n :] = whole[:n]
    assert_holds(path, 2)
    write(path, range(2, 4), resume_at=2)
    assert_holds(path, 4)


KILLED = """
import sys
from itertools import count
import numpy as np
sys.path[:0] = sys.argv[2:]
from test_trajectory import WORLD, TrajectoryWriter, frame, world_surfaces
with TrajectoryWriter(sys.argv[1], world_surfaces(WORLD)) as writer:
    for i in count():
        writer.append(float(i), *frame(i % 7))
        print(i, flush=True)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system cannot kill a process on the spot")
def test_a_killed_run_leaves_every_frame_it_has_written(path):
    arguments = [sys.executable, "-c", KILLED, str(path), str(HERE), str(SUPPORT)]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as run:
        seen = [int(run.stdout.readline()) for _ in range(20)]
        os.kill(run.pid, signal.SIGKILL)
        seen += [int(line) for line in run.stdout.read().split()]
    trajectory = read_trajectory(path)
    assert len(trajectory.times) > seen[-1] >= 19
    for i in range(len(trajectory.times)):
        x, stretches = frame(i % 7)
        assert trajectory.times[i] == i
        assert np.array_equal(trajectory.positions(i), x[: WORLD.n_cloth])
        assert np.array_equal(trajectory.stretches(i), stretches.astype(np.float32))


def test_a_run_without_stretches(path):
    with TrajectoryWriter(path, world_surfaces(WORLD), stretches=False) as writer:
        writer.append(0.0, frame(0)[0])
        with pytest.raises(InputError, match="principal_stretches"):
            writer.append(1.0, *frame(1))
    run = read_trajectory(path)
    assert np.array_equal(run.positions(0), frame(0)[0][: WORLD.n_cloth])
    with pytest.raises(InputError, match="principal_stretches"):
        run.stretches(0)


def with_nan():
    x, stretches = frame(1)
    x[3, 1] = np.nan
    return x, stretches


@pytest.mark.parametrize(
    ("time", "values", "message"),
    [
        (1.0, with_nan(), r"positions\[3, 1\]"),
        (1.0, (frame(1)[0][:-1], frame(1)[1]), "rows"),
        (1.0, (frame(1)[0], frame(1)[1][1:]), r"shape \(\d+, 2\)"),
        (1.0, (frame(1)[0],), "with principal_stretches"),
        (0.0, frame(1), "not later"),
        (float("nan"), frame(1), "not later"),
    ],
)
def test_a_bad_frame_is_refused_and_leaves_the_file_as_it_was(path, time, values, message):
    with TrajectoryWriter(path, world_surfaces(WORLD)) as writer:
        writer.append(TIMES[0], *frame(0))
        with pytest.raises(InputError, match=message):
            writer.append(time, *values)
        writer.append(TIMES[1], *frame(1))
    assert_holds(path, 2)


def surface(name, role, start, stop):
    return SurfaceRows(name, role, slice(start, stop), np.array([[0, 1, 2]]) + start, True)


@pytest.mark.parametrize(
    ("surfaces", "message"),
    [
        ([surface("ball", "body", 0, 3)], "at least one cloth"),
        ([surface("ball", "body", 0, 3), surface("c", "cloth", 3, 6)], "before"),
        ([surface("c", "cloth", 0, 3), surface("ball", "body", 4, 7)], "ball has rows 4..7"),
    ],
)
def test_surfaces_that_do_not_follow_one_another_are_refused(path, surfaces, message):
    with pytest.raises(InputError, match=message):
        TrajectoryWriter(path, surfaces)
    assert not path.exists()


def test_names_that_clash_in_a_path_stay_apart(path):
    with TrajectoryWriter(
        path, [surface("a/b", "cloth", 0, 3), surface("a_b", "cloth", 3, 6)], stretches=False
    ) as writer:
        writer.append(0.0, np.arange(18.0).reshape(6, 3))
    assert read_trajectory(path).cloth_names == ("a/b", "a_b")
    assert read_trajectory(path).positions(0).tolist() == np.arange(18.0).reshape(6, 3).tolist()


def test_a_run_of_other_surfaces_does_not_go_on_in_this_file(path):
    write(path)
    others = world_surfaces(make_world(WORLD.cloths[:1], WORLD.bodies))
    with pytest.raises(InputError, match=re.escape(str(path))):
        TrajectoryWriter(path, others, resume_at=1)
    with pytest.raises(InputError, match=re.escape(str(path))):
        TrajectoryWriter(path, world_surfaces(WORLD), resume_at=1, stretches=False)
    with pytest.raises(InputError, match=r"\b4\b"):
        TrajectoryWriter(path, world_surfaces(WORLD), resume_at=5)
    assert_holds(path, len(TIMES))


def test_missing_broken_and_foreign_files_are_reported(path, tmp_path):
    with pytest.raises(InputError, match=re.escape(str(path))):
        read_trajectory(path)
    with pytest.raises(InputError, match="nowhere"):
        TrajectoryWriter(tmp_path / "nowhere" / "t.vtkhdf", world_surfaces(WORLD))
    path.write_text("not HDF5")
    with pytest.raises(InputError, match=re.escape(str(path))):
        read_trajectory(path)
    with h5py.File(path, "w") as file:
        file["something"] = [1, 2, 3]
    with pytest.raises(InputError, match=re.escape(str(path))):
        read_trajectory(path)


@pytest.mark.parametrize("part", [0.02, 0.3, 0.6])
def test_a_file_that_lost_its_end_is_refused(path, part):
    write(path)
    content = path.read_bytes()
    path.write_bytes(content[: int(part * len(content))])
    with pytest.raises(InputError, match=re.escape(str(path))):
        read_trajectory(path).positions(-1)


def test_ghost_rows_are_not_written(path):
    x, stretches = frame(0)
    with TrajectoryWriter(path, world_surfaces(WORLD)) as writer:
        writer.append(TIMES[0], np.concatenate([x, np.ones((5, 3))]), stretches)
    assert_holds(path, 1)


@pytest.mark.parametrize("frame", ["last.png", 1.5, None])
def test_a_frame_is_a_whole_number(path, frame):
    write(path)
    with pytest.raises(InputError, match=repr(frame)):
        read_trajectory(path).positions(frame)
