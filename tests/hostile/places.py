"""Hostile places: outputs that are links, pipes or parts of what is read, inputs that are pipes, names of paths."""

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.hostile.case import Case
from tests.hostile.farms import farm_with
from tests.hostile.oracle import run_is_right
from tests.hostile.stock import RECIPE, SHEET, changed, farm, npz, run

THESIS = "../outside/thesis.txt"
OUTPUTS = {
    "a.glb": "export run -o a.glb",
    "a.obj": "export run -o a.obj --frame 1",
    "a.ply": "export run -o a.ply --frame 1",
    "a.pc2": "export run -o a.pc2",
    "a.vtkhdf": "export run -o a.vtkhdf",
    "a.png": "render run -o a.png --size 64x64",
    "a.gif": "render run -o a.gif --size 64x64",
    "b.zip": "bundle run -o b.zip",
    "g.npz": "gradient sheet.toml --loss height --wrt start -o g.npz",
    "me.obj": "body -o me.obj",
}
INSIDE = changed(
    "[0.0, 0.0, 0.31]", "[0.0, 0.0, 0.0]", changed("cells = [4, 4]", "cells = [4, 4]\nsize = [0.05, 0.05]")
)
BOX = "".join(f"v {x} {y} {z}\n" for x in (0, 40) for y in (0, 170) for z in (0, 30))
FACES = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"


def cases() -> Iterator[Case]:
    """All of them."""
    yield from _links()
    yield from _own_parts()
    yield from _pipes()
    yield from _names()
    yield from _words_of_a_certificate()


def _with(place: str, make: Callable[[Path], None]) -> Callable[[Path], None]:
    """The run, with something in a place."""

    def made(folder: Path) -> None:
        Case("", "", "", run()).make(folder)
        path = folder / place
        path.parent.mkdir(exist_ok=True)
        path.unlink(missing_ok=True)
        make(path)

    return made


def _links() -> Iterator[Case]:
    """Outputs that are links to a file of others, there or not yet: nothing outside is written."""
    for name, command in OUTPUTS.items():
        for what, target in (("thesis.txt", THESIS), ("no file", "../outside/new.txt")):
            link = _with(name, lambda path, target=target: path.symlink_to(target))
            yield Case(
                f"link: to {what}, {command.split()[0]} {name}", f"{command} --overwrite", "completed|refused", link
            )


def _own_parts() -> Iterator[Case]:
    """Outputs that are a part of what is read."""
    made = farm_with({})
    mesh = next(name for name in made if name.startswith("farm/meshes/"))
    seeded = SHEET + '[seed]\nfrom = "model"\nfile = "m.npz"\n'
    for words, files in (
        ("export run -o run/trajectory.vtkhdf", dict(run())),
        ("farm pack farm -o farm/jobs.h5", made),
        ("farm pack farm -o farm/drapes", made),
        (f"learn farm -o {mesh}", made),
        ("gradient a.toml --loss height --wrt start -o m.npz", {"a.toml": seeded, "m.npz": npz()}),
    ):
        name = words.replace(mesh, "farm/meshes/HASH.npz")
        yield Case(f"part: {name}", f"{words} --overwrite", "refused", files)


def _pipes() -> Iterator[Case]:
    """Files of runs and farms that are pipes without a writer, or a terabyte of nothing."""

    def sparse(path: Path) -> None:
        with path.open("wb") as file:
            file.truncate(1 << 40)

    for what, make in (("a pipe", os.mkfifo), ("a terabyte", sparse)):
        for name in ("checkpoint.npz", "record.jsonl", "summary.json", "trajectory.vtkhdf"):
            for command in ("check run", "resume run --no-picture"):
                case = f"pipe: {name} is {what}, {command.split()[0]}"
                yield Case(case, command, "refused|found|completed", _with(f"run/{name}", make))
        for name in ("farm.json", "jobs.jsonl", "manifest.jsonl", "verified.json"):

            def place(folder: Path, name: str = name, make: Callable[[Path], None] = make) -> None:
                Case("", "", "", farm_with({})).make(folder)
                (folder / "farm" / name).unlink(missing_ok=True)
                make(folder / "farm" / name)

            for action in ("status farm", "pack farm -o d.h5"):
                yield Case(
                    f"pipe: {name} is {what}, {action.split()[0]}", f"farm {action}", "refused|found|completed", place
                )
    yield Case(
        "pipe: an output that is one", "export run -o a.glb --overwrite", "refused|completed", _with("a.glb", os.mkfifo)
    )
    for place in ("claims", "attempts"):

        def left(folder: Path, place: str = place) -> None:
            files = {name: None if name.startswith("farm/drapes/") else content for name, content in farm().items()}
            Case("", "", "", farm_with(files)).make(folder)
            job = json.loads((folder / "farm/jobs.jsonl").read_text().splitlines()[0])["id"]
            (folder / "farm" / place / job).unlink(missing_ok=True)
            os.mkfifo(folder / "farm" / place / job)
            os.utime(folder / "farm" / place / job, (1, 1))

        yield Case(f"pipe: in {place}, work", "farm work farm", "completed", left)
    yield Case("pipe: a scene that is one", "run a.toml -o out", "refused", lambda folder: os.mkfifo(folder / "a.toml"))


def _names() -> Iterator[Case]:
    """Names of things that are paths."""
    for name in ("../../outside/new", "/tmp/new", "..", ".", "a/b", "con", " ", "-o", "a" * 300):
        text = changed("cells = [4, 4]", f'cells = [4, 4]\nname = "{name}"')
        for ending in ("obj", "pc2"):
            yield Case(
                f"path: a cloth called {name[:20]!r}, {ending}",
                f"export out -o e.{ending}",
                "refused|completed",
                {"a.toml": text},
                before=["run a.toml -o out --no-picture"],
            )


def _words_of_a_certificate() -> Iterator[Case]:
    """Cloth inside a body and bodies in centimetres are named."""
    allowed = changed("[run]", "[run]\nallow_inside = true", INSIDE)
    without = changed("[effects.body_contact]\n", "", INSIDE)
    runs = "run a.toml -o out --no-picture"
    yield Case("inside: with contact", runs, "warned", {"a.toml": allowed}, "INSIDE ball", run_is_right())
    yield Case("inside: without contact", runs, "warned", {"a.toml": without}, "INSIDE ball")
    yield Case("inside: the check of the run", "check out", "warned", {"a.toml": allowed}, "inside ball", before=[runs])
    recipe = {"sheet.toml": without, "recipe.toml": RECIPE}
    yield Case("inside: a farm without contact", "farm plan recipe.toml -o farm", "refused", recipe, "inside a body")
    yield Case("inside: a body in centimetres", "check b.obj", "warned", {"b.obj": BOX + FACES}, "scale = 0.01")
