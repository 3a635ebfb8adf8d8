"""Scene files."""

import tomllib
from pathlib import Path

from clothsim.errors import InputError
from clothsim.scene.scene import Scene, make_scene


def load_scene(path: str | Path) -> Scene:
    """The scene in a TOML file; its relative file names start at the file's own folder.

    InputError, one sentence, where the file is missing, is no TOML (with the line) or has an unknown key.
    """
    file = Path(path)
    try:
        data = tomllib.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"There is no scene file {file}.") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file} cannot be read as a scene: {error}.") from error
    except (ValueError, RecursionError) as error:  # TOMLDecodeError, and a number of too many digits
        raise InputError(f"{file} is not a TOML file: {error}.") from error
    return make_scene(data, file.parent)
