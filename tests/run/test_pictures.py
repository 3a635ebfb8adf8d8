"""Pictures of fields."""

from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from small_scenes import RUN, small_scene

from clothsim import InputError, Scene, simulate
from clothsim.cli import main
from clothsim.mesh.generators.mannequin.dummy_hands import with_dummy_hands
from clothsim.mesh.generators.mannequin.generator import mannequin
from clothsim.run import pictures
from clothsim.run.fields import FIELDS
from clothsim.run.pictures import field_settings

CONTACT = [name for name in FIELDS if FIELDS[name].in_step]
SMALL = {"size": (200, 150), "renderer": "ray"}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return simulate(small_scene(run=RUN | {"fields": CONTACT}), tmp_path_factory.mktemp("run"))


def test_every_field_has_a_picture_of_its_own(run):
    pictures = [run.plot(field=name, **SMALL) for name in FIELDS]
    plain = run.plot(colour="plain", **SMALL)
    for picture in pictures:
        assert picture.shape == (150, 200, 3)
        assert np.abs(picture.astype(int) - plain).mean() > 1
    distinct = {picture.tobytes() for picture in pictures}
    assert len(distinct) >= len(FIELDS) - 1  # |F| = |U|, so two may differ in the heading only


def test_the_values_of_triangles_are_those_of_the_field_at_the_corners(run):
    settings = field_settings(run, "compression")
    cloth, ball = settings["surfaces_of"](run.trajectory, -1)
    compression = run.field("compression")
    assert compression.min() <= cloth.values.min() <= cloth.values.max() <= compression.max()
    assert len(cloth.values) == len(cloth.positions)
    assert len(ball.values) == 0


def test_the_values_of_vertices_are_the_field(run):
    cloth, _ = field_settings(run, "contact_pressure")["surfaces_of"](run.trajectory, 2)
    assert np.array_equal(cloth.values, run.field("contact_pressure", 2))


def test_studio_draws_the_mannequin_with_the_hands_of_a_dummy(monkeypatch):
    x, triangles = mannequin()
    cloth = SimpleNamespace(name="c", role="cloth", triangles=[[0, 1, 2]], own_triangles=[[0, 1, 2]], rows=[0, 1, 2])
    cloth.edges = ()
    trajectory = SimpleNamespace(
        surfaces=[cloth],
        times=[0.0],
        positions=lambda frame: np.zeros((3, 3)),
        stretches=lambda frame: np.ones((1, 2)),
        bodies=lambda frame: [("body", x, triangles)],
    )
    drawn = []
    monkeypatch.setattr(pictures.render, "draw", lambda target, surfaces, **settings: drawn.append(surfaces))
    for style in ("fields", "studio"):
        pictures.draw_frame(trajectory, "a.png", style=style)
    assert np.array_equal(drawn[0][1].positions, x)
    assert np.array_equal(drawn[1][1].positions, with_dummy_hands(x, triangles, np.zeros((3, 3))))
    assert not np.array_equal(drawn[1][1].positions, x)


def test_the_cloths_of_a_scene_are_of_the_kinds_of_their_fabrics():
    sheet = {"mesh": "rectangle", "cells": [2, 2]}
    own = (
        {},
        {"fabric": "denim"},
        {"fabric": "denim", "bending_stiffness": 1e-3},
        {"density": 0.05},
        {"thickness": 3e-5},
    )
    scene = Scene(cloth=[{**sheet, "name": str(k), **keys} for k, keys in enumerate(own)])
    assert pictures.kinds_of(scene) == ["plain", "denim", "denim", "satin", "foil"]


def test_a_run_is_drawn_in_the_kinds_of_its_cloths_in_a_studio_alone(run):
    assert "surfaces_of" not in pictures.settings_of(run, None, {"style": "fabric"})
    surfaces_of = pictures.settings_of(run, None, {"style": "studio"})["surfaces_of"]
    cloth, ball = surfaces_of(run.trajectory, -1)
    assert [cloth.kind] == pictures.kinds_of(run.scene)
    assert ball.kind == "plain"


def test_directions_are_strokes_on_the_same_triangles_in_all_frames(run):
    surfaces_of = field_settings(run, "principal_directions")["surfaces_of"]
    first, last = (surfaces_of(run.trajectory, frame)[0] for frame in (0, -1))
    assert first.strokes.shape == last.strokes.shape == (len(first.strokes), 2, 2, 3)
    centres = run.positions(-1)[run.triangles].mean(axis=1)
    middles = last.strokes[:, 0].mean(axis=1)
    assert np.linalg.norm(middles[:, None] - centres, axis=2).min(axis=1).max() < 1e-12
    along = last.strokes[:, :, 1] - last.strokes[:, :, 0]
    assert (along[:, 0] * along[:, 1]).sum(axis=1) == pytest.approx(np.zeros(len(along)), abs=1e-8)


def test_a_movie_of_a_field(run, tmp_path):
    movie = run.movie(tmp_path / "stress.gif", field="stress", **SMALL)
    with Image.open(movie) as image:
        assert image.n_frames == len(run)


def test_the_command_draws_a_field(run, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("CLOTHSIM_RENDERER", "ray")
    target = tmp_path / "thickness.png"
    assert main(["render", str(run.directory), "-o", str(target), "--field", "thickness", "--size", "200x150"]) == 0
    assert np.array_equal(np.asarray(Image.open(target)), run.plot(field="thickness", **SMALL))
    other = str(tmp_path / "other.png")
    assert main(["render", str(run.directory), "-o", other, "--field", "thikness"]) != 0
    assert "'thickness'" in capsys.readouterr().err


def test_an_unknown_field_is_refused(run):
    with pytest.raises(InputError, match="thikness"):
        run.plot(field="thikness", **SMALL)
