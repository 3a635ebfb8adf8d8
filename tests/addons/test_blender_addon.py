"""Blender add-on: its files and process without Blender; with one named by the environment, object in and drape out."""

import ast
import importlib.util
import json
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest

import clothsim
from clothsim.scene.toml_file import load_scene

ADDON = Path(__file__).parents[2] / "addons" / "blender"
BLENDER = os.environ.get("CLOTHSIM_BLENDER_PYTHON")
"""A Python that has bpy."""


def part(name: str):
    """A module of the add-on, without the package, which needs Blender."""
    folder = ADDON if name == "make_zip" else ADDON / "clothsim_blender"
    spec = importlib.util.spec_from_file_location(f"addon_{name}", folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


scene_files, point_cache, process = (part(name) for name in ("scene_files", "point_cache", "process"))


def grid(n: int = 6, height: float = 0.22) -> object:
    """A square of quads."""
    x, y = np.meshgrid(np.linspace(-0.2, 0.2, n), np.linspace(-0.2, 0.2, n), indexing="ij")
    vertices = np.column_stack([x.ravel(), y.ravel(), np.full(n * n, height)])
    faces = [
        (i * n + j, (i + 1) * n + j, (i + 1) * n + j + 1, i * n + j + 1) for i in range(n - 1) for j in range(n - 1)
    ]
    return scene_files.Mesh("Grid.001", vertices, faces)


def box(z: float, name: str = 'a "box"') -> object:
    """A cube of .3 m."""
    corners = np.array([[x, y, z + k] for x in (-0.15, 0.15) for y in (-0.15, 0.15) for k in (-0.15, 0.15)])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return scene_files.Mesh(name, corners, faces)


def test_the_scene_is_one_of_clothsim(tmp_path):
    settings = scene_files.Settings(pins=[0, 5], fabric="denim", frames_per_second=24)
    file = scene_files.write_scene(tmp_path, grid(), [[box(0.0)], [box(-1.0, "lift"), box(-0.9, "lift")]], settings)
    scene = load_scene(file)
    assert scene.effects["pins"]["select"] == (0, 5)
    assert not [finding for finding in clothsim.check(file) if finding.severity == "error"]
    assert [body["name"] for body in scene.body] == ['a "box"', "lift"]


def test_the_process_drapes_and_leaves_a_point_cache(tmp_path):
    settings = scene_files.Settings(duration=0.12, frames_per_second=25.0, pins=[0], self_contact=False)
    file = scene_files.write_scene(tmp_path, grid(), [[box(0.0)]], settings)
    simulation = process.Simulation(f"{sys.executable} -m clothsim", file)
    while simulation.running():
        simulation.wait(0.1)
    frames = point_cache.read_cache(simulation.export(25.0))
    run = clothsim.open_run(tmp_path / "run")
    assert simulation.reason() == run.reason
    assert len(frames) == len(run)
    assert np.allclose(frames[-1], run.positions(-1), atol=1e-6)
    assert np.allclose(frames[-1][0], grid().vertices[0], atol=1e-6)


def test_a_failure_is_said_in_the_words_of_clothsim(tmp_path):
    settings = scene_files.Settings(fabric="plywood")
    file = scene_files.write_scene(tmp_path, grid(), [], settings)
    simulation = process.Simulation(f"{sys.executable} -m clothsim", file)
    simulation.wait(60)
    with pytest.raises(RuntimeError, match="plywood"):
        simulation.export(25.0)


def test_caches_go_into_the_coordinates_of_an_object(tmp_path):
    frames = np.random.default_rng(0).random((3, 5, 3))
    matrix = np.eye(4)
    matrix[:3, :3] = 2 * np.linalg.qr(np.random.default_rng(1).random((3, 3)))[0]
    matrix[:3, 3] = [1, 2, 3]
    there = point_cache.moved(frames, matrix)
    assert np.allclose(there[0, 0], (matrix @ [*frames[0, 0], 1.0])[:3])
    assert np.allclose(point_cache.moved(there, np.linalg.inv(matrix)), frames)
    point_cache.write_cache(tmp_path / "a.pc2", there)
    assert np.allclose(point_cache.read_cache(tmp_path / "a.pc2"), there, atol=1e-6)
    (tmp_path / "b.pc2").write_bytes(b"POINTCACHE2")
    with pytest.raises(ValueError, match="not a point cache"):
        point_cache.read_cache(tmp_path / "b.pc2")


def test_the_zip_has_all_modules_and_its_manifest(tmp_path):
    names = part("make_zip").make_zip(tmp_path / "addon.zip")
    with zipfile.ZipFile(tmp_path / "addon.zip") as made:
        assert made.namelist() == names
        manifest = tomllib.loads(made.read("clothsim_blender/blender_manifest.toml").decode())
    assert manifest["type"] == "add-on"
    imported = {
        node.module
        for node in ast.walk(ast.parse((ADDON / "clothsim_blender" / "__init__.py").read_text()))
        if isinstance(node, ast.ImportFrom) and node.level == 1 and node.module
    }
    assert {f"clothsim_blender/{name}.py" for name in imported} <= set(names)


@pytest.mark.skipif(not BLENDER, reason="CLOTHSIM_BLENDER_PYTHON names no Python with bpy")
def test_object_in_drape_out(tmp_path):
    command = [BLENDER, str(ADDON / "headless_check.py"), f"{sys.executable} -m clothsim", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    report = json.loads(done.stdout.splitlines()[-1])
    assert report["answer"] == ["FINISHED"]
    assert report["first"] == "clothsim"
    assert report["pinned"] < 1e-6
    run = clothsim.open_run(Path(report["folder"]) / "run")
    seen = np.load(tmp_path / "seen.npy")
    assert run.status == "completed"
    assert run.intersection_free
    assert np.abs(seen - run.positions(-1)).max() < 1e-6
    assert seen[:, 2].min() < 0
