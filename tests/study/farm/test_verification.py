"""Verification: each change of what was published is seen, by `verify` and by all that read a farm."""

import hashlib
import json
import os
import shutil

import pytest
from small_scenes import small_scene

from clothsim import InputError
from clothsim.cli import main
from clothsim.study.farm.plan import open_farm, plan
from clothsim.study.farm.reading import CLOTH, HASHES, PARAMETERS, SUMMARY, read_drape
from clothsim.study.farm.recipe import make_recipe
from clothsim.study.farm.status import status
from clothsim.study.farm.verification import demand_verified, verify
from clothsim.study.farm.work import work


def recipe():
    scene = small_scene(run={"duration": 0.04, "frames_per_second": 25})
    vary = {"cloth.density": {"uniform": [0.1, 0.3]}}
    return make_recipe(scene, {"count": 3, "until": "time"}, {}, vary)


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """The folder of a farm that was made and verified."""
    farm = plan(recipe(), tmp_path_factory.mktemp("farm"))
    work(farm)
    assert verify(farm, fraction=0).good
    return farm.directory


@pytest.fixture
def farm(sound, tmp_path):
    """A copy of it."""
    return open_farm(shutil.copytree(sound, tmp_path / "farm"))


def flip(file, at=0.5):
    """Flip one bit of a file."""
    content = bytearray(file.read_bytes())
    content[int(at * len(content))] ^= 4
    file.write_bytes(content)


def rewrite(file, change):
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content, indent=1))


def mesh_of(farm, kind):
    (digest,) = read_drape(farm.directory, farm.jobs[1].id)[0]["meshes"][kind].values()
    return farm.directory / "meshes" / f"{digest}.npz"


def drape_of(farm, file=""):
    return farm.directory / "drapes" / farm.jobs[1].id / file


def cut(file):
    file.write_bytes(file.read_bytes()[:-4])


def linked(farm, file=""):
    """The same bytes, behind a link."""
    file = drape_of(farm, file)
    other = farm.directory.parent / f"outside-{file.name}"
    file.rename(other)
    file.symlink_to(other)


