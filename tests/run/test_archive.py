"""Archives: replay of a failed run elsewhere; untrusted archives."""

import json
import os
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from meshes import grid
from small_scenes import BALL, EFFECTS, RUN, small_scene

from clothsim import InputError, Scene, resume, simulate
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint, write_checkpoint
from clothsim.run import export as archive
from clothsim.run.export import unpack_bundle, write_bundle
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.named_files import relocated
from clothsim.scene.scene import scene_from_text

PIN = {"pins": {"select": [12], "motion": {"velocity": [0.0, 0.0, -0.5]}}}


def obj(path, positions, triangles):
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in positions.tolist()]
    path.write_text("\n".join(lines + [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]))


def scene_of_files(folder):
    """A sheet from a file, its seed, and a moving floor, in folders of their own and with an awkward name."""
    positions, triangles = grid(4, 4)
    obj(folder / "my sheets" / "flat (1).obj", positions, triangles)
    obj(folder / "seed.obj", positions + np.array([0.0, 0.0, 0.02]), triangles)
    floor, faces = 3 * (grid(1, 1)[0] - np.array([0.3, 0.3, 0.0])), grid(1, 1)[1]
    for k in (0, 2, 10):  # in natural order
        obj(folder / "floor" / f"f{k}.obj", floor + np.array([0.0, 0.0, 0.002 * k - 0.03]), faces)
    return Scene(
        cloth={"mesh": "my sheets/flat (1).obj"},
        body={"name": "floor", "frames": "floor/f*.obj", "frames_per_second": 25},
        effects=EFFECTS | {"pins": {"select": [24], "motion": {"velocity": [0.0, 0.0, -0.5]}}},
        solver={"dt": 0.02, "threads": 1, "linear": "superlu"},
        run=RUN,
        seed={"from": "file", "file": "seed.obj"},
        directory=folder,
    )


@pytest.fixture(scope="module")
def failed(tmp_path_factory):
    """A failed run of a scene of files, and its archive."""
    folder = tmp_path_factory.mktemp("failed")
    run = simulate(scene_of_files(folder / "scene"), folder / "run")
    assert run.summary["failure"]["cause"] == "blocked"
    assert "of floor" in run.summary["failure"]["element"]
    write_bundle(folder / "run", folder / "run.zip")
    return run, folder / "run.zip"


def test_the_archive_replays_the_failure_where_the_scenes_files_are_not(failed, tmp_path):
    run, archive = failed
    unpack_bundle(archive, tmp_path / "here")
    (tmp_path / "here").rename(tmp_path / "there")  # what is unpacked may be moved on
    for _ in range(2):
        again = resume(tmp_path / "there")
        assert again.summary["failure"] == run.summary["failure"]
        assert again.reason == run.reason
        assert again.record() == run.record()
        assert again.summary["steps"] == run.summary["steps"]
        assert len(again.times) == 1
        saved, first = (read_checkpoint(each.directory / CHECKPOINT_NAME) for each in (again, run))
        assert np.array_equal(saved.state.positions, first.state.positions)
        assert saved.state.time == again.times[0] == first.state.time


def test_it_has_the_listed_files_and_no_path_of_this_machine(failed, tmp_path):
    run, archive = failed
    with zipfile.ZipFile(archive) as packed:
        names = set(packed.namelist())
        assert {"README.txt", "scene.json", "versions.json", "checkpoint.npz", "record.jsonl", "summary.json"} <= names
        assert sorted(name for name in names if name.startswith("meshes/")) == [
            "meshes/body0/000000_f0.obj",
            "meshes/body0/000001_f2.obj",
            "meshes/body0/000002_f10.obj",
            "meshes/cloth0/flat__1_.obj",
            "meshes/seed/seed.obj",
        ]
        readme = packed.read("README.txt").decode()
        scene = json.loads(packed.read("scene.json"))
        assert {"python", "clothsim", "numpy"} <= set(json.loads(packed.read("versions.json")))
        packed.extract("checkpoint.npz", tmp_path)
    assert "\n  clothsim resume run.zip\n" in readme
    assert run.reason in readme
    text = read_checkpoint(tmp_path / "checkpoint.npz").scene_text
    assert str(run.directory.parent) not in text + json.dumps(scene)
    assert scene == json.loads(text)
    assert scene["directory"] == "."


def test_a_moved_scene_is_the_same_world(tmp_path):
    scene = scene_of_files(tmp_path / "scene")
    text, files = relocated(scene)
    for name, source in files.items():
        (tmp_path / "moved" / name).parent.mkdir(parents=True, exist_ok=True)
        source.rename(tmp_path / "moved" / name)
    scene_of_files(tmp_path / "scene")
    one, other = build(scene).world, build(scene_from_text(text, tmp_path / "moved")).world
    assert np.array_equal(one.start(), other.start())
    assert np.array_equal(one.bodies[0].at(0.05), other.bodies[0].at(0.05))


def test_a_scene_without_files_needs_none():
    text, files = relocated(small_scene(effects=EFFECTS | PIN, body=[BALL]))
    assert not files
    assert json.loads(text)["body"] == [BALL]


def test_a_run_that_completed_can_be_bundled_too(tmp_path):
    simulate(small_scene(effects={"inertia": {}, "gravity": {}}, body=()), tmp_path / "run")
    write_bundle(tmp_path / "run", tmp_path / "run.zip")
    unpack_bundle(tmp_path / "run.zip", tmp_path / "again")
    assert resume(tmp_path / "again").status == "completed"


