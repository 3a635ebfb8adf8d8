"""Keys of a scene by path, and overrides."""

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.keys.key_table import frozen
from clothsim.scene.paths import get, located, override, parts_of, replace
from clothsim.scene.scene import Scene

SHIRT = {"name": "shirt", "mesh": "rectangle", "size": [1, 2], "position": np.array([0.0, 0.1, 0.2])}
COLLAR = {"mesh": "disk", "radius": 0.2, "fabric_of": {"all": "denim"}}
ONE = Scene(
    cloth=SHIRT,
    body=[{"name": "ball", "mesh": "sphere", "radius": 0.3, "motion": {"velocity": [1.0, 0.0, 0.0]}}],
    effects={
        "gravity": {},
        "air": {"wind": {"kind": "vortex", "circulation": 3.0, "core": 0.5}},
        "springs": {"spring": [{"select": "left", "stiffness": 5.0}]},
    },
    solver={"dt": 0.02},
)
TWO = Scene(cloth=[SHIRT, COLLAR], effects={"gravity": {"acceleration": [0.0, 0.0, -1.0]}})


@pytest.mark.parametrize(
    ("path", "parts"),
    [
        ("solver.dt", ["solver", "dt"]),
        (" cloth[1].size[0] ", ["cloth", 1, "size", 0]),
        ("cloth[my.shirt].size", ["cloth", "my.shirt", "size"]),
        ("cloth.fabric_of.left cuff", ["cloth", "fabric_of", "left cuff"]),
    ],
)
def test_parts_of_a_path(path, parts):
    assert parts_of(path) == parts


@pytest.mark.parametrize("path", ["", ".", "solver.", ".dt", "solver..dt", "cloth[1", "cloth]1[", "cloth[].size"])
def test_no_path(path):
    with pytest.raises(InputError, match="not a path"):
        parts_of(path)
    with pytest.raises(InputError, match="not a path"):
        override(ONE, f"{path}=1")


@pytest.mark.parametrize(
    ("scene", "path", "expected"),
    [
        (ONE, "solver.dt", 0.02),
        (ONE, "solver.integrator", "bdf2"),
        (ONE, "run.duration", 2.0),
        (ONE, "contact.pinch", "stop"),
        (ONE, "seed.from", "rest"),
        (ONE, "cloth.size", (1, 2)),
        (ONE, "cloth.size[1]", 2),
        (ONE, "cloth.shirt.size[1]", 2),
        (ONE, "cloth[0].cells", (40, 40)),
        (ONE, "cloth.position[2]", 0.2),
        (ONE, "cloth.fabric", "cotton"),
        (ONE, "cloth.density", None),
        (ONE, "body.subdivisions", 4),
        (ONE, "body.ball.motion.velocity[0]", 1.0),
        (ONE, "body.ball.motion.rotate_degrees_per_second", (0.0, 0.0, 0.0)),
        (ONE, "effects.gravity.acceleration", (0.0, 0.0, -9.81)),
        (ONE, "effects.gravity", {}),
        (ONE, "effects.air.wind.core", 0.5),
        (ONE, "effects.air.wind.axis", (0.0, 0.0, 1.0)),
        (ONE, "effects.springs.spring[0].stiffness", 5.0),
        (ONE, "effects.springs.spring[0].slack", False),
        (TWO, "cloth.shirt.size", (1, 2)),
        (TWO, "cloth[0].size", (1, 2)),
        (TWO, "cloth[1].radius", 0.2),
        (TWO, "cloth[1].cells", 20),
        (TWO, "cloth[1].fabric_of.all", "denim"),
        (TWO, "effects.gravity.acceleration[2]", -1.0),
    ],
)
def test_a_value(scene, path, expected):
    assert get(scene, path) == expected


@pytest.mark.parametrize(
    ("scene", "path", "value"),
    [
        (ONE, "solver.integrator", "backward_euler"),
        (ONE, "solver.tolerance", 1e-4),
        (ONE, "run.duration", 0.5),
        (ONE, "cloth.size", (3.0, 4.0)),
        (ONE, "cloth.size[1]", 4.0),
        (ONE, "cloth.position[2]", 0.5),
        (ONE, "cloth.fabric_of.collar", "denim"),
        (ONE, "body.ball.motion.velocity[1]", 0.5),
        (ONE, "effects.gravity.acceleration", (0.0, 0.0, -1.0)),
        (ONE, "effects.air.wind.core", 0.1),
        (ONE, "effects.springs.spring[0].stiffness", 1.0),
        (ONE, "effects.damping.rate", 3.0),
        (ONE, "effects.damping", {"rate": 3.0}),
        (TWO, "cloth.shirt.size", (3.0, 4.0)),
        (TWO, "cloth[1].radius", 0.1),
        (TWO, "cloth[1]", {"mesh": "disk"}),
    ],
)
def test_a_replaced_value(scene, path, value):
    before = scene.to_text()
    made = replace(scene, path, value)
    assert get(made, path) == frozen(value)
    assert scene.to_text() == before != made.to_text()
    assert type(made.cloth) is type(scene.cloth)


