"""Typical mistakes and what is answered to them: counted as good, fair and bad.

`python -m tests.cli.mistakes` prints the table; `mistakes.toml` is the list.
"""

import contextlib
import io
import json
import os
import shutil
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import clothsim
import clothsim.data
from clothsim import gradients
from clothsim.base.errors import ClothsimError
from clothsim.cli import main

LIST = Path(__file__).with_name("mistakes.toml")
RECIPE = '[farm]\nscene = "good.toml"\ncount = 2\nuntil = "time"\n[vary]\n"cloth.density" = { uniform = [0.1, 0.3] }\n'
BALL = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


@dataclass(frozen=True)
class Mistake:
    """A command line and the scene and other files that it meets, or a line of Python; what a good answer has.

    That is the exit code (of Python 2 for an error of the package, 1 for another one), what is wrong, what to do.
    """

    words: tuple[str, ...]
    scene: str
    code: int
    names: tuple[str, ...]
    remedy: tuple[str, ...]
    edited: str
    python: str = ""
    files: tuple[tuple[str, str], ...] = ()

    @property
    def label(self) -> str:
        """The command line, and what of the scene was changed; or the line of Python."""
        if self.python:
            return self.python
        made = self.edited or "".join(content for _, content in self.files)
        return " ".join(self.words) + (f"  with {made!r}" if made else "")


@dataclass(frozen=True)
class Answer:
    """What a command answered: exit code and text; `missing` of what a good answer has."""

    code: int
    text: str
    missing: tuple[str, ...]
    kind: str


def mistakes() -> list[Mistake]:
    """The list."""
    data = tomllib.loads(LIST.read_text(encoding="utf-8"))
    return [_mistake(entry, data["scene"]) for entry in (*data["mistake"], *data["python"])]


def _mistake(entry: dict, scene: str) -> Mistake:
    edits = entry.get("edit", [])
    for old, new in edits:
        assert old in scene, old
        scene = scene.replace(old, new, 1)
    words, names, remedy = (tuple(entry.get(key, ())) for key in ("words", "names", "remedy"))
    edited = edits[0][1] if edits else ""
    files = tuple(entry.get("files", {}).items())
    return Mistake(words, scene, entry.get("code", 2), names, remedy, edited, entry.get("line", ""), files)


def prepare(folder: Path) -> None:
    """Files that the command lines name: a mesh, a pattern, a recipe, and the directory `out` of a finished run."""
    (folder / "notes.txt").write_text("hello\n", encoding="utf-8")
    (folder / "recipe.toml").write_text(RECIPE, encoding="utf-8")
    (folder / "squares.json").write_text(json.dumps(_two_squares()), encoding="utf-8")
    np.savez(folder / "model.npz", a=np.zeros(3))
    (folder / "ball.obj").write_text(BALL, encoding="utf-8")
    scene = tomllib.loads(LIST.read_text(encoding="utf-8"))["scene"]
    (folder / "good.toml").write_text(scene, encoding="utf-8")
    code, text = answered(["run", "good.toml", "-o", "out", "--quiet", "--no-picture"], folder)
    assert code == 0, text


def _two_squares() -> dict[str, Any]:
    """A pattern of two squares of 40 cm."""
    edges = [{"endpoints": [k, (k + 1) % 4]} for k in range(4)]
    square = {"vertices": [[0, 0], [0, 40], [40, 40], [40, 0]], "edges": edges, "rotation": [0, 0, 0]}
    panels = {name: {**square, "translation": [0, 0, z]} for name, z in (("front", 20), ("back", -20))}
    stitches = [[{"panel": name, "edge": 0} for name in panels]]
    properties = {"units_in_meter": 100, "curvature_coords": "relative"}
    return {"pattern": {"panels": panels, "stitches": stitches}, "properties": properties}


def checked(mistake: Mistake, folder: Path) -> Answer:
    """Make the mistake in a prepared folder."""
    (folder / "scene.toml").write_text(mistake.scene, encoding="utf-8")
    shutil.rmtree(folder / "scene", ignore_errors=True)
    before = {path.name for path in folder.iterdir()}
    for name, content in mistake.files:
        (folder / name).write_text(content, encoding="utf-8")
    code, text = answered(mistake.python or mistake.words, folder)
    for path in folder.iterdir():  # what the next one must not meet
        if path.name not in before:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    flat = " ".join(text.split())
    missing = tuple(word for word in (*mistake.names, *mistake.remedy) if word not in flat)
    wrong = {"code": code != mistake.code, "names": any(word not in flat for word in mistake.names)}
    wrong["remedy"] = any(word not in flat for word in mistake.remedy)
    if not any(wrong.values()):
        kind = "good"
    else:
        kind = "bad" if wrong["code"] or wrong["names"] or "fault of clothsim" in flat else "fair"
    return Answer(code, text, missing, kind)


def answered(words: str | tuple[str, ...] | list[str], folder: Path) -> tuple[int, str]:
    """Exit code and text of a command, or of a line of Python, in a folder."""
    before, out = Path.cwd(), io.StringIO()
    os.chdir(folder)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            code = _of_python(words) if isinstance(words, str) else main(list(words))
    except SystemExit as end:
        code = int(end.code or 0)
    finally:
        os.chdir(before)
    return code, out.getvalue()


def _of_python(line: str) -> int:
    """2 for an error of the package, whose text is printed, 1 for another one, 0 for none."""
    try:
        print(eval(line, names_of_python()))
    except ClothsimError as error:
        print(error)
        return 2
    except Exception as error:
        print(f"{type(error).__name__}: {error}")
        return 1
    return 0


@cache
def names_of_python() -> dict[str, Any]:
    """What the lines of Python use: a sheet of 25 vertices, a function that makes a scene of it, and two runs."""
    x, y = 0.1 * np.indices((5, 5)).reshape(2, 25)
    points = np.stack([x, y, np.full(25, 0.4)], axis=1)
    corners = np.arange(20).reshape(4, 5)[:, :4].reshape(-1, 1)
    triangles = np.concatenate([corners + np.array(three) for three in ([0, 6, 1], [0, 5, 6])])
    usual = {
        "cloth": clothsim.Cloth(points, triangles),
        "effects": [clothsim.Inertia(), clothsim.Membrane(), clothsim.Gravity()],
        "run": clothsim.RunSettings(duration=0.02),
    }

    def scene(**sections: Any) -> clothsim.Scene:
        return clothsim.Scene(**{**usual, **sections})

    runs = {"run": clothsim.simulate(scene()), "kept": clothsim.simulate(scene(), differentiable=True)}
    return {
        "clothsim": clothsim,
        "np": np,
        "gradients": gradients,
        "points": points,
        "triangles": triangles,
        **runs,
        "scene": scene,
    }
