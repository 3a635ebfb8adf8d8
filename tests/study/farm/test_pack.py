"""Data sets of a farm, opened with the libraries that others use."""

import io
import json
import re
import tarfile

import h5py
import numpy as np
import pytest
from small_scenes import small_scene

from clothsim import InputError
from clothsim.cli import main
from clothsim.study.farm.pack import contact_page, contact_sheet, pack
from clothsim.study.farm.plan import plan
from clothsim.study.farm.recipe import make_recipe
from clothsim.study.farm.verification import verify
from clothsim.study.farm.work import work


@pytest.fixture(scope="module")
def farm(tmp_path_factory):
    """Four drapes of two topologies."""
    scene = small_scene(run={"duration": 0.04, "frames_per_second": 25})
    vary = {"cloth.cells": {"grid": [[4, 4], [3, 4]]}, "cloth.density": {"grid": [0.15, 0.2]}}
    made = plan(make_recipe(scene, {"until": "time", "licence": "CC0-1.0"}, {}, vary), tmp_path_factory.mktemp("farm"))
    work(made)
    verify(made, fraction=0)
    return made


def positions(farm, name):
    return np.load(farm.directory / "drapes" / name / "cloth.npy")


def test_hdf5(farm, tmp_path):
    done = pack(farm, tmp_path / "data.h5")
    assert (done.drapes, done.left_out) == (4, 0)
    with h5py.File(tmp_path / "data.h5") as file:
        assert file.attrs["licence"] == "CC0-1.0"
        rows = [json.loads(line) for line in file["manifest"].asstr()]
        assert [row["index"] for row in rows] == [0, 1, 2, 3]
        shapes = sorted(group["positions"].shape for group in file["garments"].values())
        assert shapes == [(2, 20, 3), (2, 25, 3)]
        for group in file["garments"].values():
            for k, name in enumerate(group["ids"].asstr()):
                assert np.array_equal(group["positions"][k], positions(farm, name))
                mesh = file["meshes"][json.loads(group["meshes"].asstr()[k])["cloth"]["cloth"]]
                assert mesh["triangles"][:].max() == len(mesh["rest"]) - 1 == group["positions"].shape[1] - 1
        assert len(file["meshes"]) == 3  # two sheets and a ball, once each
    assert len((tmp_path / "data.jsonl").read_text().splitlines()) == 4
    assert "CC0-1.0" in (tmp_path / "data.md").read_text()
    for name in ("data.h5", "data.hdf5"):
        with pytest.raises(InputError, match="exists"):
            pack(farm, tmp_path / name)
    assert pack(farm, tmp_path / "data.h5", overwrite=True).drapes == 4


@pytest.mark.parametrize("contact", [{}, None], ids=["contact", "no contact"])
def test_the_card_counts_drapes_that_end_inside_a_body(tmp_path, contact):
    """Without contact they were usable, under a card of "no piece inside a body"."""
    sheet = {"mesh": "rectangle", "cells": [4, 4], "size": [0.2, 0.2]}
    effects = {"inertia": {}, "membrane": {}, "gravity": {}} | ({} if contact is None else {"body_contact": contact})
    run = {"duration": 0.04, "frames_per_second": 25, "allow_inside": True}
    scene = small_scene(sheet, effects=effects, run=run)
    vary = {"cloth.position": {"grid": [[0, 0, 0], [0, 0, 0.4]]}}
    farm = plan(make_recipe(scene, {"until": "time"}, {}, vary), tmp_path / "farm")
    assert work(farm).usable == 1
    verify(farm, fraction=0)
    done = pack(farm, tmp_path / "data.h5")
    assert (done.drapes, done.left_out) == (1, 1)
    assert re.search(r"inside a body\W+1\b|\b1\W+inside a body", (tmp_path / "data.md").read_text())


