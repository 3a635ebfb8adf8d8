"""Gallery of the shipped scenes: a picture of the last frame of each, the README's examples, the page of both.

`python -m tests.benchmarks.gallery [NAME ...] [--examples] [--page docs/start/gallery.md]`.
Runs the named scenes (all by default) to their end, writes docs/pictures/gallery/NAME.png, and lists every scene that
has a picture between the marks of the page. `--examples` runs those of EXAMPLES on their fine meshes instead, draws
them in the style "studio" as docs/pictures/examples/NAME.webp and writes the table of the README.
"""

import argparse
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from tests.benchmarks.stored_tables import markdown_table, write_between

ROOT = Path(__file__).parents[2]
SCENES = ROOT / "scenes"
PICTURES = Path("docs/pictures/gallery")
SIZE = "800x600"
EXAMPLE_PICTURES, EXAMPLE_SIZE, COLUMNS = Path("docs/pictures/examples"), "600x600", 4
QUALITY = 90
"""Of WebP: a tenth of the bytes of a PNG in true colour."""


@dataclass(frozen=True)
class Example:
    """A picture of the README.

    Parameters
    ----------
    name : str
        Of its output directory and picture.
    caption : str
        What is seen.
    command : str
        What makes the run, after `clothsim`, without its output directory.
    look : str
        Options of `clothsim render` beside style and size.
    """

    name: str
    caption: str
    command: str
    look: str = ""


EXAMPLES = (
    Example(
        "table",
        "A table cloth",
        "run table --set cloth.cells=[120,120] --set cloth.fabric=cotton",
        "--colour firebrick/linen",
    ),
    Example("fit", "A shirt on a larger figure", "fit shirt --to shirt_large", "--colour #3f5f8f/#eef0f4"),
    Example(
        "flag",
        "A flag in gusts",
        "run flag --set cloth.cells=[105,70] --set run.duration=0.28",
        "--colour firebrick --view=-0.6,-1,0.1 --frame 7",
    ),
    Example(
        "knit_denim",
        "A knit and a denim",
        "run knit_denim --set cloth.knit.cells=28 --set cloth.denim.cells=28",
        "--colour #c8963c,#35507c --view=-0.4,-1,0.35",
    ),
    Example("tunic", "Six panels, sewn and worn", "dress tunic --on shirt --size 15mm", "--colour #9c4a36"),
    Example(
        "spin",
        "A cloth that a ball takes along",
        "run spin --set cloth.cells=[80,80]",
        "--colour teal/linen",
    ),
    Example("balloon", "A foil balloon", "run balloon --set cloth.cells=48", "--colour #d4a017"),
    Example(
        "pleats",
        "A pleated skirt that turns",
        "run pleats --set cloth.size=0.018",
        "--colour #1f5a46/#2b3f66",
    ),
)


def description(scene: Path) -> str:
    """The comment at the head of a scene file, as one sentence or two."""
    lines = []
    for line in scene.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        lines.append(line[1:].strip())
    return " ".join(lines)


def draw_scene(scene: Path, target: Path) -> None:
    """Run a scene and write its last frame to `target`."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "clothsim"]
        subprocess.run([*command, "run", str(scene), "-o", folder, "--quiet"], check=True)
        target.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(
            [*command, "render", folder, "-o", str(target), "--size", SIZE, "--overwrite", "--quiet"], check=True
        )


def draw_example(example: Example, runs: Path, target: Path) -> None:
    """Make the run of an example in a folder of `runs`, unless it is there, and write its picture to `target`."""
    command, folder = [sys.executable, "-m", "clothsim"], runs / example.name
    if not folder.is_dir():
        subprocess.run([*command, *shlex.split(example.command), "-o", str(folder), "--quiet"], check=True)
    drawn = next(part for part in (folder / "drape", folder) if (part / "trajectory.vtkhdf").is_file())
    target.parent.mkdir(parents=True, exist_ok=True)
    look = ["--style", "studio", "--size", EXAMPLE_SIZE, *shlex.split(example.look)]
    with tempfile.TemporaryDirectory() as scratch:
        png = Path(scratch) / "example.png"
        subprocess.run([*command, "render", str(drawn), "-o", str(png), *look, "--quiet"], check=True)
        Image.open(png).save(target, quality=QUALITY, method=6)


def examples_text(examples: Sequence[Example]) -> str:
    """A table of pictures with their captions and the beginnings of their commands."""
    rows: list[list[str]] = []
    for first in range(0, len(examples), COLUMNS):
        part = examples[first : first + COLUMNS]
        rows.append([f"![{each.caption}]({EXAMPLE_PICTURES}/{each.name}.webp)" for each in part])
        rows.append([f"{each.caption}<br>`clothsim {each.command.split(' --set')[0]}`" for each in part])
    return markdown_table(rows[0], rows[1:])


def example_commands(examples: Sequence[Example]) -> str:
    """The commands of the examples, in a block."""
    lines = []
    for each in examples:
        lines.append(f"clothsim {each.command} -o {each.name}")
        look = shlex.join(["--style", "studio", "--size", EXAMPLE_SIZE, *shlex.split(each.look)])
        lines.append(f"clothsim render {each.name} -o {each.name}.png {look}")
    return "\n".join(["```sh", *lines, "```"])


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
    parser.add_argument("--examples", action="store_true", help="the README's pictures, by path tracing: an hour")
    parser.add_argument("--runs", type=Path, metavar="DIR", help="keep the runs of the examples here, and use them")
    arguments = parser.parse_args(argv)
    if arguments.examples:
        named = [each for each in EXAMPLES if not arguments.names or each.name in arguments.names]
        chosen = [] if arguments.no_run else named
        with tempfile.TemporaryDirectory() as scratch:
            for each in chosen:
                draw_example(each, arguments.runs or Path(scratch), ROOT / EXAMPLE_PICTURES / f"{each.name}.webp")
        write_between(ROOT / "README.md", "examples", examples_text(EXAMPLES))
        write_between(arguments.page, "examples", example_commands(EXAMPLES))
        return 0
    scenes = sorted(SCENES.glob("*.toml"))
    for scene in scenes:
        if not arguments.no_run and (not arguments.names or scene.stem in arguments.names):
            draw_scene(scene, ROOT / PICTURES / f"{scene.stem}.png")
    write_between(arguments.page, "gallery", gallery_text(scenes, PICTURES))
    return 0


if __name__ == "__main__":
    sys.exit(main())
