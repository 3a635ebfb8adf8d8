"""State of a farm: what is published, failed, claimed and left."""

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from clothsim.base.errors import InputError
from clothsim.base.file_writing import write_atomically
from clothsim.study.farm.claims import Worker, is_stale
from clothsim.study.farm.plan import MANIFEST, Farm
from clothsim.study.farm.reading import is_id, read_drape

CERTIFIED = ("intersection_free", "at_rest", "minimum_gap", "stretch_min", "stretch_max")
"""What a row has of the certificate."""


@dataclass(frozen=True)
class Status:
    """Counts of a farm.

    Attributes
    ----------
    planned, published, usable, claimed, stale : int
        Stale: claims of processes that have ended.
    causes : dict of str to int
        Number of drapes that are not usable, by cause.
    cpu_seconds : float
        Of all published drapes.
    per_core_hour : dict of str to float
        Usable drapes in an hour of one core, by the name of the processor: the time of the others counts too.
    """

    planned: int
    published: int
    usable: int
    claimed: int
    stale: int
    causes: dict[str, int] = field(default_factory=dict)
    cpu_seconds: float = 0.0
    per_core_hour: dict[str, float] = field(default_factory=dict)


def manifest(farm: Farm) -> list[dict[str, Any]]:
    """A row for each published drape in the order of the plan: parameters, verdict, hash, processor.

    One whose summary is not what was published is not usable, with the cause "torn".
    """
    done = farm.published()
    rows = []
    for job in farm.jobs:
        if job.id not in done:
            continue
        try:
            summary, _ = read_drape(farm.directory, job.id)
        except InputError as error:
            summary = {"status": "failed", "reason": error.sentence, "cause": "torn", "usable": False, "meshes": {}}
        certificate = summary.get("certificate", {})
        rows.append(
            {
                "index": job.index,
                "id": job.id,
                "parameters": dict(job.values),
                **{key: summary.get(key) for key in ("status", "reason", "cause", "usable", "hash", "processor")},
                **{key: summary.get(key) for key in ("cpu_seconds", "newton_iterations", "vertices", "meshes")},
                **{key: certificate.get(key) for key in CERTIFIED},
            }
        )
    return rows


def verdict_text(row: Mapping[str, Any]) -> str:
    """The word for a usable drape, cause and reason of another one; row: of a manifest, or a summary."""
    return "certified" if row["usable"] else f"{row['cause']}: {row['reason']}"


def write_manifest(farm: Farm) -> list[dict[str, Any]]:
    """Write manifest.jsonl from the published drapes, and return its rows; it can be made again at any time."""
    rows = manifest(farm)
    write_atomically(farm.directory / MANIFEST, "".join(f"{json.dumps(row)}\n" for row in rows).encode())
    return rows


def status(farm: Farm, worker: Worker | None = None) -> Status:
    """Count the drapes of a farm."""
    worker = worker or Worker()
    claims = [path for path in (farm.directory / "claims").iterdir() if is_id(path.name) and path.is_file()]
    stale = sum(is_stale(path, worker) for path in claims)
    rows = manifest(farm)
    seconds: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    for row in rows:
        if row["cpu_seconds"]:
            seconds[row["processor"]] += row["cpu_seconds"]
            counts[row["processor"]] += bool(row["usable"])
    return Status(
        planned=len(farm.jobs),
        published=len(rows),
        usable=sum(bool(row["usable"]) for row in rows),
        claimed=len(claims) - stale,
        stale=stale,
        causes=dict(Counter(row["cause"] for row in rows if not row["usable"])),
        cpu_seconds=sum(seconds.values()),
        per_core_hour={name: 3600 * counts[name] / seconds[name] for name in seconds},
    )