@pytest.mark.parametrize("name", ["jobs.jsonl/data.h5", "drapes/data.h5", "meshes", "jobs.h5", "manifest.h5"])
def test_a_part_of_the_farm_is_never_replaced(farm, name, capsys):
    with pytest.raises(InputError, match="part of the farm"):
        pack(farm, farm.directory / name, overwrite=True)
    assert verify(farm, fraction=0).good
    for part in (next((farm.directory / "meshes").glob("*.npz")), farm.directory / "verified.json"):
        before = part.read_bytes()
        assert main(["learn", str(farm.directory), "-o", str(part), "--overwrite"]) == 2
        assert "part of the farm" in capsys.readouterr().err
        assert part.read_bytes() == before


def test_shards_are_plain_tar_and_the_same_bytes_twice(farm, tmp_path):
    for folder in ("one", "two"):
        pack(farm, tmp_path / folder, shard=3)
    names = []
    for shard in sorted((tmp_path / "one").glob("shard-*.tar")):
        assert shard.read_bytes() == (tmp_path / "two" / shard.name).read_bytes()
        with tarfile.open(shard) as archive:
            members = archive.getnames()
            names += members
            for member in members:
                content = archive.extractfile(member).read()
                name, _, kind = member.partition(".")
                if kind == "cloth.npy":
                    assert np.array_equal(np.load(io.BytesIO(content)), positions(farm, name))
                else:
                    json.loads(content)
    assert len(names) == 12
    assert [name.partition(".")[0] for name in names[::3]] == [job.id for job in farm.jobs]
    with tarfile.open(tmp_path / "one" / "meshes.tar") as archive:
        assert len(archive.getnames()) == 3


def test_shards_of_an_older_set_do_not_stay(farm, tmp_path):
    first = pack(farm, tmp_path / "set", shard=1)
    assert len(list((tmp_path / "set").glob("shard-*.tar"))) == 4
    (tmp_path / "set" / "shard-notes.txt").write_text("mine")
    for name in ("shard-000000.tar", "data.jsonl", "data.md", "data.parquet"):
        (tmp_path / "set" / name).unlink(missing_ok=True)
    with pytest.raises(InputError, match="exists"):  # readers would take the others for shards of this set
        pack(farm, tmp_path / "set", shard=3)
    again = pack(farm, tmp_path / "set", shard=3, overwrite=True)
    assert {file.name for file in (tmp_path / "set").glob("shard-*")} == {
        "shard-000000.tar",
        "shard-000001.tar",
        "shard-notes.txt",
    }
    assert all(file.exists() for file in again.files)
    assert first.drapes == again.drapes == 4


def test_the_manifest_in_parquet(farm, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    pack(farm, tmp_path / "data.h5")
    table = parquet.read_table(tmp_path / "data.parquet")
    assert table.num_rows == 4
    assert table.column("cloth.density").to_pylist() == [job.values["cloth.density"] for job in farm.jobs]


def test_contact_sheet_and_command(farm, tmp_path):
    from PIL import Image

    with Image.open(contact_sheet(farm, tmp_path / "sheet.png", samples=1)) as image:
        assert len(set(image.convert("L").crop((0, 44, 300, 384)).tobytes())) > 20
    assert main(["farm", "pack", str(farm.directory), "-o", str(tmp_path / "x.h5"), "--quiet"]) == 0
    assert (tmp_path / "x.h5").is_file()


def test_the_page_has_a_picture_of_each_sample_and_its_parameters(farm, tmp_path):
    page = contact_page(farm, tmp_path / "sheet.html", samples=2).read_text(encoding="utf-8")
    assert page.count("<figure") == page.count("data:image/png;base64,") == 2
    assert page.count("<td>cloth.density") == 2


def test_a_farm_without_a_usable_drape_is_refused(tmp_path):
    empty = plan(make_recipe(small_scene(cloth={"mesh": "nothing.obj"}), {"count": 1}, {}, {}), tmp_path / "farm")
    work(empty)
    verify(empty, fraction=0)
    with pytest.raises(InputError):
        pack(empty, tmp_path / "data.h5")
    assert contact_sheet(empty, tmp_path / "sheet.png").is_file()
    page = contact_page(empty, tmp_path / "sheet.html").read_text(encoding="utf-8")
    assert page.count('class="failed"') == 1
    assert "nothing.obj" in page
    assert "<img" not in page
