"""Repair of a farm: what is torn, or failed by no fault of its own, goes back into the plan."""

import os
import shutil
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass

from clothsim.base.errors import InputError
from clothsim.engine import build
from clothsim.study.farm.drape import store_world
from clothsim.study.farm.plan import Farm
from clothsim.study.farm.reading import read_drape
from clothsim.study.farm.verification import faults

MACHINE = ("killed",)
"""Causes of drapes that the machine may have failed: their processes were ended from outside, as for want of memory."""


@dataclass(frozen=True)
class Repaired:
    """What was repaired: the cause of each drape that was taken back, by id, and meshes that were stored again."""

    taken_back: dict[str, str]
    meshes: tuple[str, ...]


def repair(farm: Farm, causes: Collection[str] = MACHINE) -> Repaired:
    """Take drapes back into the plan: `work` makes them again.

    Torn ones are, and those with one of the causes; a mesh that alone is torn is made again from its scene. A drape
    that is whole stays.
    """
    stored = []
    for digest, name in faults(farm).meshes.items():
        job = next(job for job in farm.jobs if job.id == name)
        with suppress(InputError):
            made = store_world(farm.directory, build(farm.scene_of(job)).world)
            stored += [digest for each in made.values() if digest in each.values()]
    torn, taken = faults(farm).torn, dict[str, str]()
    for job in farm.jobs:
        if job.id in torn:
            taken[job.id] = torn[job.id]
        elif job.id in farm.published() and read_drape(farm.directory, job.id)[0]["cause"] in causes:
            taken[job.id] = str(read_drape(farm.directory, job.id)[0]["reason"])
    for name in taken:
        old = farm.directory / "tmp" / f"{name}.repaired.{os.urandom(6).hex()}"
        farm.folder(name).rename(old)
        shutil.rmtree(old, ignore_errors=True)
        (farm.directory / "attempts" / name).unlink(missing_ok=True)
    return Repaired(taken, tuple(stored))
