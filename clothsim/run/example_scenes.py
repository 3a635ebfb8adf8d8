"""The example scenes that are installed with the package."""

import difflib
import re
import sysconfig
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from clothsim.base.errors import InputError
from clothsim.run.archive_files import named_files
from clothsim.scene.toml_file import load_scene

INSTALLED = Path("share") / "clothsim" / "scenes"
"""Folder of the scenes of a wheel, from the root of an environment or of a target folder."""
MARK = "sphere.toml"
"""Marker file of the folder of scenes."""


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
    return [_described(file) for file in sorted(_folder().glob("*.toml"))]


def scene_file(path: Path) -> Path:
    """The scene file that a command names: an existing one, else the installed scene of that name.

    InputError for a name without an ending that no installed scene has, and for the ending of one that is installed.
    """
    refuse_ending_of_installed(path)
    if path.is_file() or path.suffix or len(path.parts) != 1:
        return path
    selected = installed_scene(path)
    if selected is not None:
        return selected
    names = [file.stem for file in _folder().glob("*.toml")]
    close = difflib.get_close_matches(path.name, names, n=1, cutoff=0.5)
    hint = f"Did you mean {close[0]!r}?" if close else "`clothsim scenes` lists those that are installed."
    raise InputError(f"There is no scene file {path} and no installed scene of that name.", hint)


def installed_scene(path: Path) -> Path | None:
    """The installed scene whose name is `path`; None where there is none."""
    if path.suffix or len(path.parts) != 1:
        return None
    return next((file for folder in _folders() if (file := folder / f"{path.name}.toml").is_file()), None)


def installed_pattern(path: Path) -> Path | None:
    """The installed sewing pattern whose name is `path`; None where there is none."""
    if path.suffix or len(path.parts) != 1:
        return None
    files = (folder / f"{path.name}_specification.json" for folder in _folders())
    return next((file for file in files if file.is_file()), None)


def refuse_ending_of_installed(path: Path) -> None:
    """InputError for a missing file `NAME.toml` where there is an installed scene of that name."""
    if path.suffix == ".toml" and not path.exists() and installed_scene(Path(path.stem)) is not None:
        raise InputError(
            f"There is no scene file {path}, but an installed scene of that name.", f"Leave its ending out: {path.stem}"
        )


def _folder() -> Path:
    """The folder of the scenes: of a clone, of a target folder, or of the environment."""
    for folder in _folders():
        if (folder / MARK).is_file():
            return folder
    raise InputError("The example scenes are not installed.", "Reinstall the wheel, or name a file of a clone.")


def _folders() -> Iterator[Path]:
    root = Path(__file__).resolve().parents[2]
    yield root / "scenes"
    yield root / INSTALLED
    yield Path(sysconfig.get_path("data")) / INSTALLED
    yield Path(sysconfig.get_path("data", sysconfig.get_preferred_scheme("user"))) / INSTALLED


def _described(file: Path) -> ExampleScene:
    scene = load_scene(file)
    missing = [name for name in named_files(scene) if not any(scene.directory.glob(name))]
    return ExampleScene(file.stem, file, headline(file.read_text(encoding="utf-8")), tuple(missing))


def headline(text: str) -> str:
    """The first clause of the comment at the start of a scene."""
    comment = re.match(r"(?:#.*\n?)*", text)
    words = " ".join(line.lstrip("# ") for line in (comment[0] if comment else "").splitlines())
    return re.split(r"[.:;](?= |$)", words, maxsplit=1)[0]
