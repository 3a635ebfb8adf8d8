"""The example scenes that are installed with the package."""

import re
from dataclasses import dataclass
from pathlib import Path

from clothsim.run.archive_files import named_files
from clothsim.scene.example_files import scenes_folder
from clothsim.scene.toml_file import load_scene


@dataclass(frozen=True)
class ExampleScene:
    """A scene that `clothsim run NAME` simulates.

    headline: the start of its first comment; missing: the files that it names and that are not installed.
    """

    name: str
    file: Path
    headline: str
    missing: tuple[str, ...]


def example_scenes() -> list[ExampleScene]:
    """All installed scenes by name."""
    return [_described(file) for file in sorted(scenes_folder().glob("*.toml"))]


def _described(file: Path) -> ExampleScene:
    scene = load_scene(file)
    missing = [name for name in named_files(scene) if not any(scene.directory.glob(name))]
    return ExampleScene(file.stem, file, headline(file.read_text(encoding="utf-8")), tuple(missing))


def headline(text: str) -> str:
    """The first clause of the comment at the start of a scene."""
    comment = re.match(r"(?:#.*\n?)*", text)
    words = " ".join(line.lstrip("# ") for line in (comment[0] if comment else "").splitlines())
    return re.split(r"[.:;](?= |$)", words, maxsplit=1)[0]
