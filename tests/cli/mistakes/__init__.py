"""Typical mistakes and what is answered to them: counted as good, fair and bad.

`python -m tests.cli.mistakes` prints the table; `mistakes.toml` is the list.
"""

import contextlib
import io
import os
import shutil
import tomllib
from dataclasses import dataclass
from pathlib import Path

from clothsim.cli import main

LIST = Path(__file__).with_name("mistakes.toml")
BALL = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


@dataclass(frozen=True)
class Mistake:
    """A command line and the scene that it meets; what a good answer has: exit code, what is wrong, what to do."""

    words: tuple[str, ...]
    scene: str
    code: int
    names: tuple[str, ...]
    remedy: tuple[str, ...]
    edited: str

    @property
    def label(self) -> str:
        """The command line, and what of the scene was changed."""
        return " ".join(self.words) + (f"  with {self.edited!r}" if self.edited else "")


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
    return [_mistake(entry, data["scene"]) for entry in data["mistake"]]


def _mistake(entry: dict, scene: str) -> Mistake:
    edits = entry.get("edit", [])
    for old, new in edits:
        assert old in scene, old
        scene = scene.replace(old, new, 1)
    words, names, remedy = (tuple(entry[key]) for key in ("words", "names", "remedy"))
    return Mistake(words, scene, entry.get("code", 2), names, remedy, edits[0][1] if edits else "")


def prepare(folder: Path) -> None:
    """Files that the command lines name: a mesh, and the directory `out` of a finished run."""
    (folder / "ball.obj").write_text(BALL, encoding="utf-8")
    scene = tomllib.loads(LIST.read_text(encoding="utf-8"))["scene"]
    (folder / "good.toml").write_text(scene, encoding="utf-8")
    code, text = answered(["run", "good.toml", "-o", "out", "--quiet", "--no-picture"], folder)
    assert code == 0, text


def checked(mistake: Mistake, folder: Path) -> Answer:
    """Make the mistake in a prepared folder."""
    (folder / "scene.toml").write_text(mistake.scene, encoding="utf-8")
    shutil.rmtree(folder / "scene", ignore_errors=True)
    code, text = answered(mistake.words, folder)
    flat = " ".join(text.split())
    missing = tuple(word for word in (*mistake.names, *mistake.remedy) if word not in flat)
    wrong = {"code": code != mistake.code, "names": any(word not in flat for word in mistake.names)}
    wrong["remedy"] = any(word not in flat for word in mistake.remedy)
    if not any(wrong.values()):
        kind = "good"
    else:
        kind = "bad" if wrong["code"] or wrong["names"] or "fault of clothsim" in flat else "fair"
    return Answer(code, text, missing, kind)


def answered(words: tuple[str, ...] | list[str], folder: Path) -> tuple[int, str]:
    """Exit code and text of a command in a folder."""
    before, out = Path.cwd(), io.StringIO()
    os.chdir(folder)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            code = main(list(words))
    except SystemExit as end:
        code = int(end.code or 0)
    finally:
        os.chdir(before)
    return code, out.getvalue()
