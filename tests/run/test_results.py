from inspect import signature

import numpy as np
import pytest
from meshes import cloth, grid

from clothsim import check, resume
from clothsim.base.errors import InputError
from clothsim.base.record import RecordWriter, write_summary
from clothsim.files.runs.trajectory import TrajectoryWriter
from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world, world_surfaces
from clothsim.render.movie import movie
from clothsim.render.picture import draw
from clothsim.run.pictures import MOVIE_SETTINGS, PICTURE_SETTINGS
from clothsim.run.results import open_run

WORLD = make_world([cloth(*grid(2, 2), name="sheet")], [make_body("floor", *grid(1, 1))])


@pytest.fixture
def directory(tmp_path):
    """Output of a run of three frames that is stopped."""
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


def test_a_failed_run_names_the_reason(directory):
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
    with pytest.raises(InputError, match=r"\b0\b"):
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


def test_what_is_no_run_directory_reports_it(directory, tmp_path):
    with pytest.raises(InputError):
        open_run(tmp_path / "nowhere")
    with pytest.raises(InputError):
        open_run(directory / "trajectory.vtkhdf")
    (directory / "trajectory.vtkhdf").write_text("broken")
    with pytest.raises(InputError, match=r"trajectory\.vtkhdf"):
        open_run(directory)
    (directory / "trajectory.vtkhdf").unlink()
    with pytest.raises(InputError, match=r"trajectory\.vtkhdf"):
        open_run(directory)


# --- a sequence of frames -------------------------------------------------------------------------------------------


def test_a_run_is_a_sequence_of_frames(directory):
    run = open_run(directory)
    assert len(run) == 3
    assert [frame.time for frame in run] == run.times.tolist()
    assert [frame.frame for frame in run[::2]] == [0, 2]
    assert [frame.frame for frame in reversed(run)] == [2, 1, 0]
    assert run[-1].frame == 2
    assert run[5:] == []
    assert set(run[1].positions) == {"sheet"}
    assert np.array_equal(run[1].positions["sheet"], run.positions(1))
    assert np.array_equal(run[1].bodies["floor"], run.bodies(1)[0][1])
    for number in (3, -4):
        with pytest.raises(IndexError):
            run[number]


def test_it_is_shown_in_a_line_and_as_a_table(directory):
    run = open_run(directory)
    assert repr(run) == f"<Run {str(directory)!r}: interrupted, 3 frames, to 0.08 s>"
    assert repr(run[1]) == "<Frame 1 at 0.04 s>"
    table = run._repr_html_()
    assert "<td>interrupted</td>" in table
    assert "<img" not in table
    (directory / "picture.png").write_bytes(b"PNG")
    certificate = {"intersection_free": True, "minimum_gap": 0.002}
    write_summary(
        directory / "summary.json", {"status": "failed", "reason": "a < b", "steps": 12, "certificate": certificate}
    )
    table = open_run(directory)._repr_html_()
    assert "<td>a &lt; b</td>" in table
    assert "<th>minimum gap</th><td>0.002</td>" in table
    assert 'src="data:image/png;base64,UE5H"' in table


def test_a_run_without_frames_is_shown_too(tmp_path):
    TrajectoryWriter(tmp_path / "trajectory.vtkhdf", world_surfaces(WORLD)).close()
    run = open_run(tmp_path)
    assert (len(run), list(run), bool(run)) == (0, [], True)
    assert repr(run).endswith("interrupted, 0 frames>")
    assert "<td>0</td>" in run._repr_html_()


def test_it_draws_its_frames(directory):
    from PIL import Image

    run, small = open_run(directory), {"size": (64, 80), "renderer": "ray"}
    picture = run.plot(0, **small)
    assert (picture.shape, picture.dtype) == ((80, 64, 3), np.uint8)
    assert picture.std() > 0
    file = run.plot(0, directory / "first.png", **small)
    for drawing in (run.plot, run.movie):
        with pytest.raises(InputError, match="exists"):
            drawing(path=file, **small)
    assert run.plot(0, file, overwrite=True, **small) == file
    with Image.open(file) as image:
        assert np.array_equal(np.asarray(image), picture)
    drawn = []
    movie = run.movie(directory / "all.gif", lambda done, total: drawn.append((done, total)), **small)
    with Image.open(movie) as image:
        assert image.n_frames == 3
    assert drawn == [(1, 3), (2, 3), (3, 3)]


@pytest.mark.parametrize(
    ("settings", "wrong", "right"),
    [
        ({"siz": (64, 64)}, "'siz'", "'size'"),
        ({"size": 3}, "3", "size=("),
        ({"size": (64, "x")}, "'x'", "size=("),
        ({"colours": "plain"}, "'colours'", "'colour'"),
        ({"title": "mine"}, "'title'", ""),
    ],
)
def test_a_setting_of_a_picture_that_cannot_be_is_refused(directory, settings, wrong, right):
    run = open_run(directory)
    for drawing in (run.plot, lambda **given: run.movie(directory / "movie.gif", **given)):
        with pytest.raises(InputError) as caught:
            drawing(**settings)
        assert wrong in caught.value.sentence
        assert right in caught.value.remedy
    assert not (directory / "movie.gif").exists()


def test_the_settings_of_pictures_and_movies_are_keywords_of_their_functions():
    of_picture, of_movie = (
        {name for name, each in signature(function).parameters.items() if each.kind is each.KEYWORD_ONLY}
        for function in (draw, movie)
    )
    assert of_picture == {*PICTURE_SETTINGS, "title", "dots_per_inch"}
    assert of_movie == {*PICTURE_SETTINGS, *MOVIE_SETTINGS, "title", "progress"}


def test_runs_and_frames_are_compared_and_hashed(directory):
    run, again = open_run(directory), open_run(directory)
    assert run != again
    assert run[0] == run[-len(run)]
    assert len({run, again, run[0], run[-len(run)]}) == 3
    with pytest.raises(TypeError):
        run[0.5]


@pytest.mark.parametrize("read", [open_run, resume, check])
@pytest.mark.parametrize("name", ["a" * 300, "a\0"], ids=["long", "NUL"])
def test_a_name_that_no_directory_can_have_is_refused(read, name):
    with pytest.raises(InputError):
        read(name)
