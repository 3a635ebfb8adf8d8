"""State of a farm: what is published, failed, claimed and left, and whether the files are what they were."""

import json
import math
import tempfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from clothsim.base.file_writing import write_atomically
from clothsim.study.farm.claims import Worker, is_stale
from clothsim.study.farm.drape import drape
from clothsim.study.farm.plan import Farm, Job
from clothsim.study.farm.publication import CLOTH, array_hash, processor, read_drape

MANIFEST = "manifest.jsonl"


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
        Drapes in an hour of one core, by the name of the processor.
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
    """A row for each published drape in the order of the plan: parameters, verdict, hash, processor."""
    done = farm.published()
    rows = []
    for job in farm.jobs:
        if job.id not in done:
            continue
        summary, _ = read_drape(farm.directory, job.id)
        certificate = summary.get("certificate", {})
        rows.append(
            {
                "index": job.index,
                "id": job.id,
                "parameters": dict(job.values),
                **{key: summary.get(key) for key in ("status", "reason", "cause", "usable", "hash", "processor")},
                **{key: summary.get(key) for key in ("cpu_seconds", "newton_iterations", "vertices", "meshes")},
                **{
                    key: certificate.get(key)
                    for key in ("intersection_free", "at_rest", "minimum_gap", "stretch_min", "stretch_max")
                },
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
    claims = [path for path in (farm.directory / "claims").iterdir() if not path.name.startswith(".")]
    stale = sum(is_stale(path, worker) for path in claims)
    rows = manifest(farm)
    seconds: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    for row in rows:
        if row["cpu_seconds"]:
            seconds[row["processor"]] += row["cpu_seconds"]
            counts[row["processor"]] += row["hash"] is not None
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


@dataclass(frozen=True)
class Verified:
    """Result of a verification.

    Attributes
    ----------
    whole : int
        Published drapes whose files are readable and agree with their hash.
    torn : tuple of str
        Ids of those that are not.
    repeated, same : int
        Drapes made again on the same kind of processor, and those of them that have the same bytes.
    elsewhere : int
        Drapes made again that come from another kind of processor, whose last bits may differ.
    different : tuple of str
        Ids of drapes of the same processor with other bytes.
    largest : float
        Largest distance of a vertex between two makings [m].
    """

    whole: int
    torn: tuple[str, ...]
    repeated: int
    same: int
    elsewhere: int
    different: tuple[str, ...]
    largest: float

    @property
    def good(self) -> bool:
        """True where nothing is torn and nothing differs."""
        return not self.torn and not self.different


def verify(farm: Farm, fraction: float = 0.01, seed: int = 0) -> Verified:
    """Check the files of all published drapes, and make a fraction of them again: at least one where it is positive."""
    if not 0 <= fraction <= 1:
        raise InputError(f"The fraction is {fraction:g}.", "Give a number from 0 to 1, such as .01.")
    done = farm.published()
    jobs = [job for job in farm.jobs if job.id in done]
    torn = tuple(job.id for job in jobs if not _whole(farm, job))
    with_positions = [job for job in jobs if job.id not in torn and (farm.folder(job.id) / CLOTH).is_file()]
    count = math.ceil(fraction * len(with_positions))
    chosen = np.random.default_rng(seed).choice(len(with_positions), count, replace=False).tolist() if count else []
    again = [_again(farm, with_positions[k]) for k in sorted(chosen)]
    here = [each for each in again if each["here"]]
    return Verified(
        whole=len(jobs) - len(torn),
        torn=torn,
        repeated=len(here),
        same=sum(each["same"] for each in here),
        elsewhere=len(again) - len(here),
        different=tuple(each["id"] for each in here if not each["same"]),
        largest=max((each["distance"] for each in again), default=0.0),
    )


def _whole(farm: Farm, job: Job) -> bool:
    """True where the files of a drape can be read and have the hash that its summary names."""
    try:
        summary, parameters = read_drape(farm.directory, job.id)
        file = farm.folder(job.id) / CLOTH
        positions = np.load(file) if file.is_file() else None
    except (OSError, ValueError):
        return False
    digest = None if positions is None else array_hash(positions)
    return summary["id"] == job.id and parameters["index"] == job.index and summary.get("hash") == digest


def _again(farm: Farm, job: Job) -> dict[str, Any]:
    summary, _ = read_drape(farm.directory, job.id)
    before = np.load(farm.folder(job.id) / CLOTH)
    with tempfile.TemporaryDirectory(prefix="clothsim-verify-") as scratch:
        made = drape(farm.scene_of(job), Path(scratch), frames=farm.settings["frames"])
    after = made.positions
    comparable = after is not None and after.shape == before.shape
    distance = float(np.linalg.norm(after - before, axis=-1).max()) if comparable else math.inf
    return {
        "id": job.id,
        "here": summary["processor"] == processor(),
        "same": made.summary["hash"] == summary["hash"],
        "distance": distance,
    }
