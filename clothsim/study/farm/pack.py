"""Data sets of a farm: one HDF5 file, or WebDataset shards (plain tar); with a manifest and a data card.

Contact sheets: pictures of some drapes side by side, the failed ones with the reason.
"""

import io
import json
import tarfile
import tempfile
import textwrap
from base64 import b64encode
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from PIL import Image, ImageDraw

from clothsim.base.errors import InputError
from clothsim.base.file_writing import refuse_replacing, replacing, write_atomically
from clothsim.base.text import text_table
from clothsim.render import Surface, draw
from clothsim.study.farm.plan import Farm
from clothsim.study.farm.reading import (
    CLOTH,
    PARAMETERS,
    SUMMARY,
    array_hash,
    mesh_file,
    positions_of,
    read_stored_mesh,
    whole_files,
)
from clothsim.study.farm.recipe import RULES
from clothsim.study.farm.status import manifest, verdict_text
from clothsim.study.farm.verification import demand_verified

# Data card: what a data set holds, its licence, the statistics of its certificates, and what failed.

STATISTICS = ("minimum_gap", "stretch_min", "stretch_max", "newton_iterations", "cpu_seconds")


def card(farm: Farm, rows: Sequence[Mapping[str, Any]]) -> str:
    """The card of the published drapes in Markdown; rows: from `manifest`."""
    settings, used = farm.settings, [row for row in rows if row["usable"]]
    same = settings["same"]
    cut = any(key.startswith("cloth.") and other.startswith("body.") for key, other in same.items())
    reasons = {row["cause"]: str(row["reason"]) for row in reversed(rows) if not row["usable"]}
    cause = Counter(row["cause"] for row in rows if not row["usable"])
    ranges = {}
    for key in settings["varied"]:
        box = settings["boxes"].get(key)
        counts = Counter(json.dumps(job.values[key]) for job in farm.jobs)
        ranges[key] = (
            f"as `{same[key]}`"
            if key in same
            else f"{box[0]:g} to {box[1]:g}"
            if box is not None
            else ", ".join(f"{value} ({count})" for value, count in sorted(counts.items()))
        )
    statistics = []
    for name in STATISTICS:
        values = [row[name] for row in used if isinstance(row[name], int | float) and np.isfinite(row[name])]
        three = (min(values), float(np.median(values)), max(values)) if values else ()
        statistics.append([name, *(f"{value:.4g}" for value in three)] if values else [name, "", "", ""])
    lines = [
        f"# Drapes of {farm.directory.name}",
        "",
        f"* Licence: {settings['licence']}",
        f"* Made by clothsim {settings['package']}, recipe version {settings['version']}, seed {settings['seed']}",
        f"* Planned {len(farm.jobs)}, published {len(rows)}, usable {len(used)}",
        "* Usable: completed"
        + (", at rest" if settings["usable"]["at_rest"] else "")
        + "".join(f", {key} = {value:g}" for key, value in settings["usable"].items() if key in RULES)
        + ", free of intersections by the exact test in every step, and no piece inside a body",
        f"* The garment is {'cut to the body' if cut else 'not cut to the body'}",
        f"* Kept: {'the last frame' if settings['frames'] == 'last' else 'all frames'}, positions in float32 [m]",
        f"* Processors: {', '.join(sorted({str(row['processor']) for row in rows}))}",
        "",
        "## Varied",
        "",
        *(f"* `{key}`: {text}" for key, text in ranges.items()),
        "",
        "## Certificates of the usable drapes",
        "",
        "```text",
        text_table(["", "least", "median", "largest"], statistics),
        "```",
        "",
        "## Left out",
        "",
        *([f"* {count} {name}: {reasons[name]}" for name, count in sorted(cause.items())] or ["Nothing."]),
        "",
    ]
    return "\n".join(lines)


SHARD = 1000
"""Drapes of a shard."""


@dataclass(frozen=True)
class Packed:
    """A data set: its files, its drapes, and those that were left out as they are not usable."""

    files: tuple[Path, ...]
    drapes: int
    left_out: int


def packed_files(target: Path) -> list[Path]:
    """The files that a data set is known by: the data, then what lies beside them by the same name."""
    of_file = target.suffix in (".h5", ".hdf5")
    beside = target.with_suffix("") if of_file else target / "data"
    first = target if of_file else target / "shard-000000.tar"
    return [first, *(beside.with_suffix(ending) for ending in (".jsonl", ".md", ".parquet"))]


