"""Wrinkles end to end: a strip that is pushed together, what its finer run keeps, and what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

import clothsim
from clothsim.base.errors import InputError
from clothsim.cli import main
from clothsim.engine import build
from clothsim.garments.wrinkle.finer import subdivision
from clothsim.garments.wrinkled import TARGETS_NAME, WRINKLES_NAME, finer_scene, wrinkle

PUSHED = {
    "group": [
        {"select": "left", "motion": {"velocity": [0.1, 0, 0]}},
        {"select": [27, 28, 29], "motion": {"velocity": [-0.1, 0, 0]}},
    ]
}


def pushed(**keys):
    sheet = {"mesh": "rectangle", "size": [0.9, 0.2], "cells": [9, 2], "diagonals": "right"}
    effects = {name: {} for name in ("inertia", "bending", "self_contact", "gravity")}
    effects |= {"membrane": {"compression": 0.02, "material": "neo_hookean"}, "pins": PUSHED}
    effects["gravity"] = {"acceleration": [0, 0, -1e-3]}
    settings = {"solver": {"dt": 0.02, "threads": 1}, "run": {"duration": 0.2}}
    return clothsim.Scene(**{"cloth": sheet, "effects": effects, **settings, **keys})


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    return clothsim.simulate(pushed(), tmp_path_factory.mktemp("runs") / "coarse")


@pytest.fixture(scope="module")
def fine(coarse):
    return wrinkle(coarse, 2, coarse.directory.parent / "fine")


def test_the_finer_run_is_a_run_with_waves_and_a_certificate(coarse, fine):
    assert fine.status == "completed"
    assert fine.intersection_free is True
    np.testing.assert_array_equal(fine.times, coarse.times)
    assert len(fine.triangles) == 4 * len(coarse.triangles)
    assert abs(fine.positions(-1)[:, 2]).max() > 5 * abs(coarse.positions(-1)[:, 2]).max()
    along = fine.positions(-1)[:, 0] - coarse.positions(-1)[:, 0].min()
    assert along.max() == pytest.approx(np.ptp(coarse.positions(-1)[:, 0]), rel=1e-2)
    again = clothsim.open_run(fine.directory)
    assert again.field("compression", -1).shape == (len(fine.triangles),)


def test_pins_by_number_hold_what_lies_between_them(coarse, fine):
    pinned = fine.positions(-1)[fine.positions(0)[:, 0] > 0.45 - 1e-9]
    assert len(pinned) == 5
    np.testing.assert_allclose(pinned[:, 0], 0.45 - 0.1 * 0.2, atol=1e-9)
    np.testing.assert_allclose(pinned[:, 2], 0, atol=1e-9)


def test_figures_of_each_frame(coarse, fine):
    report = json.loads((fine.directory / WRINKLES_NAME).read_text())
    assert len(report["frames"]) == len(coarse)
    assert report["frames"][0]["curves"] == 0
    assert report["frames"][-1]["curves"] > 0
    assert report["frames"][-1]["height"] > 0
    assert 0.02 < report["frames"][-1]["compression"] < 0.3
    assert np.load(fine.directory / TARGETS_NAME).shape == (len(coarse), len(fine.positions(0)), 3)


def test_the_finer_cloth_has_the_area_and_fabric_of_the_coarse_one(coarse):
    world = build(coarse.scene).world
    scene = finer_scene(coarse, world, [subdivision(world.cloths[0].triangles, world.n_cloth, 3)])
    finer = build(scene).world
    assert finer.masses.sum() == pytest.approx(world.masses.sum(), rel=1e-12)
    assert finer.cloths[0].fabric == world.cloths[0].fabric
    assert set(scene.effects) == {"inertia", "membrane", "bending", "self_contact", "pins"}


@pytest.mark.parametrize("cells", ["1x", "100x", "4", "wide"])
def test_parts_out_of_range_are_refused(coarse, tmp_path, capsys, cells):
    assert main(["wrinkle", str(coarse.directory), "-o", str(tmp_path / "out"), "--cells", cells]) == 2
    assert "4x" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_earlier_run_is_replaced_with_overwrite_only(coarse, fine, capsys):
    words = ["wrinkle", str(coarse.directory), "-o", str(fine.directory)]
    assert main(words) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main([*words[:-1], str(coarse.directory), "--overwrite"]) == 2


def test_a_run_that_failed_or_intersects_is_refused(coarse, tmp_path):
    for summary in ({"status": "failed"}, {}, {"status": "completed", "certificate": {"intersection_free": False}}):
        with pytest.raises(InputError):
            wrinkle(replace(coarse, summary=summary), 2, tmp_path / "out")


def test_a_run_whose_files_are_gone_is_refused(tmp_path, capsys):
    mesh = tmp_path / "square.obj"
    mesh.write_text("v 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nf 1 2 3\nf 1 3 4\n")
    effects = {name: {} for name in ("inertia", "membrane", "self_contact")}
    scene = pushed(cloth={"mesh": str(mesh)}, effects=effects, run={"duration": 0.04})
    clothsim.simulate(scene, tmp_path / "run")
    mesh.unlink()
    assert main(["wrinkle", str(tmp_path / "run"), "-o", str(tmp_path / "out")]) == 2
    assert "square.obj" in capsys.readouterr().err
    assert main(["wrinkle", str(tmp_path / "none"), "-o", str(tmp_path / "out")]) == 2


def test_a_run_that_was_moved_goes_on_and_has_its_fields(coarse, tmp_path):
    fine = wrinkle(coarse, 2, tmp_path / "there" / "fine")
    strain = fine.field("compression", 5)
    moved = (tmp_path / "there").rename(tmp_path / "here") / "fine"
    np.testing.assert_array_equal(clothsim.open_run(moved).field("compression", 5), strain)
    again = clothsim.resume(moved)
    assert again.status == "completed"
    assert again.summary["steps"] == fine.summary["steps"]
    assert (moved / json.loads((moved / WRINKLES_NAME).read_text())["coarse"]).resolve() == coarse.directory.resolve()


def test_an_archive_has_the_targets_and_its_run_is_exported(fine, tmp_path):
    assert main(["bundle", str(fine.directory), "-o", str(tmp_path / "fine.zip")]) == 0
    assert main(["resume", str(tmp_path / "fine.zip"), "-o", str(tmp_path / "again")]) == 0
    again = clothsim.open_run(tmp_path / "again")
    targets = np.load(next((tmp_path / "again").rglob(TARGETS_NAME)))
    np.testing.assert_array_equal(targets, np.load(fine.directory / TARGETS_NAME))
    np.testing.assert_array_equal(again.positions(-1), fine.positions(-1).astype(again.positions(-1).dtype))
    assert main(["export", str(fine.directory), "-o", str(tmp_path / "last.obj"), "--frame", "last"]) == 0
    written = [line for line in (tmp_path / "last.obj").read_text().splitlines() if line.startswith("v ")]
    assert len(written) == len(fine.positions(-1))


def test_each_of_several_cloths_gets_its_own_wrinkles(tmp_path):
    sheet = {"mesh": "rectangle", "size": [0.9, 0.2], "cells": [9, 2], "diagonals": "right"}
    cloths = [{**sheet, "name": "low"}, {**sheet, "name": "high", "cells": [8, 2], "position": [0, 0, 0.3]}]
    pins = {"group": [PUSHED["group"][0], {"select": "right", "motion": {"velocity": [-0.1, 0, 0]}}]}
    effects = {**pushed().effects, "pins": pins}
    both = clothsim.simulate(pushed(cloth=cloths, effects=effects, run={"duration": 0.16}), tmp_path / "both")
    fine = wrinkle(both, 2, tmp_path / "fine")
    assert fine.intersection_free is True
    assert {name: len(rows) for name, rows in fine[-1].positions.items()} == {"low": 19 * 5, "high": 17 * 5}
    for rows in fine[-1].positions.values():
        assert np.ptp(rows[:, 2]) > 0.01


def test_a_run_of_rigid_bodies_alone_is_refused(tmp_path, capsys):
    ball = {"name": "ball", "mesh": "sphere", "radius": 0.1, "density": 500.0}
    scene = clothsim.Scene(rigid=[ball], effects={"inertia": {}, "gravity": {}}, run={"duration": 0.08})
    clothsim.simulate(scene, tmp_path / "run")
    assert main(["wrinkle", str(tmp_path / "run"), "-o", str(tmp_path / "out")]) == 2
    assert "no cloth" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
