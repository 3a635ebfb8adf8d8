"""Scene files in TOML."""

import tomllib
from pathlib import Path

from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.base.inputs import nearest
from clothsim.scene.example_files import scene_file
from clothsim.scene.scene import Scene, make_scene

MOST_BYTES = 1 << 28


def load_scene(path: str | Path) -> Scene:
    """The scene in a TOML file.

    Parameters
    ----------
    path : path
        The file, or where there is none the name of an example, as "sphere"; relative file names in it start at its own
        folder.

    Returns
    -------
    Scene

    Raises
    ------
    InputError
        Where the file is missing, is no TOML (with the line), or has an unknown key or a bad value.
    """
    file = scene_file(Path(path))
    if not file.exists():
        raise InputError(f"There is no scene file {file}.", _near(file))
    try:
        text = read_regular_file(file, MOST_BYTES).decode("utf-8-sig")  # editors of Windows begin with a mark
        data = tomllib.loads(text.replace("\r\n", "\n").replace("\r", "\n"))
    except UnicodeDecodeError as error:
        raise InputError(f"{file} cannot be read as a scene: {error}.", "Name a TOML file of text in UTF-8.") from error
    except (ValueError, RecursionError) as error:  # TOMLDecodeError, and a number of too many digits
        raise InputError(
            f"{file} is not a TOML file: {error}.",
            "Write key = value; texts in quotes, lists in brackets, as in toml.io.",
        ) from error
    return make_scene(data, file.parent)


def _near(file: Path) -> str:
    """Remedy for a missing file: the scenes of its folder."""
    try:
        names = sorted(path.name for path in file.parent.glob("*.toml"))
    except OSError:
        names = []
    if not names:
        return f"There is no scene in {file.parent}/: name a .toml file."
    return nearest(file.name, names) or f"{file.parent}/ has {', '.join(names[:5])}."
