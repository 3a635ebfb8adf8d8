"""Pictures of the README, made anew, and before and after side by side: `python -m tests.benchmarks.readme_pictures`.

fit_shirt.png, dress_tunic.png and effects.png from runs of their own, gallery/shirt.png by `gallery`; then
readme_before_after.png: each picture as it is in BEFORE, a commit, and as it is now.
"""

import argparse
import io
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from PIL import Image, ImageDraw

from tests.benchmarks.gallery import PICTURES, ROOT, SCENES, draw_scene

DOCS = ROOT / "docs/pictures"
BEFORE = "d5507f0"
"""The commit of the first site, in which pictures showed triangles. Of the tunic: the first that is there."""
FIRST_TUNIC = "4c884cc"
EFFECTS = ("flag", "balloon", "tube", "crease")
WIDTH, GAP, TITLE = 640, 8, 26


def _clothsim(*words: str) -> None:
    subprocess.run([sys.executable, "-m", "clothsim", *words], check=True)


def fit_shirt(target: Path) -> None:
    """The shirt of the default mannequin, transferred to a larger one, and draped."""
    with tempfile.TemporaryDirectory() as folder:
        _clothsim("fit", "shirt", "--to", "shirt_large", "-o", f"{folder}/fit", "--quiet")
        (target).write_bytes(Path(folder, "fit/fit.png").read_bytes())


def dress_tunic(target: Path) -> None:
    """A tunic as placed, worn, and its stretch."""
    with tempfile.TemporaryDirectory() as folder:
        _clothsim("dress", "tunic", "--on", "shirt", "-o", f"{folder}/dress", "--quiet")
        parts = [Image.open(Path(folder, "dress", f"{name}.png")).convert("RGB") for name in ("placed", "worn")]
        beside(parts, 540).save(target, optimize=True)


def effects(target: Path) -> None:
    """Four scenes in a square."""
    with tempfile.TemporaryDirectory() as folder:
        tiles = []
        for name in EFFECTS:
            _clothsim("run", str(SCENES / f"{name}.toml"), "-o", f"{folder}/{name}", "--quiet", "--no-picture")
            _clothsim("render", f"{folder}/{name}", "-o", f"{folder}/{name}.png", "--size", "800x600", "--quiet")
            tiles.append(Image.open(f"{folder}/{name}.png").convert("RGB"))
        rows = [beside(tiles[:2], 600), beside(tiles[2:], 600)]
        below(rows).save(target, optimize=True)


def shirt(target: Path) -> None:
    """The first picture of the gallery."""
    draw_scene(SCENES / "shirt.toml", target)


MAKERS: Mapping[str, Callable[[Path], None]] = {
    str(Path(PICTURES).relative_to("docs/pictures") / "shirt.png"): shirt,
    "fit_shirt.png": fit_shirt,
    "dress_tunic.png": dress_tunic,
    "effects.png": effects,
}
"""The pictures of the README by their names under docs/pictures, but for the plot of a study."""


def beside(parts: Sequence[Image.Image], height: int) -> Image.Image:
    """Pictures in a row of one height."""
    scaled = [part.resize((round(part.width * height / part.height), height)) for part in parts]
    row = Image.new("RGB", (sum(part.width for part in scaled) + GAP * (len(scaled) - 1), height), "white")
    left = 0
    for part in scaled:
        row.paste(part, (left, 0))
        left += part.width + GAP
    return row


def below(rows: Sequence[Image.Image]) -> Image.Image:
    """Pictures below each other."""
    column = Image.new("RGB", (max(row.width for row in rows), sum(row.height + GAP for row in rows) - GAP), "white")
    top = 0
    for row in rows:
        column.paste(row, (0, top))
        top += row.height + GAP
    return column


def before(name: str) -> Image.Image:
    """A picture as it was."""
    commit = FIRST_TUNIC if name == "dress_tunic.png" else BEFORE
    stored = subprocess.run(
        ["git", "show", f"{commit}:docs/pictures/{name}"], cwd=ROOT, capture_output=True, check=True
    ).stdout
    return Image.open(io.BytesIO(stored)).convert("RGB")


def titled(picture: Image.Image, title: str) -> Image.Image:
    """A picture WIDTH wide under its title."""
    height = round(picture.height * WIDTH / picture.width)
    made = Image.new("RGB", (WIDTH, height + TITLE), "white")
    made.paste(picture.resize((WIDTH, height), Image.Resampling.LANCZOS), (0, TITLE))
    ImageDraw.Draw(made).text((4, 5), title, fill=(60, 60, 60), font_size=14)
    return made


def before_and_after(target: Path) -> None:
    """Every picture of MAKERS as it was, on the left, and as it is."""
    rows = []
    for name in MAKERS:
        pair = [titled(before(name), f"{name}, before"), titled(Image.open(DOCS / name).convert("RGB"), "now")]
        height = max(part.height for part in pair)
        row = Image.new("RGB", (2 * WIDTH + GAP, height), "white")
        for k, part in enumerate(pair):
            row.paste(part, (k * (WIDTH + GAP), 0))
        rows.append(row)
    below(rows).quantize(256, dither=Image.Dither.FLOYDSTEINBERG).save(target, optimize=True)


def main(argv: Sequence[str] | None = None) -> int:
    """Make the named pictures (all by default), then the one of both states."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.readme_pictures", description=__doc__)
    parser.add_argument("names", nargs="*", choices=[[], *MAKERS], help="default: all")
    parser.add_argument("--no-run", action="store_true", help="only before and after, of the pictures that are there")
    arguments = parser.parse_args(argv)
    for name, make in MAKERS.items():
        if not arguments.no_run and (not arguments.names or name in arguments.names):
            make(DOCS / name)
    before_and_after(DOCS / "readme_before_after.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
