"""Contact sheet of six fields of the shirt: docs/pictures/fields.png.

`python -m tests.benchmarks.field_sheet [--run DIR] [--output FILE]`.
Runs scenes/shirt.toml for 0.4 s with the fields written, unless the directory of such a run is given.
"""

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from clothsim import Run, load_scene, open_run, simulate

ROOT = Path(__file__).parents[2]
FIELDS = ("stress", "principal_directions", "compression", "thickness", "energy_density", "contact_pressure")
SCENE = ROOT / "scenes" / "shirt.toml"
SIZE = (600, 450)
CELL = (slice(36, 340), slice(90, 600))
"""Rows and columns of a picture of SIZE pixels that hold the shirt and the scale bar."""
COLUMNS = 3
COLOURS = 256


def sheet(run: Run) -> Image.Image:
    """The last frame in each of FIELDS, in rows of COLUMNS."""
    pictures = [np.asarray(run.plot(field=name, size=SIZE))[CELL] for name in FIELDS]
    rows = [np.concatenate(pictures[k : k + COLUMNS], axis=1) for k in range(0, len(pictures), COLUMNS)]
    return Image.fromarray(np.concatenate(rows))


def in_few_colours(image: Image.Image) -> Image.Image:
    """The image with a palette that holds its rare colours too, dithered."""
    palette = image.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE, kmeans=3)
    return image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the scene and write the sheet."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.field_sheet", description=__doc__.splitlines()[0])
    parser.add_argument("--run", type=Path, metavar="DIR", help="a finished run with contact_pressure written")
    parser.add_argument("--output", type=Path, default=ROOT / "docs/pictures/fields.png", metavar="FILE")
    arguments = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder:
        scene = replace(load_scene(SCENE), run={"duration": 0.4, "fields": ["contact_pressure"]})
        run = simulate(scene, folder) if arguments.run is None else open_run(arguments.run)
        in_few_colours(sheet(run)).save(arguments.output, optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
