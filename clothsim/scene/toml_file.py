"""Scene files in TOML, and those that come with the package: example scenes and the sewing patterns that they dress."""

import difflib
import os
import re
import sysconfig
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.base.inputs import did_you_mean, nearest_or_known
from clothsim.scene.scene import Scene, make_scene

INSTALLED = Path("share") / "clothsim" / "scenes"
"""Folder of the scenes of a wheel, from the root of an environment or of a target folder."""
MARK = "sphere.toml"
"""Marker file of the folder of scenes."""
PATTERN = "_specification.json"
"""Ending of the sewing patterns."""


def scene_file(path: Path) -> Path:
    """The scene file that a command names: an existing one, else the installed scene of that name.

    InputError for a name without an ending that no installed scene has, and for the ending of one that is installed.
    """
    refuse_ending_of_installed(path)
    if os.path.isfile(path) or path.suffix or len(path.parts) != 1:
        return path
    selected = installed(path)
    if selected is not None:
        return selected
    _refuse_directory(path)
    raise InputError(f"There is no scene file {path} and no installed scene of that name.", _near(path))


def example_file(path: Any, ending: str = ".toml", what: str = "") -> Any:
    """The installed file that `path` names where there is no file of that name, else `path`.

    ending: ".toml" of the scenes, PATTERN of the sewing patterns. InputError for the name of a scene with its ending.

    what: what the file must be, for the remedy. With it a directory, such as an earlier run of that name, is not a
    file, and InputError if there is none, with the nearest installed name; what is neither text nor a path is returned.
    """
    if what and not isinstance(path, str | Path):
        return path
    file = Path(path)
    refuse_ending_of_installed(file)
    there = os.path.exists(file)  # False for a name that no file can have, where Path.exists raises
    if there and not (what and file.is_dir()):
        return file
    found = installed(file, ending)
    if found is None and what and not there:
        names = [each.name.removesuffix(ending) for folder in folders() for each in folder.glob(f"*{ending}")]
        near = did_you_mean(file.name, names, CLOSE) if len(file.parts) == 1 and not file.suffix else ""
        scene = f"{path} is a scene: `clothsim run {path}`, or `fit` for another body. " if installed(file) else ""
        raise InputError(f"There is no file {path}.", f"{scene}{near or f'Name {what}.'}")
    return found or file


def installed(path: Path, ending: str = ".toml") -> Path | None:
    """The installed file whose name without its ending is `path`; None if there is none."""
    if path.suffix or len(path.parts) != 1:
        return None
    return next((file for folder in folders() if os.path.isfile(file := folder / f"{path.name}{ending}")), None)


def refuse_ending_of_installed(path: Path) -> None:
    """InputError for a missing file `NAME.toml` where there is an installed scene of that name."""
    if path.suffix == ".toml" and not os.path.exists(path) and installed(Path(path.stem)) is not None:
        raise InputError(
            f"There is no scene file {path}, but an installed scene of that name.",
            f"Write it without the ending: {path.stem}",
        )


def scenes_folder() -> Path:
    """The folder of the scenes: of a clone, of a target folder, or of the environment."""
    for folder in folders():
        if (folder / MARK).is_file():
            return folder
    raise InputError("The example scenes are not installed.", "Reinstall the wheel, or name a file of a clone.")


def folders() -> Iterator[Path]:
    """Where installed files may be."""
    root = Path(__file__).resolve().parents[2]
    yield root / "scenes"
    yield root / INSTALLED
    yield Path(sysconfig.get_path("data")) / INSTALLED
    yield Path(sysconfig.get_path("data", sysconfig.get_preferred_scheme("user"))) / INSTALLED


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


def examples() -> dict[str, str]:
    """Names of the example scenes, which `load_scene` accepts, and what each shows.

    Examples
    --------
    >>> import clothsim
    >>> clothsim.examples()["sphere"]
    'A square metre of cotton falls on a ball'

    Raises
    ------
    InputError
        For an unknown name, by ``examples()[name]``.
    """
    files = sorted(scenes_folder().glob("*.toml"))
    return _Examples((file.stem, first_comment(file.read_text(encoding="utf-8"))) for file in files)