def test_an_entry_that_is_named_leaves_the_others_alone():
    made = replace(TWO, "cloth[1].radius", 0.1)
    assert made.cloths[0] == TWO.cloths[0]
    assert {**made.cloths[1], "radius": 0.2} == TWO.cloths[1]
    assert located(TWO, "cloth.shirt.size") == ("cloth", 0, ["size"])


BAD = [
    (ONE, "solver", "names a section"),
    (ONE, "solvr.dt", "'solver'"),
    (ONE, "solver.dtt", "'dt'"),
    (ONE, "solver.dt.x", r"solver\.dt"),
    (ONE, "solver[0]", "solver"),
    (ONE, "cloth.colour", "'colour'"),
    (ONE, "cloth.shirt.colour", "'colour'"),
    (ONE, "cloth.skirt.size", "'skirt'"),
    (ONE, "cloth[1].size", "there is one"),
    (ONE, "cloth.size[2]", "size"),
    (ONE, "cloth.mesh.size", "not a table"),
    (ONE, "cloth.radius", "'radius'"),
    (ONE, "rigid.density", "no rigid"),
    (ONE, "effects", "names a section"),
    (ONE, "effects.gravty.acceleration", "'gravity'"),
    (ONE, "effects.gravity.accel", "'accel'"),
    (ONE, "effects.springs.spring[1].stiffness", "spring"),
    (ONE, "effects.springs.spring.stiffness", "spring"),
    (TWO, "cloth.size", r"shirt, cloth\[1\]"),
    (TWO, "cloth.skirt.size", r"shirt, cloth\[1\]"),
    (TWO, "cloth[2].size", "there are 2"),
    (Scene(cloth=[SHIRT, SHIRT]), "cloth.shirt.size", "2 have this name"),
]


@pytest.mark.parametrize(("scene", "path", "message"), BAD)
def test_a_bad_path_is_one_error_everywhere(scene, path, message):
    with pytest.raises(InputError, match=message):
        get(scene, path)
    with pytest.raises(InputError):
        replace(scene, path, 1.0)
    with pytest.raises(InputError):
        override(scene, f"{path}=1.0")


def test_an_effect_that_is_not_there_has_no_value():
    with pytest.raises(InputError, match="gravity"):
        get(ONE, "effects.damping.rate")


@pytest.mark.parametrize(
    ("path", "value"),
    [("solver.dt", -1.0), ("solver.dt", "fast"), ("cloth.size[0]", 0.0), ("effects.gravity", 9.81), ("cloth[0]", 3)],
)
def test_a_bad_value_is_refused_as_in_a_scene(path, value):
    with pytest.raises(InputError):
        replace(ONE, path, value)


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


def test_keys_that_need_one_another_are_set_together(tmp_path, monkeypatch):
    (tmp_path / "start.obj").write_text("v 0 0 0\n")
    monkeypatch.chdir(tmp_path)
    pair = ["seed.from=file", "seed.file=start.obj"]
    for order in (pair, pair[::-1]):
        assert override(SCENE, *order).seed["file"] == str(tmp_path / "start.obj")
    with pytest.raises(InputError, match="seed"):
        override(SCENE, pair[0])
    sheet = Scene(cloth={"mesh": "rectangle", "size": [1, 2], "cells": [4, 4]})
    for order in (["cloth.mesh=disk", "cloth.radius=0.3"], ["cloth.radius=0.3", "cloth.mesh=disk"]):
        assert override(sheet, *order).cloth == {"mesh": "disk", "radius": 0.3}
    moved = override(sheet, "cloth.position[2]=0.5", "cloth.size[0]=3", "solver.dt=0.02", "solver.threads=1")
    assert (moved.cloth.position, moved.cloth.size, moved.solver.dt) == ((0, 0, 0.5), (3, 2), 0.02)
    assert override(sheet, "solver.dt=0.02", "solver.error=0.001").solver == {"error": 0.001}


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("solver.dt", "not an assignment"),
        ("dt=1", "not an assignment"),
        ("solvr.dt=1", "'solver'"),
        ("solver.dtt=1", "'dt'"),
        ("effects.gravty.acceleration=1", "'gravity'"),
        ("cloth.mesh.size=1", "not a table"),
        ("body.radius=0.1", r"body\[0\], floor"),
    ],
)
def test_what_names_no_key_is_refused(assignment, message):
    with pytest.raises(InputError, match=message):
        override(SCENE, assignment)


def test_a_key_of_a_list_of_tables_needs_a_number():
    with pytest.raises(InputError, match=r"effects\.springs\.spring is not a table") as caught:
        replace(ONE, "effects.springs.spring.stiffness", 3.0)
    assert "effects.springs.spring[0]" in caught.value.remedy
    changed = replace(ONE, "effects.springs.spring[0].stiffness", 3.0)
    assert get(changed, "effects.springs.spring[0].stiffness") == 3.0
