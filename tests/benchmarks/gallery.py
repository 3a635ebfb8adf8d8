"""Gallery of the shipped scenes: a picture of the last frame of each, and the page that shows them.

`python -m tests.benchmarks.gallery [NAME ...] [--page docs/start/gallery.md]`.
Runs the named scenes (all by default) to their end, writes docs/pictures/gallery/NAME.png, and lists every scene that
has a picture between the marks of the page.
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from PIL import Image

from tests.benchmarks.stored_tables import write_between

ROOT = Path(__file__).parents[2]
SCENES = ROOT / "scenes"
PICTURES = Path("docs/pictures/gallery")
SIZE = "640x480"
COLOURS = 256


def description(scene: Path) -> str:
    """The comment at the head of a scene file, as one sentence or two."""
    lines = []
    for line in scene.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        lines.append(line[1:].strip())
    return " ".join(lines)


def draw_scene(scene: Path, target: Path) -> None:
    """Run a scene and write its last frame, in few colours, to `target`."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "clothsim"]
        subprocess.run([*command, "run", str(scene), "-o", folder, "--quiet"], check=True)
        picture = Path(folder) / "small.png"
        subprocess.run([*command, "render", folder, "-o", str(picture), "--size", SIZE, "--quiet"], check=True)
        with Image.open(picture) as image:
            target.parent.mkdir(parents=True, exist_ok=True)
            in_few_colours(image.convert("RGB")).save(target, optimize=True)


def in_few_colours(image: Image.Image) -> Image.Image:
    """A picture in COLOURS colours, the rare ones of the scalar bar among them, without bands."""
    palette = image.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE)
    return image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG)


def gallery_text(scenes: Sequence[Path], pictures: Path) -> str:
    """A section per scene: its description, its command and, where there is one, its picture."""
    parts = []
    for scene in scenes:
        name = scene.stem
        parts += [f"### {name}", "", description(scene), "", "```sh", f"clothsim run {name} -o {name}", "```", ""]
        if (ROOT / pictures / f"{name}.png").is_file():
            parts += [f"![{description(scene).split('.')[0]}](../pictures/gallery/{name}.png)", ""]
    return "\n".join(parts)


def main(argv: Sequence[str] | None = None) -> int:
    """Draw the named scenes and write the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.gallery", description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="scenes to run (default: all)")
    parser.add_argument("--page", type=Path, default=ROOT / "docs/start/gallery.md", metavar="FILE")
    parser.add_argument("--no-run", action="store_true", help="write the page from the pictures that are there")
    arguments = parser.parse_args(argv)
    scenes = sorted(SCENES.glob("*.toml"))
    for scene in scenes:
        if not arguments.no_run and (not arguments.names or scene.stem in arguments.names):
            draw_scene(scene, ROOT / PICTURES / f"{scene.stem}.png")
    write_between(arguments.page, "gallery", gallery_text(scenes, PICTURES))
    return 0


if __name__ == "__main__":
    sys.exit(main())
