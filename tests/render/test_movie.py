import sys

import numpy as np
import pytest
from PIL import Image
from render_scenes import ball, sheet

from clothsim.base.errors import InputError, MissingPackageError
from clothsim.render.movie import movie
from clothsim.render.picture import draw

SETTINGS = {"size": (97, 72), "renderer": "ray", "samples": 1}


def falling(n=4):
    return [[sheet(n=6, lift=0.1 * (n - k), stretch=1 + 0.02 * k), ball(n=8)] for k in range(n)]


@pytest.mark.parametrize("name", ["run.gif", "run.webp"])
def test_a_movie_of_images_has_every_frame_and_reports_progress(name, tmp_path):
    seen = []
    movie(
        tmp_path / name,
        falling(),
        frames_per_second=10,
        progress=lambda done, total: seen.append((done, total)),
        **SETTINGS,
    )
    with Image.open(tmp_path / name) as picture:
        assert picture.n_frames == 4
        assert picture.size == (96, 72)
        picture.seek(1)
        picture.load()
        assert picture.info["duration"] == 100
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_a_generator_of_frames_works_and_the_camera_stands_still(tmp_path):
    movie(tmp_path / "run.gif", (frame for frame in falling(2)), **SETTINGS)
    with Image.open(tmp_path / "run.gif") as picture:
        frames = []
        for k in range(2):
            picture.seek(k)
            frames.append(np.asarray(picture.convert("RGB")).astype(float))
    moved = np.abs(frames[0] - frames[1]).max(axis=2)
    assert moved[:40].max() > 30
    assert moved[-3:, :3].max() < 8  # the backdrop and the scalar bar do not move
    assert moved[20:60, -14:].max() < 8


def test_a_webp_keeps_the_colours_of_its_frames(tmp_path):
    draw(tmp_path / "frame.png", falling(2)[0], size=(96, 72), renderer="ray", limits=(0.98, 1.02))
    movie(tmp_path / "same.webp", falling(2), limits=(0.98, 1.02), **{**SETTINGS, "samples": 2})
    with Image.open(tmp_path / "same.webp") as film, Image.open(tmp_path / "frame.png") as frame:
        film.seek(0)
        bar = np.s_[:, -12:]
        difference = np.asarray(film.convert("RGB"), float)[bar] - np.asarray(frame.convert("RGB"), float)[bar]
    assert np.abs(difference).mean() < 4


def test_an_mp4_has_every_frame(tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    movie(tmp_path / "run.mp4", falling(), frames_per_second=8, **SETTINGS)
    count, seconds = ffmpeg.count_frames_and_secs(str(tmp_path / "run.mp4"))
    assert count == 4
    assert seconds == pytest.approx(0.5, abs=0.02)


def test_without_ffmpeg_an_mp4_names_its_extra_and_a_gif_is_written(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingPackageError) as caught:
        movie(tmp_path / "run.mp4", falling(2), **SETTINGS)
    assert "clothsim[movies]" in caught.value.remedy
    assert list(tmp_path.iterdir()) == []
    movie(tmp_path / "run.gif", falling(2), **SETTINGS)
    with Image.open(tmp_path / "run.gif") as picture:
        assert picture.n_frames == 2


@pytest.mark.parametrize(("name", "frames", "rate"), [("run.avi", 2, 10), ("run.gif", 0, 10), ("run.gif", 2, 0)])
def test_bad_arguments_are_refused(tmp_path, name, frames, rate):
    with pytest.raises(InputError):
        movie(tmp_path / name, falling(frames), frames_per_second=rate, **SETTINGS)