def test_a_run_made_with_a_python_function_is_refused(tmp_path):
    scene = small_scene(effects={**EFFECTS, "air": {"strength": lambda time: time, "wind": [1, 0, 0]}})
    simulate(scene, tmp_path / "run")
    with pytest.raises(InputError, match=r"effects\.air\.strength"):
        write_bundle(tmp_path / "run", tmp_path / "run.zip")
    assert not (tmp_path / "run.zip").exists()


def test_a_file_that_exists_or_is_missing_is_refused(failed, tmp_path):
    run, archive = failed
    with pytest.raises(InputError):
        write_bundle(run.directory, archive)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("all my work")
    with pytest.raises(InputError):
        unpack_bundle(archive, tmp_path / "full")
    with pytest.raises(InputError, match="checkpoint"):
        write_bundle(tmp_path / "full", tmp_path / "new.zip")
    gone = simulate(scene_of_files(tmp_path / "scene"), tmp_path / "run")
    (tmp_path / "scene" / "seed.obj").unlink()
    with pytest.raises(InputError, match=r"seed\.obj"):
        write_bundle(gone.directory, tmp_path / "new.zip")
    assert {path.name for path in tmp_path.iterdir()} == {"full", "scene", "run"}


# --- archives of strangers ------------------------------------------------------------------------------------------


def altered(archive, target, extra=(), scene=None):
    """A copy of an archive with more entries, or another scene in its checkpoint."""
    with zipfile.ZipFile(archive) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == CHECKPOINT_NAME and scene is not None:
                file = target.with_suffix(".npz")
                file.write_bytes(content)
                saved = read_checkpoint(file)
                write_checkpoint(file, replace(saved, scene_text=scene(saved.scene_text)))
                content = file.read_bytes()
                file.unlink()
            new.writestr(name, content)
        for name, content in extra:
            new.writestr(name, content)
    return target


@pytest.mark.parametrize(
    "name",
    ["../evil.txt", "/evil.txt", "meshes/../../evil.txt", "meshes\\..\\evil.txt", "C:evil.txt", "evil.py", "meshes:x"],
)
def test_a_name_that_leads_elsewhere_is_refused_and_nothing_is_written(failed, tmp_path, name):
    hostile = altered(failed[1], tmp_path / "hostile.zip", extra=[(name, "evil")])
    with pytest.raises(InputError, match="does not belong"):
        unpack_bundle(hostile, tmp_path / "in" / "here")
    assert os.listdir(tmp_path) == ["hostile.zip"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("meshes/seed/seed.obj", "/etc/passwd"),
        ("meshes/seed/seed.obj", "../seed.obj"),
        ("meshes/cloth0/flat__1_.obj", "C:/secret.obj"),
        ("meshes/body0/*", "../../*"),
        ('"directory": "."', '"directory": "/"'),
        ('"solver"', '"sover"'),
        ('"seed": {', '"seed": [{'),
    ],
)
def test_a_scene_that_names_files_elsewhere_is_refused(failed, tmp_path, old, new):
    hostile = altered(failed[1], tmp_path / "hostile.zip", scene=lambda text: text.replace(old, new))
    with pytest.raises(InputError):
        unpack_bundle(hostile, tmp_path / "here")
    assert os.listdir(tmp_path) == ["hostile.zip"]


def test_what_unpacks_to_too_much_is_refused(failed, tmp_path, monkeypatch):
    monkeypatch.setattr(archive, "MOST_BYTES", 1000)
    with pytest.raises(InputError):
        unpack_bundle(failed[1], tmp_path / "here")
    monkeypatch.setattr(archive, "MOST_BYTES", 1 << 30)
    monkeypatch.setattr(archive, "MOST_FILES", 3)
    with pytest.raises(InputError):
        unpack_bundle(failed[1], tmp_path / "here")


def test_a_link_is_unpacked_as_a_plain_file(failed, tmp_path):
    link = zipfile.ZipInfo("meshes/link.obj")
    link.external_attr = 0o120777 << 16
    unpack_bundle(altered(failed[1], tmp_path / "hostile.zip", extra=[(link, "/etc/passwd")]), tmp_path / "here")
    assert not (tmp_path / "here/meshes/link.obj").is_symlink()
    assert (tmp_path / "here/meshes/link.obj").read_text() == "/etc/passwd"


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04 broken"])
def test_what_is_no_archive_is_refused(tmp_path, content):
    (tmp_path / "file.zip").write_bytes(content)
    with pytest.raises(InputError, match="archive"):
        unpack_bundle(tmp_path / "file.zip", tmp_path / "here")


def test_an_archive_of_something_else_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "file.zip", "w") as archive:
        archive.writestr("README.txt", "hello")
    with pytest.raises(InputError, match=r"checkpoint\.npz"):
        unpack_bundle(tmp_path / "file.zip", tmp_path / "here")


def test_a_damaged_archive_is_refused(failed, tmp_path):
    content = bytearray(failed[1].read_bytes())
    with zipfile.ZipFile(failed[1]) as archive:
        offset = archive.getinfo(CHECKPOINT_NAME).header_offset
    content[offset + 200] ^= 0xFF
    (tmp_path / "file.zip").write_bytes(content)
    with pytest.raises(InputError):
        unpack_bundle(tmp_path / "file.zip", tmp_path / "here")
