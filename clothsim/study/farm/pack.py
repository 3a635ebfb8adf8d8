"""Data sets of a farm: one HDF5 file, or WebDataset shards (plain tar); with a manifest and a data card."""

import io
import json
import tarfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from clothsim.base.errors import InputError
from clothsim.base.file_writing import refuse_replacing, replacing, write_atomically
from clothsim.base.text import text_table
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
from clothsim.study.farm.rules import RULES
from clothsim.study.farm.status import manifest
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
        *(f"* `{key}`: {_range(key, farm)}" for key in settings["varied"]),
        "",
        "## Certificates of the usable drapes",
        "",
        "```text",
        text_table(["", "least", "median", "largest"], [_statistics(name, used) for name in STATISTICS]),
        "```",
        "",
        "## Left out",
        "",
        *([f"* {count} {name}: {reasons[name]}" for name, count in sorted(cause.items())] or ["Nothing."]),
        "",
    ]
    return "\n".join(lines)


def _range(key: str, farm: Farm) -> str:
    if key in farm.settings["same"]:
        return f"as `{farm.settings['same'][key]}`"
    box = farm.settings["boxes"].get(key)
    if box is not None:
        return f"{box[0]:g} to {box[1]:g}"
    counts = Counter(json.dumps(job.values[key]) for job in farm.jobs)
    return ", ".join(f"{value} ({count})" for value, count in sorted(counts.items()))


def _statistics(name: str, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    values = [row[name] for row in rows if isinstance(row[name], int | float) and np.isfinite(row[name])]
    if not values:
        return [name, "", "", ""]
    return [name, *(f"{value:.4g}" for value in (min(values), float(np.median(values)), max(values)))]


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
        files = list(_shards(farm, path, used, shard))
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


def _shards(farm: Farm, folder: Path, used: Sequence[Mapping[str, Any]], size: int) -> Iterator[Path]:
    for first in range(0, len(used), size):
        files = (
            (f"{row['id']}.{file}", content)
            for row in used[first : first + size]
            for file, content in whole_files(farm.directory, row["id"], (CLOTH, SUMMARY, PARAMETERS)).items()
        )
        yield _tar(folder / f"shard-{first // size:06d}.tar", files)
    names = sorted({name for row in used for kind in ("cloth", "body") for name in _mesh_names(row, kind)})
    yield _tar(folder / "meshes.tar", ((f"{n}.npz", mesh_file(farm.directory, n).read_bytes()) for n in names))


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
