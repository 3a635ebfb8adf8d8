"""Cloths and bodies from arrays: checks, locks, tables, and the text of a scene."""

import json
from dataclasses import replace

import numpy as np
import pytest
from meshes import grid
from small_scenes import SOLVER

import clothsim
from clothsim import Body, Cloth, InputError, Scene, resume, simulate
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.keys.mesh_keys import BodyKeys, ClothKeys
from clothsim.keys.schema import keys_of
from clothsim.run.export import unpack_bundle, write_bundle
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import scene_from_text

POINTS, FACES = grid(3, 2)
FALL = {"inertia": {}, "membrane": {}, "gravity": {}}


def world_of(cloth, **sections):
    return build(Scene(cloth=cloth, effects=FALL, **sections)).world


class TestArraysIn:
    def test_they_are_the_mesh_of_the_world(self):
        cloth = world_of(Cloth(POINTS, FACES, name="sheet", fabric="denim", density=0.2)).cloths[0]
        assert np.array_equal(cloth.triangles, FACES)
        assert np.abs(cloth.rest_positions - POINTS).max() < 1e-15
        assert (cloth.name, cloth.fabric.density, cloth.flat) == ("sheet", 0.2, False)

    def test_they_give_the_bits_of_the_same_file(self, tmp_path):
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in POINTS.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (FACES + 1).tolist()]
        (tmp_path / "sheet.obj").write_text("\n".join(lines))
        keys = {"position": [0, 0.1, 1], "rotation_degrees": [10, 20, 30], "scale": 0.5}
        one = world_of({"mesh": "sheet.obj", **keys}, directory=tmp_path).start()
        assert np.array_equal(world_of(Cloth(POINTS, FACES, **keys)).start(), one)

    @pytest.mark.parametrize("cloth", [(POINTS, FACES), [POINTS, FACES]], ids=["pair", "list"])
    def test_a_pair_may_be_the_mesh_of_a_table(self, cloth):
        assert len(world_of({"mesh": cloth}).triangles) == len(FACES)

    def test_lists_of_both_kinds(self):
        cloths = [Cloth(POINTS, FACES, name="a"), {"name": "b", "mesh": "rectangle", "cells": [2, 2]}]
        world = world_of(cloths, body=[Body(POINTS, FACES, name="c", position=[0, 0, -1]), {"mesh": "slab"}])
        assert world.names == ("a", "b", "c", "body[1]")

    def test_every_key_of_the_section_is_one_of_the_class(self):
        assert set(keys_of(Cloth)) == set(keys_of(ClothKeys))
        assert set(keys_of(Body)) == set(keys_of(BodyKeys)) | {"frames_per_second"}

    def test_the_arrays_are_locked_copies(self):
        points = POINTS.copy()
        cloth = Cloth(points, FACES)
        points[:] = 7
        assert np.array_equal(cloth.vertices, POINTS)
        with pytest.raises(ValueError, match="read-only"):
            cloth.vertices[0, 0] = 1.0


class TestRest:
    @pytest.mark.parametrize("by", ["vertex", "corner"])
    def test_material_coordinates(self, by):
        flat = 2 * POINTS[:, :2]
        cloth = world_of(Cloth(POINTS, FACES, rest=flat if by == "vertex" else flat[FACES])).cloths[0]
        assert cloth.flat
        assert np.array_equal(cloth.material_coordinates, flat[FACES])
        assert np.abs(cloth.positions - POINTS).max() < 1e-15

    def test_rest_positions(self):
        cloth = world_of(Cloth(POINTS, FACES, rest=2 * POINTS, position=[0, 0, 1])).cloths[0]
        assert not cloth.flat
        assert np.array_equal(cloth.rest_positions, 2 * POINTS)
        assert np.abs(cloth.positions - POINTS)[:, :2].max() < 1e-15

    def test_it_is_scaled_with_the_vertices(self):
        cloth = world_of(Cloth(POINTS, FACES, rest=POINTS[:, :2], scale=0.1)).cloths[0]
        assert np.abs(cloth.material_coordinates - 0.1 * POINTS[FACES][..., :2]).max() < 1e-15


class TestBody:
    def test_frames_move_it(self):
        frames = np.stack([POINTS, POINTS + np.array([0, 0, 1])])
        world = world_of({"mesh": "rectangle"}, body=Body(POINTS, FACES, frames=frames, frames_per_second=10))
        body = world.bodies[0]
        assert np.abs(body.at(0.05) - body.at(0.0) - [0, 0, 0.5]).max() < 1e-14

    def test_a_motion_turns_it(self):
        motion = clothsim.Motion(velocity=[1, 0, 0])
        body = world_of({"mesh": "rectangle"}, body=Body(POINTS, FACES, motion=motion)).bodies[0]
        assert np.abs(body.at(2.0) - body.at(0.0) - [2, 0, 0]).max() < 1e-14

    def test_frames_and_motion_exclude_each_other(self):
        with pytest.raises(InputError, match=r"frames.*motion"):
            Body(POINTS, FACES, frames=POINTS[None], motion={"velocity": [1, 0, 0]})


