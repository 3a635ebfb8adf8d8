"""Contact sheet: pictures of some drapes of a farm side by side, the failed ones with their sentence."""

import tempfile
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim.farm.plan import Farm
from clothsim.farm.publication import CLOTH
from clothsim.farm.status import manifest

if TYPE_CHECKING:
    from clothsim.render.surface_look import Surface

TILE, CAPTION, COLUMNS = (300, 340), 44, 4
"""Size of a picture and height of its caption [pixels]; pictures side by side."""


def contact_sheet(farm: Farm, target: str | Path, samples: int = 12, failures: int = 4) -> Path:
    """Write a PNG of evenly spaced usable drapes, then of failed ones.

    Parameters
    ----------
    farm : Farm
    target : path
        The PNG.
    samples, failures : int
        Largest number of each.
    """
    from PIL import Image, ImageDraw

    rows = manifest(farm)
    shown = [
        *_spaced([row for row in rows if row["usable"]], samples),
        *_spaced([row for row in rows if not row["usable"]], failures),
    ]
    lines, height = -(-len(shown) // COLUMNS), TILE[1] + CAPTION
    sheet = Image.new("RGB", (COLUMNS * TILE[0], max(1, lines) * height), "white")
    pen = ImageDraw.Draw(sheet)
    with tempfile.TemporaryDirectory(prefix="clothsim-sheet-") as scratch:
        for number, row in enumerate(shown):
            left, top = TILE[0] * (number % COLUMNS), height * (number // COLUMNS)
            pen.text((left + 6, top + 2), _caption(row), fill="black" if row["usable"] else (160, 0, 0))
            if row["hash"] is not None:
                picture = Path(scratch) / "drape.png"
                _draw(farm, row, picture)
                with Image.open(picture) as image:
                    sheet.paste(image, (left, top + CAPTION))
    path = Path(target)
    sheet.save(path, format="PNG", optimize=True)
    return path


def _spaced(rows: Sequence[Mapping[str, Any]], count: int) -> list[Mapping[str, Any]]:
    if len(rows) <= count:
        return list(rows)
    return [rows[round(k)] for k in np.linspace(0, len(rows) - 1, count)]


def _caption(row: Mapping[str, Any]) -> str:
    text = "certified" if row["usable"] else f"{row['cause']}: {row['reason']}"
    return "\n".join(textwrap.wrap(f"{row['id']} {text}", 46)[:3])


def _draw(farm: Farm, row: Mapping[str, Any], path: Path) -> None:
    from clothsim.render.picture import draw

    draw(path, surfaces(farm, row), size=TILE, colour="plain")


def surfaces(farm: Farm, row: Mapping[str, Any]) -> "list[Surface]":
    """Cloths of a drape in its last frame, and bodies at the start."""
    from clothsim.render.surface_look import Surface

    positions = np.asarray(np.load(farm.directory / "drapes" / row["id"] / CLOTH), np.float64)
    last = positions if positions.ndim == 2 else positions[-1]
    made, begin = [], 0
    for role in ("cloth", "body"):
        for name, digest in row["meshes"].get(role, {}).items():
            with np.load(farm.directory / "meshes" / f"{digest}.npz") as mesh:
                start, triangles = mesh["start"].astype(np.float64), mesh["triangles"].astype(np.int64)
            points = last[begin : begin + len(start)] if role == "cloth" else start
            begin += len(start) if role == "cloth" else 0
            made.append(Surface(name, points, triangles, role, np.zeros((0, 2))))
    return made
