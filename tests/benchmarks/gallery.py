"""Gallery of the shipped scenes: a picture of the last frame of each, the README's examples, the page of both.

`python -m tests.benchmarks.gallery [NAME ...] [--examples] [--page docs/start/gallery.md]`.
Runs the named scenes (all by default) to their end, draws them in the style "studio" with the options of LOOKS, as
docs/pictures/gallery/NAME.webp, and lists every scene between the marks of the page, with the picture of the example
of its name where there is one. `--examples` runs those of EXAMPLES on their fine meshes instead, draws them as
docs/pictures/examples/NAME.webp and writes the table of the README and the cards of the home page.
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
SIZE = "480x480"
EXAMPLE_PICTURES, EXAMPLE_SIZE, COLUMNS = Path("docs/pictures/examples"), "600x600", 4
QUALITY = 90
"""Of WebP: a tenth of the bytes of a PNG in true colour."""


LOOKS = {
    "cape": "--colour #6b1f2a",
    "cards": "--size 480x480 --colour firebrick/linen",
    "crease": "--size 480x360 --colour #8fb0c9",
    "funnel": "--size 480x360 --colour #3f5f8f/#eef0f4",
    "hanging": "--colour #3f5f8f/#eef0f4",
    "hoody": "--colour #5b6f4a",
    "impact": "--size 480x360 --view=1,0.4,0.4 --colour #9c4a36",
    "jacket": "--colour #6a3d2f",
    "knot": "--size 480x300 --view=-0.2,-0.75,1 --colour #b8503f",
    "needles": "--size 480x360 --view=-0.5,-1,0.25 --colour #3f5f8f",
    "shirt": "--colour firebrick",
    "shirt_large": "--colour #3f5f8f/#eef0f4",
    "skirt": "--colour #2f4a6d",
    "sphere": "--colour #9c4a36",
    "stack": "--size 480x360 --colour #c8963c",
    "study_cantilever": "--size 480x360 --view=-0.3,-1,0.15 --colour teal",
    "study_over": "--size 480x360 --colour teal",
    "study_strip": "--size 360x480 --colour teal",
    "tablecloth": "--size 480x360 --colour firebrick/linen",
    "tube": "--size 480x360 --colour #35507c",
    "twist": "--size 480x360 --colour #9c4a36",
}
"""Options of `clothsim render` beside style and size, by scene; the last --size counts."""


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
        "run table --set cloth.cells=[100,100] --set cloth.fabric=cotton",
        "--colour #b03a2e/linen --view=-0.7,-1,0.55",
    ),
    Example("fit", "A shirt on a larger figure", "fit shirt --to shirt_large", "--colour #3f5f8f"),
    Example(
        "flag",
        "A flag in gusts",
        "run flag --set cloth.cells=[54,36] --set effects.air.wind.period=0.07 --set run.duration=1.16",
        "--colour #8f2a24 --view=0.9,-1,0.4",
    ),
    Example(
        "knit_denim",
        "A T-shirt knit beside denim",
        "run knit_denim --set cloth.knit.cells=34 --set cloth.denim.cells=34",
        "--colour #c8963c,#35507c --view=-0.4,-1,0.35",
    ),
    Example(
        "tunic",
        "A tunic sewn from six panels",
        "dress tunic --on shirt --size 15mm",
        "--colour #9c4a36 --view=0.45,-1,0.15",
    ),
    Example(
        "spin",
        "A turning ball drags a cloth round",
        "run spin --set cloth.cells=[80,80] --set run.duration=0.8",
        "--colour teal/linen",
    ),
    Example("balloon", "A foil balloon", "run balloon --set cloth.cells=32", "--colour #d4a017"),
    Example(
        "pleats",
        "A pleated skirt that turns",
        "run pleats --set cloth.size=0.018",
        "--colour #4f7f6d --view=-0.35,-1,0.4",
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


def draw(example: Example, size: str, runs: Path, target: Path) -> None:
    """Make the run of a picture in a folder of `runs`, unless it is there, and write its last frame to `target`."""
    command, folder = [sys.executable, "-m", "clothsim"], runs / example.name
    if not folder.is_dir():
        made = ["--quiet", "--no-picture"] if example.command.startswith("run ") else ["--quiet"]
        subprocess.run([*command, *shlex.split(example.command), "-o", str(folder), *made], check=True)
    drawn = next(part for part in (folder / "drape", folder) if (part / "trajectory.vtkhdf").is_file())
    target.parent.mkdir(parents=True, exist_ok=True)
    look = ["--style", "studio", "--size", size, *shlex.split(example.look)]
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
        rows.append([f"{each.caption}<br>`{begun(each)}`" for each in part])
    return markdown_table(rows[0], rows[1:])


def example_cards(examples: Sequence[Example]) -> str:
    """The same pictures as cards of the site's home page, which stand below one another on a phone."""
    folder = EXAMPLE_PICTURES.relative_to("docs")
    cards = [f"- ![{e.caption}]({folder}/{e.name}.webp)\n\n    {e.caption}\n\n    `{begun(e)}`" for e in examples]
    return "\n\n".join(['<div class="grid cards" markdown>', *cards, "</div>"])


