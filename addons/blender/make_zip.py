"""Zip of the Blender add-on: `python addons/blender/make_zip.py FILE.zip`."""

import sys
import zipfile
from pathlib import Path

FOLDER = Path(__file__).parent / "clothsim_blender"


def make_zip(target: Path) -> list[str]:
    """Write the zip; the names in it."""
    target.parent.mkdir(parents=True, exist_ok=True)
    files = sorted(file for file in FOLDER.iterdir() if file.suffix in (".py", ".toml"))
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as made:
        for file in files:
            made.write(file, f"{FOLDER.name}/{file.name}")
    return [f"{FOLDER.name}/{file.name}" for file in files]


if __name__ == "__main__":
    print(f"{sys.argv[1]}: {', '.join(make_zip(Path(sys.argv[1])))}")
