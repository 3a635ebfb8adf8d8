"""Verification of a farm: every file against its hash, and a sample of drapes made again."""

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from clothsim.study.farm.drape import drape
from clothsim.study.farm.identity import array_hash, processor
from clothsim.study.farm.plan import Farm, Job
from clothsim.study.farm.publication import CLOTH, read_drape


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


def verify(farm: Farm, share: float = 0.01, seed: int = 0) -> Verified:
    """Check the files of all published drapes, and make a fraction of them again.

    Parameters
    ----------
    farm : Farm
    share : float
        Fraction to make again, from 0 to 1, at least one drape where it is positive.
    seed : int
        Of the sample.
    """
    if not 0 <= share <= 1:
        raise InputError(f"The share is {share:g}.", "Give a number from 0 to 1, such as .01.")
    done = farm.published()
    jobs = [job for job in farm.jobs if job.id in done]
    torn = tuple(job.id for job in jobs if not _whole(farm, job))
    with_positions = [job for job in jobs if job.id not in torn and (_folder(farm, job) / CLOTH).is_file()]
    again = [_again(farm, job) for job in _sample(with_positions, share, seed)]
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


def _folder(farm: Farm, job: Job) -> Path:
    return farm.directory / "drapes" / job.id


def _whole(farm: Farm, job: Job) -> bool:
    """True where the files of a drape can be read and have the hash that its summary names."""
    try:
        summary, parameters = read_drape(farm.directory, job.id)
        file = _folder(farm, job) / CLOTH
        positions = np.load(file) if file.is_file() else None
    except (OSError, ValueError):
        return False
    digest = None if positions is None else array_hash(positions)
    return summary["id"] == job.id and parameters["index"] == job.index and summary.get("hash") == digest


def _sample(jobs: Sequence[Job], share: float, seed: int) -> list[Job]:
    count = min(len(jobs), math.ceil(share * len(jobs)))
    if not count:
        return []
    chosen = np.random.default_rng(seed).choice(len(jobs), count, replace=False)
    return [jobs[k] for k in sorted(chosen)]


def _again(farm: Farm, job: Job) -> dict[str, Any]:
    summary, _ = read_drape(farm.directory, job.id)
    before = np.load(_folder(farm, job) / CLOTH)
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
