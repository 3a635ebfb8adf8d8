"""Fields of the cloth in a trajectory, read back by us and by VTK."""

import numpy as np
import pytest
from written_frames import TIMES, WORLD, frame

from clothsim.base.errors import InputError
from clothsim.files.runs.trajectory import TrajectoryWriter, read_trajectory
from clothsim.files.runs.vtkhdf import FrameArray
from clothsim.mesh.world import world_surfaces


@pytest.fixture
def path(tmp_path):
    return tmp_path / "trajectory.vtkhdf"


FIELDS = [FrameArray("stress", "triangle", (3, 2)), FrameArray("pressure", "vertex")]


def values(i):
    """Fields of frame i: random bits."""
    rng = np.random.default_rng(100 + i)
    stress = rng.random((len(WORLD.triangles), 3, 2)).astype(np.float32)
    return {"stress": stress, "pressure": rng.random(WORLD.n_cloth).astype(np.float32)}


def write_fields(path, frames, **keywords):
    with TrajectoryWriter(path, world_surfaces(WORLD), fields=FIELDS, **keywords) as writer:
        for i in frames:
            writer.append(TIMES[i], *frame(i), values(i))


def test_fields_are_read_as_they_were_written_and_continued_by_a_resumed_run(path):
    write_fields(path, range(3))
    write_fields(path, range(1, 4), resume_at=1)
    run = read_trajectory(path)
    assert run.times.tolist() == TIMES
    assert np.array_equal(run.positions(3), frame(3)[0][: WORLD.n_cloth])
    assert sorted(run.fields) == ["pressure", "principal_stretches", "stress"]
    for i in range(4):
        for name, expected in values(i).items():
            assert np.array_equal(run.field(name, i), expected)


def test_vtk_shows_the_fields_of_every_frame(path):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    write_fields(path, range(4))
    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    for i in (3, 0, 2, 1):
        reader.UpdateTimeStep(TIMES[i])
        output = reader.GetOutputDataObject(0)
        cloths = [output.GetBlock(0), output.GetBlock(1)]
        stress = [vtk_to_numpy(block.GetCellData().GetArray("stress")) for block in cloths]
        pressure = [vtk_to_numpy(block.GetPointData().GetArray("pressure")) for block in cloths]
        assert np.array_equal(np.concatenate(stress).reshape(-1, 3, 2), values(i)["stress"])
        assert np.array_equal(np.concatenate(pressure), values(i)["pressure"])


@pytest.mark.parametrize("fields", [[], FIELDS[:1], [FIELDS[0], FrameArray("pressure", "vertex", (2,))]])
def test_a_run_is_not_resumed_with_other_fields(path, fields):
    write_fields(path, range(2))
    with pytest.raises(InputError, match="fields"):
        TrajectoryWriter(path, world_surfaces(WORLD), resume_at=1, fields=fields)


@pytest.mark.parametrize(
    "given",
    [{}, {"stress": values(0)["stress"]}, values(0) | {"more": [1.0]}, values(0) | {"pressure": np.zeros((3, 1))}],
)
def test_a_frame_needs_each_field_in_its_shape(path, given):
    with (
        TrajectoryWriter(path, world_surfaces(WORLD), fields=FIELDS) as writer,
        pytest.raises(InputError, match="pressure"),
    ):
        writer.append(TIMES[0], *frame(0), given)
