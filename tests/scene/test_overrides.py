import pytest

from clothsim.base.errors import InputError
from clothsim.keys.key_table import frozen
from clothsim.scene.overrides import override
from clothsim.scene.scene import Scene

SCENE = Scene(
    cloth={"mesh": "rectangle"},
    body=[{"mesh": "sphere", "radius": 0.3}, {"name": "floor", "mesh": "slab"}],
    effects={"membrane": {}, "gravity": {}},
)


@pytest.mark.parametrize(
    ("assignment", "section", "expected"),
    [
        ("solver.dt=0.02", "solver", {"dt": 0.02}),
        ("cloth.cells=[4, 5]", "cloth", {"mesh": "rectangle", "cells": [4, 5]}),
        ("cloth.mesh=disk", "cloth", {"mesh": "disk"}),
        ("body[0].radius = 0.1", "body", [{"mesh": "sphere", "radius": 0.1}, {"name": "floor", "mesh": "slab"}]),
        (
            "effects.gravity.acceleration=[0, -9, 0]",
            "effects",
            {"membrane": {}, "gravity": {"acceleration": [0, -9, 0]}},
        ),
    ],
)
def test_one_key_changes(assignment, section, expected):
    assert getattr(override(SCENE, assignment), section) == frozen(expected)


def test_a_file_is_found_from_the_current_folder(tmp_path, monkeypatch):
    (tmp_path / "person.obj").write_text("v 0 0 0\n")
    monkeypatch.chdir(tmp_path)
    assert override(SCENE, "body[0].mesh=person.obj").body[0]["mesh"] == str(tmp_path / "person.obj")


def test_files_that_match_a_pattern_are_found_from_the_current_folder(tmp_path, monkeypatch):
    (tmp_path / "kick1.obj").write_text("v 0 0 0\n")
    monkeypatch.chdir(tmp_path)
    assert override(SCENE, "body[0].frames=kick*.obj").body[0]["frames"] == str(tmp_path / "kick*.obj")
    assert "mesh" not in override(SCENE, "body[0].frames=kick*.obj").body[0]
    with pytest.raises(InputError, match=r"jump\*\.obj"):
        override(SCENE, "body[0].frames=jump*.obj")


@pytest.mark.parametrize("assignment", ["cloth.mesh=sheet.obj", "body[0].mesh=person.glb", "seed.file=start.obj"])
def test_a_missing_file_is_named(tmp_path, monkeypatch, assignment):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=assignment.partition("=")[2]):
        override(SCENE, assignment)


def test_a_new_mesh_replaces_the_keys_of_the_old_generator():
    sheet = Scene(cloth={"mesh": "rectangle", "size": [1, 2], "cells": [4, 4], "density": 0.2})
    assert override(sheet, "cloth.mesh=disk").cloth == {"mesh": "disk", "density": 0.2}
    assert override(sheet, "cloth.mesh=tube").cloth == {"mesh": "tube", "cells": (4, 4), "density": 0.2}


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("solver.dt", "no assignment"),
        ("dt=1", "no assignment"),
        ("solvr.dt=1", "'solver'"),
        ("solver.dtt=1", "'dt'"),
        ("effects.gravty.acceleration=1", "'gravity'"),
        ("cloth.mesh.size=1", "no table"),
        ("body.radius=0.1", r"body\[0\], floor"),
    ],
)
def test_what_names_no_key_is_refused(assignment, message):
    with pytest.raises(InputError, match=message):
        override(SCENE, assignment)
