"""Files that come with the package: example scenes, and the sewing patterns that they dress."""

import difflib
import sysconfig
from collections.abc import Iterator
from pathlib import Path

from clothsim.base.errors import InputError

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
    if path.is_file() or path.suffix or len(path.parts) != 1:
        return path
    selected = installed(path)
    if selected is not None:
        return selected
    names = [file.stem for folder in folders() for file in folder.glob("*.toml")]
    close = difflib.get_close_matches(path.name, names, n=1, cutoff=0.5)
    hint = f"Did you mean {close[0]!r}?" if close else "`clothsim scenes` lists those that are installed."
    raise InputError(f"There is no scene file {path} and no installed scene of that name.", hint)


def example_file(path: Path, ending: str = ".toml") -> Path:
    """The installed file that `path` names where there is no file of that name, else `path`.

    ending: ".toml" of the scenes, PATTERN of the sewing patterns. InputError for the name of a scene with its ending.
    """
    refuse_ending_of_installed(path)
    return path if path.exists() else installed(path, ending) or path


def installed(path: Path, ending: str = ".toml") -> Path | None:
    """The installed file whose name without its ending is `path`; None where there is none."""
    if path.suffix or len(path.parts) != 1:
        return None
    return next((file for folder in folders() if (file := folder / f"{path.name}{ending}").is_file()), None)


def refuse_ending_of_installed(path: Path) -> None:
    """InputError for a missing file `NAME.toml` where there is an installed scene of that name."""
    if path.suffix == ".toml" and not path.exists() and installed(Path(path.stem)) is not None:
        raise InputError(
            f"There is no scene file {path}, but an installed scene of that name.", f"Leave its ending out: {path.stem}"
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
