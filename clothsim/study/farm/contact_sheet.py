"""Contact sheets: pictures of some drapes of a farm side by side, the failed ones with the reason."""

import tempfile
import textwrap
from base64 import b64encode
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from clothsim.base.file_writing import write_atomically
from clothsim.render import Surface, draw
from clothsim.study.farm.plan import Farm
from clothsim.study.farm.reading import positions_of, read_stored_mesh
from clothsim.study.farm.status import manifest, verdict_text

TILE, CAPTION, COLUMNS = (300, 340), 44, 4
"""Size of a picture and height of its caption [pixels]; pictures side by side."""
STYLE = (
    "<style>body{display:flex;flex-wrap:wrap;gap:1em;font:14px sans-serif}figure{width:300px;margin:0}"
    ".failed figcaption{color:#a00}td{padding-right:1em}</style>"
)
"""Style of the page."""


def contact_sheet(farm: Farm, target: str | Path, samples: int = 12, failures: int = 4) -> Path:
    """Write a PNG of evenly spaced usable drapes, at most `samples`, then of failed ones, at most `failures`."""
    shown = _shown(farm, samples, failures)
    lines, height = -(-len(shown) // COLUMNS), TILE[1] + CAPTION
    sheet = Image.new("RGB", (COLUMNS * TILE[0], max(1, lines) * height), "white")
    pen = ImageDraw.Draw(sheet)
    with tempfile.TemporaryDirectory(prefix="clothsim-sheet-") as scratch:
        for number, row in enumerate(shown):
            left, top = TILE[0] * (number % COLUMNS), height * (number // COLUMNS)
            caption = "\n".join(textwrap.wrap(f"{row['id']} {verdict_text(row)}", 46)[:3])
            pen.text((left + 6, top + 2), caption, fill="black" if row["usable"] else (160, 0, 0))
            if row["hash"] is not None:
                picture = Path(scratch) / "drape.png"
                draw(picture, surfaces(farm, row), size=TILE, colour="plain")
                with Image.open(picture) as image:
                    sheet.paste(image, (left, top + CAPTION))
    path = Path(target)
    sheet.save(path, format="PNG", optimize=True)
    return path


def contact_page(farm: Farm, target: str | Path, samples: int = 12, failures: int = 12) -> Path:
    """Write the same drapes as one HTML file with their pictures, whole sentences, certificates and parameters."""
    with tempfile.TemporaryDirectory(prefix="clothsim-sheet-") as scratch:
        tiles = "\n".join(_tile(farm, row, Path(scratch) / "drape.png") for row in _shown(farm, samples, failures))
    name = escape(farm.directory.resolve().name)
    page = f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>{name}</title>{STYLE}\n{tiles}\n</html>\n'
    path = Path(target)
    write_atomically(path, page.encode())
    return path


def _tile(farm: Farm, row: Mapping[str, Any], scratch: Path) -> str:
    """A figure: picture, verdict and a table of the certificate and the parameters."""
    picture = ""
    if row["hash"] is not None:
        draw(scratch, surfaces(farm, row), size=TILE, colour="plain")
        picture = f'<img alt="" src="data:image/png;base64,{b64encode(scratch.read_bytes()).decode()}">'
    measured = {name: row[name] for name in ("minimum_gap", "stretch_max", "newton_iterations", "cpu_seconds")}
    numbers = {**row["parameters"], **{name: value for name, value in measured.items() if value is not None}}
    texts = {name: f"{value:.4g}" if isinstance(value, float) else str(value) for name, value in numbers.items()}
    lines = "".join(f"<tr><td>{escape(name)}<td>{escape(text)}" for name, text in texts.items())
    kind = "usable" if row["usable"] else "failed"
    return (
        f'<figure class="{kind}">{picture}<figcaption><code>{row["id"]}</code> {escape(verdict_text(row))}</figcaption>'
        f"<table>{lines}</table></figure>"
    )


def _shown(farm: Farm, samples: int, failures: int) -> list[Mapping[str, Any]]:
    """Evenly spaced usable drapes, then failed ones."""
    rows = manifest(farm)
    usable, failed = ([row for row in rows if bool(row["usable"]) is wanted] for wanted in (True, False))
    return [
        kind[round(k)]
        for kind, most in ((usable, samples), (failed, failures))
        for k in np.linspace(0, len(kind) - 1, min(most, len(kind)))
    ]


def surfaces(farm: Farm, row: Mapping[str, Any]) -> list[Surface]:
    """Cloths of a drape in its last frame, and bodies at the start."""
    positions = np.asarray(positions_of(farm.directory, row["id"]), np.float64)
    last = positions if positions.ndim == 2 else positions[-1]
    made, begin = [], 0
    for role in ("cloth", "body"):
        for name, digest in row["meshes"].get(role, {}).items():
            mesh = read_stored_mesh(farm.directory, digest)
            start, triangles = mesh["start"].astype(np.float64), mesh["triangles"].astype(np.int64)
            points = last[begin : begin + len(start)] if role == "cloth" else start
            begin += len(start) if role == "cloth" else 0
            made.append(Surface(name, points, triangles, role, np.zeros((0, 2))))
    return made
