"""Pilot of a farm: a drape of its recipe that is made before it is planned, to say what is missing."""

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

from clothsim.base.errors import InputError
from clothsim.study.farm.drape import drape
from clothsim.study.farm.plan import TRIED
from clothsim.study.farm.recipe import Recipe, changed

LONGER = 10.0
"""A pilot that is to come to rest has so many times the duration of the recipe, to find how long it takes."""
SPARE = 1.5
"""What is proposed is so many times what the pilot took."""


@dataclass(frozen=True)
class Pilot:
    """A usable drape of a recipe: its number, simulated time [s] and processor time [s]."""

    index: int
    time: float
    cpu_seconds: float


def pilot(recipe: Recipe) -> Pilot:
    """Make the first drapes of a recipe, until one is usable.

    Raises
    ------
    InputError
        None of the first TRIED is usable: what the first one lacks, and what to set where that is the duration.
    """
    lacks: list[InputError] = []
    for index in range(min(TRIED, recipe.count)):
        found = _tried(recipe, index)
        if isinstance(found, Pilot):
            return found
        lacks.append(found)
    others = f" The next {len(lacks) - 1} are not usable either." if len(lacks) > 1 else ""
    raise InputError(
        f"No pilot drape is usable, so nothing is planned. {lacks[0].sentence}{others}",
        lacks[0].remedy or "Change the recipe, or plan it as it is: --no-pilot.",
    )


def _tried(recipe: Recipe, index: int) -> Pilot | InputError:
    """A drape of the recipe; where it is not usable, what it lacks."""
    scene = changed(recipe.scene, recipe.values(index))
    allowed = scene.run_settings.duration
    if recipe.rules["at_rest"]:
        scene = changed(scene, {"run.duration": LONGER * allowed})
    with tempfile.TemporaryDirectory(prefix="clothsim-pilot-") as folder:
        made = drape(scene, Path(folder), rules=recipe.rules).summary
    if made["cause"] == "not at rest":
        return InputError(
            f"Drape {index} will not rest in {allowed:g} s, nor in {LONGER * allowed:g} s: {made['reason']}",
            'Raise effects.damping.rate or run.rest_speed under [set], or write until = "time" under [farm].',
        )
    if made["cause"]:
        return InputError(f"Drape {index} is not usable ({made['cause']}): {made['reason']}")
    time = made["measured"]["time"]
    if time > allowed * (1 + 1e-9):
        return InputError(
            f"Drape {index} will not rest in {allowed:g} s; {enough(time):g} s would do.",
            f'Write "run.duration" = {enough(time):g} under [set], or plan the recipe as it is: --no-pilot.',
        )
    return Pilot(index, time, made["cpu_seconds"])


def enough(time: float) -> float:
    """A duration of one digit that leaves SPARE to a drape that took `time` [s].

    Examples
    --------
    >>> enough(2.6), enough(0.31), enough(11.0)
    (4.0, 0.5, 20.0)
    """
    digit = 10.0 ** math.floor(math.log10(SPARE * time))
    return float(f"{digit * math.ceil(SPARE * time / digit - 1e-9):.3g}")