def begun(example: Example) -> str:
    """The command of an example without its settings."""
    return f"clothsim {example.command.split(' --set')[0]}"


def example_commands(examples: Sequence[Example]) -> str:
    """The commands of the examples, in a block."""
    lines = []
    for each in examples:
        lines.append(f"clothsim {each.command} -o {each.name}")
        look = shlex.join(["--style", "studio", "--size", EXAMPLE_SIZE, *shlex.split(each.look)])
        lines.append(f"clothsim render {each.name} -o {each.name}.png {look}")
    return "\n".join(["```sh", *lines, "```"])


def picture_of(name: str) -> str:
    """The picture of a scene from the root of the repository, "" where there is none."""
    films = [PICTURES.parent / f"{name}{ending}" for ending in ("_studio.webp", ".webp")]
    made = PICTURES / f"{name}.webp", EXAMPLE_PICTURES / f"{name}.webp", *films, PICTURES / f"{name}.png"
    return next((str(file) for file in made if (ROOT / file).is_file()), "")


def gallery_text(scenes: Sequence[Path]) -> str:
    """A section per scene: its description, its command and, where there is one, its picture."""
    parts = []
    for scene in scenes:
        name = scene.stem
        parts += [f"### {name}", "", description(scene), "", "```sh", f"clothsim run {name} -o {name}", "```", ""]
        if drawn := picture_of(name):
            parts += [f"![{description(scene).split('. ')[0].rstrip('.')}](../{drawn.removeprefix('docs/')})", ""]
    return "\n".join(parts)


def main(argv: Sequence[str] | None = None) -> int:
    """Draw the named scenes and write the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.gallery", description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="scenes to run (default: all)")
    parser.add_argument("--page", type=Path, default=ROOT / "docs/start/gallery.md", metavar="FILE")
    parser.add_argument("--no-run", action="store_true", help="write the page from the pictures that are there")
    parser.add_argument("--examples", action="store_true", help="the README's pictures, by path tracing: an hour")
    parser.add_argument("--runs", type=Path, metavar="DIR", help="keep the runs here, and use them")
    arguments = parser.parse_args(argv)
    if arguments.examples:
        named = [each for each in EXAMPLES if not arguments.names or each.name in arguments.names]
        chosen = [] if arguments.no_run else named
        with tempfile.TemporaryDirectory() as scratch:
            for each in chosen:
                draw(each, EXAMPLE_SIZE, arguments.runs or Path(scratch), ROOT / EXAMPLE_PICTURES / f"{each.name}.webp")
        write_between(ROOT / "README.md", "examples", examples_text(EXAMPLES))
        write_between(ROOT / "docs/index.md", "examples", example_cards(EXAMPLES))
        write_between(arguments.page, "examples", example_commands(EXAMPLES))
        return 0
    scenes = sorted(SCENES.glob("*.toml"))
    with tempfile.TemporaryDirectory() as scratch:
        for name in (scene.stem for scene in scenes if not arguments.no_run):
            if not arguments.names or name in arguments.names:
                one = Example(name, "", f"run {name}", LOOKS.get(name, ""))
                draw(one, SIZE, arguments.runs or Path(scratch), ROOT / PICTURES / f"{name}.webp")
    write_between(arguments.page, "gallery", gallery_text(scenes))
    return 0


if __name__ == "__main__":
    sys.exit(main())