class _Examples(dict[str, str]):
    def __missing__(self, name: str) -> str:
        raise InputError(f"There is no example scene {name!r}.", nearest_or_known("", str(name), list(self)))


def _described(file: Path) -> ExampleScene:
    scene = load_scene(file)
    missing = [name for name in scene.file_names if not any(scene.directory.glob(name))]
    return ExampleScene(file.stem, file, first_comment(file.read_text(encoding="utf-8")), tuple(missing))


def first_comment(text: str) -> str:
    """The first clause of the comment at the start of a scene."""
    comment = re.match(r"(?:#.*\n?)*", text)
    words = " ".join(line.lstrip("# ") for line in (comment[0] if comment else "").splitlines())
    return re.split(r"[.:;](?= |$)", words, maxsplit=1)[0]


MOST_BYTES = 1 << 28
CLOSE = 0.7
"""Similarity, 0 to 1, from which on one name is asked about in place of another."""


def load_scene(path: str | Path) -> Scene:
    """The scene in a TOML file.

    Parameters
    ----------
    path : path
        The file or, if there is no such file, the name of an example, such as "sphere". File names in it start at its
        folder.

    Returns
    -------
    Scene

    Raises
    ------
    InputError
        If the file is missing, is not a TOML file (with the line), or has an unknown key or a bad value.
    """
    if not isinstance(path, str | Path):
        kind = type(path).__name__
        raise InputError(
            f"The name of a scene file is text, not a {kind}.", "From a table make clothsim.Scene(**table)."
        )
    file = scene_file(Path(path))
    if not os.path.exists(file):
        raise InputError(f"There is no scene file {file}.", _near(file))
    _refuse_directory(file)
    try:
        text = read_regular_file(file, MOST_BYTES).decode("utf-8-sig")  # editors of Windows begin with a mark
        data = tomllib.loads(text.replace("\r\n", "\n").replace("\r", "\n"))
    except UnicodeDecodeError as error:
        raise InputError(f"{file} cannot be read as a scene: {error}.", "Name a TOML file of text in UTF-8.") from error
    except (ValueError, RecursionError) as error:  # TOMLDecodeError, and a number of too many digits
        raise InputError(
            f"{file} is not a TOML file: {error}.",
            _toml_remedy(str(error), text) if file.suffix.lower() == ".toml" else NO_SCENE,
        ) from error
    return make_scene(data, file.parent)


def _refuse_directory(path: Path) -> None:
    if os.path.isdir(path):
        how = "Name the scene (.toml) of the run; `clothsim resume DIR` continues it, `clothsim view DIR` shows it."
        raise InputError(f"{path} is a directory, not a scene file.", how)


NO_SCENE = "Name a scene (.toml); `clothsim check FILE` examines a mesh or a pattern."


def _toml_remedy(message: str, text: str) -> str:
    """What to write in place of what the parser of TOML does not take."""
    number = re.search(r"line (\d+)", message)
    line = text.splitlines()[int(number[1]) - 1 : int(number[1])] if number else []
    if any("\\" in each for each in line):
        return "A \\ in double quotes begins a special character: write paths with / or in single quotes."
    if any(each.lstrip().startswith("//") for each in line):
        return "A comment begins with #."
    if any(re.search(r"=\s*(True|False|TRUE|FALSE)\b", each) for each in line):
        return "Write true and false in small letters."
    if "twice" in message or "overwrite" in message:
        return "Write each section once; of several cloths or bodies each as [[cloth]], [[body]]."
    return "Write key = value; texts in quotes, lists in brackets with commas (see toml.io)."


def _near(file: Path) -> str:
    """Remedy for a missing file: a scene of its folder, or an installed one, of nearly that name."""
    try:
        beside = {path.stem: path.name for path in file.parent.glob("*.toml")}
    except OSError:
        beside = {}
    names = {each.stem: each.stem for folder in folders() for each in folder.glob("*.toml")} | beside
    close = difflib.get_close_matches(file.stem, names, n=1, cutoff=CLOSE)
    return f"Did you mean {names[close[0]]!r}?" if close else "Name a .toml file; `clothsim scenes` lists the examples."