DAMAGES = {
    "flipped positions": lambda farm: flip(drape_of(farm, CLOTH), 0.9),
    "torn positions": lambda farm: cut(drape_of(farm, CLOTH)),
    "positions of zeros": lambda farm: drape_of(farm, CLOTH).write_bytes(bytes(428)),
    "missing positions": lambda farm: drape_of(farm, CLOTH).unlink(),
    "linked positions": lambda farm: linked(farm, CLOTH),
    "flipped mesh of a body": lambda farm: flip(mesh_of(farm, "body")),
    "flipped mesh of a cloth": lambda farm: flip(mesh_of(farm, "cloth")),
    "missing mesh": lambda farm: mesh_of(farm, "body").unlink(),
    "another mesh": lambda farm: shutil.copy(mesh_of(farm, "cloth"), mesh_of(farm, "body")),
    "certificate": lambda farm: rewrite(drape_of(farm, SUMMARY), lambda c: c["certificate"].update(at_rest=True)),
    "usable": lambda farm: rewrite(drape_of(farm, SUMMARY), lambda c: c.update(usable=False)),
    "parameters": lambda farm: rewrite(drape_of(farm, PARAMETERS), lambda c: c.update({"cloth.density": 0.2})),
    "cut summary": lambda farm: cut(drape_of(farm, SUMMARY)),
    "missing summary": lambda farm: drape_of(farm, SUMMARY).unlink(),
    "missing hashes": lambda farm: drape_of(farm, HASHES).unlink(),
    "cut hashes": lambda farm: cut(drape_of(farm, HASHES)),
    "files of another drape": lambda farm: shutil.copytree(
        farm.folder(farm.jobs[0].id), drape_of(farm), dirs_exist_ok=True
    ),
    "removed drape": lambda farm: shutil.rmtree(drape_of(farm)),
    "linked drape": linked,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_drape_is_named_and_nobody_reads_it(farm, damage, tmp_path, capsys):
    first = farm.jobs[0 if "mesh" in damage else 1].id  # all three have the same meshes
    where = str(farm.directory)
    DAMAGES[damage](farm)
    done = verify(farm, fraction=0)
    assert first in done.torn
    assert not done.good
    with pytest.raises(InputError, match=first):
        demand_verified(farm)
    assert main(["farm", "pack", where, "-o", str(tmp_path / "data.h5")]) == 2
    assert first in capsys.readouterr().err
    assert not (tmp_path / "data.h5").exists()
    assert main(["farm", "verify", where, "--fraction", "0"]) == 1
    assert main(["farm", "status", where]) == 0
    assert main(["farm", "work", where]) == 0


LINES = {
    "removed line": lambda lines: lines[:1] + lines[2:],
    "removed last line": lambda lines: lines[:-1],
    "cut line": lambda lines: [lines[0], lines[1][:40], lines[2]],
    "no text": lambda lines: [lines[0], b"\xff\x00", lines[2]],
    "changed value": lambda lines: [lines[0], lines[1].replace(b"0.", b"0.0"), lines[2]],
    "another order": lambda lines: [lines[1], lines[0], lines[2]],
}


@pytest.mark.parametrize("damage", LINES)
def test_a_changed_plan_is_seen_kills_no_worker_and_comes_back(farm, damage):
    where, file, left = str(farm.directory), farm.directory / "jobs.jsonl", farm.jobs[1].id
    shutil.rmtree(drape_of(farm))
    planned = file.read_bytes()
    file.write_bytes(b"\n".join(LINES[damage](planned.splitlines())) + b"\n")
    again = open_farm(farm.directory)
    assert again.plan_fault
    assert main(["farm", "work", where, "--quiet"]) == 2
    assert (left in again.published()) == (damage in ("removed last line", "another order"))
    assert main(["farm", "verify", where, "--fraction", "0"]) == 1
    with pytest.raises(InputError):
        demand_verified(again)
    plan(recipe(), farm.directory)
    assert file.read_bytes() == planned
    assert main(["farm", "work", where, "--quiet"]) == 0
    assert verify(open_farm(farm.directory), fraction=0).good
    demand_verified(open_farm(farm.directory))


def test_changed_settings_of_a_plan_are_refused(farm):
    file = farm.directory / "farm.json"
    for change in (lambda c: c.update(licence="CC0-1.0"), lambda c: c["scene"]["cloth"].update(density=1.0)):
        whole = file.read_bytes()
        rewrite(file, change)
        with pytest.raises(InputError):
            open_farm(farm.directory)
        file.unlink()
        plan(recipe(), farm.directory)
        assert file.read_bytes() == whole
    demand_verified(open_farm(farm.directory))


def test_a_farm_is_signed_off_as_it_is(farm, tmp_path):
    demand_verified(farm)
    (farm.directory / "verified.json").unlink()
    with pytest.raises(InputError):
        demand_verified(farm)
    shutil.rmtree(drape_of(farm))
    assert verify(farm, fraction=0).good  # nothing says that it was ever there
    work(farm)
    with pytest.raises(InputError, match=farm.jobs[1].id):
        demand_verified(farm)
    assert verify(farm, fraction=0).whole == 3
    demand_verified(farm)


def test_a_drape_of_another_verdict_is_made_again_differently(farm):
    file = drape_of(farm, SUMMARY)
    rewrite(file, lambda content: content.update(cause="not at rest", usable=False))
    rewrite(drape_of(farm, HASHES), lambda c: c.update({SUMMARY: hashlib.sha256(file.read_bytes()).hexdigest()}))
    done = verify(farm, fraction=1)
    assert (done.torn, done.different) == ({}, (farm.jobs[1].id,))
    assert not done.good
    with pytest.raises(InputError, match=farm.jobs[1].id):  # it was signed off before, as it was
        demand_verified(farm)


@pytest.mark.parametrize(
    ("folder", "kind"),
    [
        *((folder, kind) for folder in ("claims", "attempts", "drapes") for kind in ("link", "file link", "lost link")),
        *((folder, kind) for folder in ("claims", "attempts") for kind in ("folder", "bytes", "pipe")),
        ("drapes", "bytes"),
    ],
)
def test_what_lies_in_the_place_of_a_file_stops_no_worker(farm, tmp_path, folder, kind):
    shutil.rmtree(drape_of(farm))
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "thesis.txt").write_text("years")
    place = farm.directory / folder / farm.jobs[1].id
    place.unlink(missing_ok=True)
    if kind == "folder":
        (place / "mine").mkdir(parents=True)
    elif kind == "pipe":  # without a writer: who opens it waits for one without end
        os.mkfifo(place)
        os.utime(place, (1, 1))
    elif kind == "bytes":
        place.write_bytes(b"\xff\xfe{")
        os.utime(place, (1, 1))
    else:
        place.symlink_to({"link": outside, "file link": outside / "thesis.txt", "lost link": outside / "none"}[kind])
    assert work(farm, pause=0.01).usable == 1
    assert verify(farm, fraction=0).good
    assert [(entry.name, entry.read_text()) for entry in outside.iterdir()] == [("thesis.txt", "years")]


@pytest.mark.parametrize("name", ["drapes", "meshes", "claims", "attempts", "tmp", "farm.json", "jobs.jsonl"])
def test_a_farm_whose_parts_are_links_is_refused(farm, name, tmp_path):
    (farm.directory / name).rename(tmp_path / "elsewhere")
    (farm.directory / name).symlink_to(tmp_path / "elsewhere")
    assert main(["farm", "work", str(farm.directory)]) == 2


def test_status_counts_a_torn_drape(farm):
    cut(drape_of(farm, SUMMARY))
    assert status(farm).causes == {"torn": 1}


def test_a_stored_mesh_that_is_torn_is_stored_again(farm):
    flip(mesh_of(farm, "body"))
    assert len(verify(farm, fraction=0).torn) == 3
    shutil.rmtree(drape_of(farm))
    work(farm)
    assert verify(farm, fraction=0).good
