"""Data card: what a data set holds, its licence, the statistics of its certificates, and what failed."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from clothsim.base.text_table import text_table
from clothsim.study.farm.plan import Farm

STATISTICS = ("minimum_gap", "stretch_min", "stretch_max", "newton_iterations", "cpu_seconds")


def card(farm: Farm, rows: Sequence[Mapping[str, Any]]) -> str:
    """The card of the published drapes in Markdown.

    Parameters
    ----------
    farm : Farm
    rows : sequence of dict
        From `manifest`.
    """
    settings, used = farm.settings, [row for row in rows if row["usable"]]
    same = settings["same"]
    cut = any(key.startswith("cloth.") and other.startswith("body.") for key, other in same.items())
    cause = Counter(row["cause"] for row in rows if not row["usable"])
    lines = [
        f"# Drapes of {farm.directory.name}",
        "",
        f"* Licence: {settings['licence']}",
        f"* Made by clothsim {settings['package']}, recipe version {settings['version']}, seed {settings['seed']}",
        f"* Planned {len(farm.jobs)}, published {len(rows)}, usable {len(used)}",
        "* Usable: completed"
        + (", at rest" if settings["scene"]["run"].get("until") == "rest" else "")
        + ", and free of intersections by the exact test in every step",
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
        *([f"* {count} {name}: {_first(rows, name)}" for name, count in sorted(cause.items())] or ["Nothing."]),
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


def _first(rows: Sequence[Mapping[str, Any]], cause: str) -> str:
    return str(next(row["reason"] for row in rows if not row["usable"] and row["cause"] == cause))