def pack(farm: Farm, target: str | Path, shard: int = SHARD, overwrite: bool = False) -> Packed:
    """Write the usable drapes of a farm for other programs.

    Parameters
    ----------
    farm : Farm
    target : path
        "data.h5": one file; any other name: a folder of shards.
    shard : int
        Drapes of a shard.
    overwrite : bool
        Replace files of the same names.

    Returns
    -------
    Packed

    Raises
    ------
    InputError
        Where a file is there already, no drape is usable, or the farm is not verified, or not what was verified
        (`demand_verified`).

    Notes
    -----
    HDF5: `manifest` (a line of JSON for each drape, failed ones too), `card`, `meshes/HASH/{start, rest, triangles,
    material, uv}`, and for each topology `garments/K/{positions (N, n, 3) or (N, frames, n, 3), ids, meshes}`. Shards:
    ID.cloth.npy, ID.summary.json, ID.params.json, and the meshes in meshes.tar; the same bytes whenever they are made
    of the same drapes.
    """
    earlier = sorted(Path(target).glob("shard-[0-9]*.tar"))
    refuse_replacing([*packed_files(Path(target)), *earlier], overwrite)
    farm.refuse_output(packed_files(Path(target)))
    demand_verified(farm)
    rows = manifest(farm)
    used = [row for row in rows if row["usable"]]
    if not used:
        raise InputError(f"{farm.directory} has no usable drape.", "`clothsim farm status DIR` names the causes.")
    path = Path(target)
    if path.suffix in (".h5", ".hdf5"):
        path.parent.mkdir(parents=True, exist_ok=True)
        files = [_hdf5(farm, path, rows, used)]
        beside = path.parent / path.stem
    else:
        path.mkdir(parents=True, exist_ok=True)
        files = []
        for first in range(0, len(used), shard):
            members = (
                (f"{row['id']}.{file}", content)
                for row in used[first : first + shard]
                for file, content in whole_files(farm.directory, row["id"], (CLOTH, SUMMARY, PARAMETERS)).items()
            )
            files.append(_tar(path / f"shard-{first // shard:06d}.tar", members))
        names = sorted({name for row in used for kind in ("cloth", "body") for name in _mesh_names(row, kind)})
        meshes = ((f"{name}.npz", mesh_file(farm.directory, name).read_bytes()) for name in names)
        files.append(_tar(path / "meshes.tar", meshes))
        for stale in set(earlier) - set(files):  # of a data set of more shards, which readers would take for this one's
            stale.unlink()
        beside = path / "data"
    lines = "".join(f"{json.dumps(row)}\n" for row in rows)
    texts = {".jsonl": lines, ".md": card(farm, rows)}
    for ending, text in texts.items():
        write_atomically(beside.with_suffix(ending), text.encode())
        files.append(beside.with_suffix(ending))
    files += _parquet(rows, beside.with_suffix(".parquet"))
    return Packed(tuple(files), len(used), len(rows) - len(used))


def _mesh_names(row: Mapping[str, Any], kind: str) -> list[str]:
    return list(row["meshes"].get(kind, {}).values())


def _hdf5(farm: Farm, path: Path, rows: Sequence[Mapping[str, Any]], used: Sequence[Mapping[str, Any]]) -> Path:
    with replacing(path) as beside, h5py.File(beside, "w") as file:
        file.attrs["licence"] = farm.settings["licence"]
        file.attrs["package"] = farm.settings["package"]
        file["manifest"] = [json.dumps(row) for row in rows]
        file["card"] = card(farm, rows)
        topologies: dict[str, list[Mapping[str, Any]]] = {}
        names: dict[str, None] = {}
        for row in used:
            own = [read_stored_mesh(farm.directory, name)["triangles"] for name in _mesh_names(row, "cloth")]
            topology = "|".join([array_hash(*own), str(positions_of(farm.directory, row["id"]).shape)])
            topologies.setdefault(topology, []).append(row)
            names |= dict.fromkeys([*_mesh_names(row, "cloth"), *_mesh_names(row, "body")])
        for name in names:
            for key, array in read_stored_mesh(farm.directory, name).items():
                file[f"meshes/{name}/{key}"] = array
        for number, group in enumerate(topologies.values()):
            whole = (len(group), *positions_of(farm.directory, group[0]["id"]).shape)
            positions = file.create_dataset(f"garments/{number}/positions", whole, "f4")
            for k, row in enumerate(group):
                positions[k] = positions_of(farm.directory, row["id"])
            file[f"garments/{number}/ids"] = [row["id"] for row in group]
            file[f"garments/{number}/meshes"] = [json.dumps(row["meshes"]) for row in group]
    return path


def _tar(path: Path, files: "Iterator[tuple[str, bytes]]") -> Path:
    """Write a tar whose bytes depend on its content alone: no times and no owners."""
    with replacing(path) as beside, tarfile.open(beside, "w", format=tarfile.USTAR_FORMAT) as archive:
        for name, content in files:
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            archive.addfile(entry, io.BytesIO(content))
    return path


def _parquet(rows: Sequence[Mapping[str, Any]], path: Path) -> list[Path]:
    """The manifest as a table with a column for each varied key, where pyarrow is installed."""
    try:
        from pyarrow import Table, parquet
    except ImportError:
        return []
    flat = [
        {
            **{key: value for key, value in row.items() if key not in ("parameters", "meshes")},
            "meshes": json.dumps(row["meshes"]),
            **{
                key: json.dumps(value) if isinstance(value, list) else value for key, value in row["parameters"].items()
            },
        }
        for row in rows
    ]
    parquet.write_table(Table.from_pylist(flat), path)
    return [path]


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
    figures = []
    with tempfile.TemporaryDirectory(prefix="clothsim-sheet-") as scratch:
        for row in _shown(farm, samples, failures):
            picture, file = "", Path(scratch) / "drape.png"
            if row["hash"] is not None:
                draw(file, surfaces(farm, row), size=TILE, colour="plain")
                picture = f'<img alt="" src="data:image/png;base64,{b64encode(file.read_bytes()).decode()}">'
            measured = {name: row[name] for name in ("minimum_gap", "stretch_max", "newton_iterations", "cpu_seconds")}
            numbers = {**row["parameters"], **{name: value for name, value in measured.items() if value is not None}}
            texts = {
                name: f"{value:.4g}" if isinstance(value, float) else str(value) for name, value in numbers.items()
            }
            lines = "".join(f"<tr><td>{escape(name)}<td>{escape(text)}" for name, text in texts.items())
            head = f"{picture}<figcaption><code>{row['id']}</code> {escape(verdict_text(row))}</figcaption>"
            kind = "usable" if row["usable"] else "failed"
            figures.append(f'<figure class="{kind}">{head}<table>{lines}</table></figure>')
    name, tiles = escape(farm.directory.resolve().name), "\n".join(figures)
    page = f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>{name}</title>{STYLE}\n{tiles}\n</html>\n'
    path = Path(target)
    write_atomically(path, page.encode())
    return path


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
