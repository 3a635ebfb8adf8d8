"""Hostile recipes and folders of farms, and what is learned of them."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from tests.hostile.case import ANY, Case
from tests.hostile.stock import RECIPE, SHEET, farm, npz


def cases() -> Iterator[Case]:
    """All of them."""
    yield from _recipes()
    yield from _folders()


def _recipes() -> Iterator[Case]:
    def recipe(what: str, old: str, new: str, wanted: str = "refused", small: bool = False) -> Case:
        assert old in RECIPE, old
        files = {"sheet.toml": SHEET, "recipe.toml": RECIPE.replace(old, new)}
        return Case(f"recipe: {what}", "farm plan recipe.toml -o farm", wanted, files, small=small)

    draw = "{ uniform = [0.1, 0.3] }"
    yield recipe("as it is", draw, draw, "completed")
    yield recipe("cells = [4096, 4096]", "[vary]", "[set]\ncloth.cells = [4096, 4096]\n[vary]", small=True)
    yield recipe("10^9 drapes", "count = 2", "count = 1000000000")
    yield recipe("no drapes", "count = 2", "count = 0")
    yield recipe("-1 drapes", "count = 2", "count = -1")
    yield recipe("drapes of words", "count = 2", 'count = "all"')
    yield recipe("an interval upside down", draw, "{ uniform = [0.3, 0.1] }")
    yield recipe("an interval of nan", draw, "{ uniform = [nan, 1] }")
    yield recipe("an interval of inf", draw, "{ uniform = [0, inf] }")
    yield recipe("a deviation of 0", draw, "{ normal = [0.1, 0] }")
    yield recipe("no values", draw, "[]")
    yield recipe("one value for two drapes", draw, "[0.1]")
    yield recipe("values of words", draw, '["thick", "thin"]')
    yield recipe("values out of range", draw, "[-1.0, -2.0]")
    yield recipe("an unknown distribution", draw, "{ cauchy = [0, 1] }")
    yield recipe("an unknown key", "cloth.density", "cloth.densty")
    yield recipe("a key of no section", "cloth.density", "a.b.c.d")
    yield recipe("a key that is a path", "cloth.density", "../../thesis")
    yield recipe("a key as itself", draw, '"=cloth.density"')
    yield recipe("a scene that is not there", '"sheet.toml"', '"nothing.toml"')
    yield recipe("a scene that is the recipe", '"sheet.toml"', '"recipe.toml"')
    yield recipe("a scene of another folder", '"sheet.toml"', '"../outside/thesis.txt"')
    yield recipe("no scene", 'scene = "sheet.toml"\n', "")
    yield recipe("no TOML", "[farm]", "[farm")
    yield recipe("an unknown end", '"time"', '"never"')
    for what, content in {"empty": "", "binary": bytes(range(256))}.items():
        yield Case(f"recipe: {what}", "farm plan recipe.toml -o farm", "refused", {"recipe.toml": content})
    good = {"sheet.toml": SHEET, "recipe.toml": RECIPE}
    yield Case("recipe: over a file", "farm plan recipe.toml -o farm", "refused", {**good, "farm": "mine"})
    yield Case(
        "recipe: over a folder of others",
        "farm plan recipe.toml -o farm",
        "refused",
        {**good, "farm/jobs.jsonl": "mine"},
    )
    yield Case("sweep: nothing varies", "sweep sheet.toml", "refused", good)
    yield Case("sweep: values of words", "sweep sheet.toml --vary cloth.density=a,b", "refused", good)
    yield Case("sweep: a key that is none", "sweep sheet.toml --vary nothing=1,2", "refused", good)
    yield Case("sweep: two values", "sweep sheet.toml --vary cloth.density=.1,.2 -o s", "completed|found", good)


def farm_with(changes: Mapping[str, bytes | str | None]) -> dict[str, bytes | str | None]:
    """The farm with files changed, or left out where a change is None, and its folders."""
    files: dict[str, bytes | str | None] = {**farm(), **changes}
    folders = {f"farm/{name}": None for name in ("claims", "attempts", "tmp", "meshes", "drapes")}
    return {**folders, **{name: content for name, content in files.items() if content is not None}}


def _folders() -> Iterator[Case]:
    made = farm()
    lines = made["farm/jobs.jsonl"].decode().splitlines()
    climbing = json.dumps({**json.loads(lines[0]), "id": "../../outside"})
    drape = next(name.split("/")[2] for name in made if name.startswith("farm/drapes/"))
    undone = {name: None for name in made if name.startswith("farm/drapes/")}
    yield Case("farm: as it is, verified", "farm verify farm --fraction 0", "completed", farm_with({}))
    verified = ["farm verify farm --fraction 0"]
    yield Case("farm: as it is, packed", "farm pack farm -o data.h5", "completed", farm_with({}), before=verified)
    for what, changes in {
        "jobs.jsonl climbs out": {"farm/jobs.jsonl": climbing + "\n", **undone},
        "jobs.jsonl cut": {"farm/jobs.jsonl": lines[0][:40], **undone},
        "jobs.jsonl empty": {"farm/jobs.jsonl": "", **undone},
        "jobs.jsonl missing": {"farm/jobs.jsonl": None},
        "farm.json empty": {"farm/farm.json": ""},
        "farm.json a list": {"farm/farm.json": "[]"},
        "farm.json of other types": {
            "farm/farm.json": json.dumps(dict.fromkeys(json.loads(made["farm/farm.json"]), 3))
        },
        "farm.json deep": {"farm/farm.json": "[" * 100_000},
    }.items():
        for command in ("farm work farm", "farm status farm", "farm pack farm -o data.h5"):
            wanted = "refused" if what.startswith("farm.json") else ANY
            yield Case(f"farm: {what}, {command.split()[1]}", command, wanted, farm_with(changes), check=_thesis)
    cloth = next(name for name in made if name.startswith(f"farm/drapes/{drape}/cloth"))
    for what, changes in {
        "cloth.npy flipped": {cloth: made[cloth][:-1] + bytes([made[cloth][-1] ^ 1])},
        "cloth.npy empty": {cloth: b""},
        "cloth.npy pickled": {cloth: npz(a=np.array([{}], object))},
        "summary.json empty": {f"farm/drapes/{drape}/summary.json": b""},
        "params.json missing": {f"farm/drapes/{drape}/params.json": None},
        "a mesh empty": {name: b"" for name in made if name.startswith("farm/meshes/")},
    }.items():
        yield Case(f"farm: {what}, verify", "farm verify farm --fraction 0", "found|refused", farm_with(changes))
        yield Case(f"farm: {what}, pack", "farm pack farm -o data.h5", ANY, farm_with(changes), before=verified)
        yield Case(f"farm: {what}, learn", "learn farm -o m.npz", "refused|found", farm_with(changes), before=verified)
    for command in (
        "farm work nothing",
        "farm status sheet.toml",
        "farm verify .",
        "learn . -o m.npz",
        "preview . m.npz",
        "farm work farm --attempts 0",
        "farm work farm --stale -1s",
    ):
        yield Case(f"farm: {command}", command, "refused", farm_with({}))


def _thesis(folder: Path, text: str) -> str:
    return "" if (folder.parent / "outside/thesis.txt").read_text() == "all my work" else "the thesis is gone"