BROKEN = POINTS.copy()
BROKEN[4, 1] = np.nan
OUTSIDE = FACES.copy()
OUTSIDE[2, 0] = 99


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: Cloth(BROKEN, FACES), r"cloth\.vertices\[4, 1\]"),
        (lambda: Cloth(POINTS[:, :2], FACES), r"cloth\.vertices .*\(12, 2\)"),
        (lambda: Cloth(POINTS, OUTSIDE), r"cloth\.triangles\[2\].*99"),
        (lambda: Cloth(POINTS, FACES + 0.5), r"cloth\.triangles"),
        (lambda: Cloth(POINTS, FACES[:0]), r"cloth\.triangles"),
        (lambda: Cloth(POINTS, FACES, rest=POINTS[:5]), r"cloth\.rest .*\(5, 3\).*\(12, 2\)"),
        (lambda: Cloth(POINTS, FACES, rest=BROKEN), r"cloth\.rest\[4, 1\]"),
        (lambda: Cloth(POINTS, FACES, density=-1), r"cloth\.density"),
        (lambda: Cloth(POINTS, FACES, position=[1, 2]), r"cloth\.position .*3"),
        (lambda: Scene(cloth=Body(POINTS, FACES)), r"cloth .*clothsim\.Body.*clothsim\.Cloth"),
        (lambda: Scene(cloth=(POINTS, FACES)), r"cloth\[0\] .*clothsim\.Cloth\(vertices"),
        (lambda: Cloth("shirt.obj"), r"'shirt\.obj'.*cloth=\{'mesh': 'shirt\.obj'\}"),
        (lambda: Cloth(POINTS), r"cloth.* ndarray"),
        (lambda: Body(POINTS, FACES, frames=POINTS), r"body\.frames .*\(12, 3\).*\(frames, 12, 3\)"),
        (lambda: Body(BROKEN, FACES), r"body\.vertices\[4, 1\]"),
        (lambda: Scene(cloth={"mesh": (POINTS, OUTSIDE)}), r"cloth\.mesh\.triangles\[2\]"),
        (lambda: Scene(cloth={"mesh": (POINTS,)}), r"cloth\.mesh .*1"),
        (lambda: Scene(cloth=[Cloth(POINTS, FACES), {"mesh": (BROKEN, FACES)}]), r"cloth\[1\]\.mesh\.vertices\[4, 1\]"),
        (lambda: Scene(cloth={"mesh": {"x": 1}}), r"cloth\.mesh.*'x'"),
        (lambda: Scene(cloth={"mesh": {"arrays": "zzz"}}), r"cloth\.mesh\.arrays"),
        (lambda: Scene(cloth={"mesh": (POINTS, FACES), "cells": [2, 2]}), r"cloth \(arrays\).*'cells'"),
    ],
)
def test_what_is_wrong_is_named(make, names):
    with pytest.raises(InputError, match=names):
        make()


class TestText:
    def test_it_holds_the_arrays_to_the_last_bit(self):
        points = POINTS + np.random.default_rng(0).normal(size=POINTS.shape)
        frames = np.random.default_rng(1).normal(size=(3, *POINTS.shape))
        scene = Scene(cloth=Cloth(points, FACES, rest=POINTS[:, :2]), body=Body(points, FACES, frames=frames))
        again = scene_from_text(scene.to_text())
        for one, other in zip((*scene.cloths, *scene.bodies), (*again.cloths, *again.bodies), strict=True):
            for name in ("vertices", "triangles", "rest", "frames"):
                first, second = getattr(one["mesh"], name), getattr(other["mesh"], name)
                assert (first is None) == (second is None)
                assert first is None or (np.array_equal(first, second) and first.dtype == second.dtype)

    def test_a_stored_archive_that_would_unpack_to_more_is_refused(self, monkeypatch):
        text = MeshArrays.checked("x", POINTS, FACES).text
        with pytest.raises(InputError, match="mesh"):
            MeshArrays.from_text("x", text[: len(text) // 2])

    def test_a_run_of_arrays_is_resumed_from_its_archive(self, tmp_path):
        scene = Scene(
            cloth=Cloth(POINTS, FACES, position=[0, 0, 1]),
            body=Body(POINTS, FACES, scale=3.0),
            effects=FALL,
            solver=SOLVER,
            run={"duration": 0.08, "frames_per_second": 25},
        )
        run = simulate(scene, tmp_path / "run")
        assert run.status == "completed"
        write_bundle(tmp_path / "run", tmp_path / "run.zip")
        unpack_bundle(tmp_path / "run.zip", tmp_path / "there")
        assert set(json.loads((tmp_path / "there" / "scene.json").read_text())["cloth"]["mesh"]) == {"arrays"}
        again = resume(tmp_path / "there")
        assert again.status == "completed"
        assert np.array_equal(again.positions(-1), run.positions(-1))


def test_a_replaced_key_keeps_the_arrays():
    cloth = Cloth(POINTS, FACES, rest=POINTS[:, :2])
    heavy = replace(cloth, density=0.3)
    assert (heavy.density, cloth.density) == (0.3, None)
    assert np.array_equal(heavy.arrays.rest, cloth.arrays.rest)
