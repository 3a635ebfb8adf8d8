"""Plausible ranges of the numbers of a scene, by key and by unit: a number beyond them may be one in another unit.

A scene is simulated with any number that its key allows; one beyond these ranges is asked about.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from clothsim.keys.key_table import KeyTable
from clothsim.keys.schema import SceneKey, keys_of

OF_KEY: Mapping[str, tuple[float, float, str]] = {
    "cloth.density": (0.005, 5.0, "a cotton has 0.15"),
    "cloth.thickness": (1e-5, 0.02, "a cotton has 0.0003"),
    "cloth.youngs_modulus": (1e3, 1e10, "a cotton has 0.8e6"),
    "cloth.bending_stiffness": (1e-9, 1e-2, "a cotton has 9e-6"),
    "rigid.density": (10.0, 2.5e4, "wood has 600, steel 7800"),
    "rod.density": (10.0, 2.5e4, "cotton has 1500, steel 7800"),
    "rod.youngs_modulus": (1e3, 1e13, "rubber has 1e6, steel 2e11"),
    "stiffener.stretch_stiffness": (1e-2, 1e8, "a steel wire of 1 mm has 1.6e5"),
    "air.density": (0.01, 1500.0, "air has 1.2"),
    "gravity.acceleration": (0.01, 300.0, "the earth has 9.81"),
    "rigid.stiffness": (1e4, 1e12, "1e8 is usual"),
    "cloth.weld": (1e-9, 0.05, "seams of a file are closer than 0.01"),
    "slab.size": (1e-5, 1e4, "a table is 1 long"),
    "mannequin.height": (0.4, 2.6, "an adult has 1.7"),
    "ring.thickness": (1e-4, 1.0, "a ring is 0.01 thick"),
    "body_contact.d_hat": (1e-7, 0.05, "0.001 to 0.005 is usual"),
    "self_contact.d_hat": (1e-7, 0.05, "0.001 to 0.005 is usual"),
    "body_contact.offset": (1e-7, 0.05, "half of a thickness is 0.0002"),
    "self_contact.offset": (1e-7, 0.05, "half of a thickness is 0.0002"),
    "body_contact.stiffness": (1e-2, 1e12, "it adapts where none is given"),
    "self_contact.stiffness": (1e-2, 1e12, "it adapts where none is given"),
    "friction.coefficient": (0.0, 3.0, "cloth on a body has 0.2 to 0.6"),
    "friction.mu_static": (0.0, 3.0, "cloth on a body has 0.2 to 0.6"),
    "friction.mu_kinetic": (0.0, 3.0, "cloth on a body has 0.2 to 0.6"),
    "friction.elastic_slip": (1e-9, 0.01, "0.00001 is usual"),
    "friction.eps_v": (1e-6, 1.0, "0.001 to 0.01 is usual"),
    "pressure.value": (1e-3, 1e6, "a toy balloon has 2000"),
    "band.stiffness": (1e-3, 1e5, "a waistband has 20"),
    "cord.stiffness": (1e-3, 1e6, "a cotton cord has 1000"),
    "plastic_bending.yield_curvature": (1.0, 1e5, "a crease of a millimetre has 1000"),
    "solver.dt": (1e-7, 0.5, "0.01 is usual"),
    "solver.tolerance": (1e-12, 1.0, "0.001 is usual"),
    "run.rest_speed": (1e-9, 0.1, "0.001 is usual"),
    "run.duration": (1e-4, 600.0, "a drape takes 1 to 5"),
}
"""Smallest and largest magnitude, in the unit of the key, and a usual number; 0 is plausible everywhere."""

OF_UNIT: Mapping[str, tuple[float, float]] = {
    "m": (1e-6, 100.0),
    "m/s": (1e-6, 100.0),
    "m/s2": (1e-3, 1000.0),
    "m2/s": (1e-4, 1000.0),
    "s": (1e-7, 600.0),
    "1/s": (1e-4, 1e4),
    "1/m": (1e-3, 1e4),
    "N/m": (1e-3, 1e7),
    "N m": (1e-10, 1e-1),
    "N m2": (1e-12, 1e-1),
    "N m/m": (1e-9, 1.0),
    "N s/m": (1e-9, 1e3),
    "degrees/s": (1e-3, 3.6e5),
}
"""Smallest and largest magnitude of keys that are not named above."""

ANY: Mapping[str, str] = {
    "scale": "what corrects the unit of a file; the resulting size is checked",
    "budget": "a limit of computing time, which people set to hours",
    "path": "rows of a time and three lengths",
}
"""Keys of which no number is doubted, and why."""
UNITS_OF_ANY = ("degrees", "1", "-", "1, N/m")
"""Units of which no number is: an angle may be many turns."""


def plausible_range(section: str, key: SceneKey) -> tuple[float, float, str] | None:
    """Range of a key and a usual number in words; None of one of which no number is doubted.

    section: the section that declares it ("cloth", "friction"), without "effects.".

    Examples
    --------
    >>> from clothsim.keys.settings import Solver
    >>> plausible_range("solver", keys_of(Solver)["dt"])
    (1e-07, 0.5, '0.01 is usual')
    """
    own = OF_KEY.get(f"{section}.{key.name}")
    if own is not None or key.name in ANY or key.key.unit in UNITS_OF_ANY:
        return own
    if key.key.unit not in OF_UNIT:  # of an effect of a user's own
        return None
    low, high = OF_UNIT[key.key.unit]
    return low, high, f"{low:g} to {high:g} is usual"


ABSURD = 1e9
"""Multiple of the largest plausible number beyond which no unit explains one: a newton metre has 1e9 g mm2/s2."""
OF_MOTION = ("s", "m/s", "degrees/s")
"""Units of numbers that are never absurd: long times end nothing, and speeds are looked at by themselves."""


def doubts(where: str, section: KeyTable) -> Iterator[str]:
    """A question on each number of a section, and of its nested ones, that looks like one in another unit."""
    for each in _implausible(where, section):
        yield f"{each.sentence}: is it in another unit?"


def refuse_absurd(where: str, section: KeyTable) -> None:
    """InputError for the first number of a section that is beyond ABSURD, but for those OF_MOTION."""
    for each in _implausible(where, section):
        if each.unit.strip() not in OF_MOTION and each.size > ABSURD * each.most:
            raise InputError(f"{each.sentence}.", f"Give at most {ABSURD * each.most:g}{each.unit}.")


@dataclass(frozen=True)
class _Implausible:
    """A number beyond its range: what it is, its magnitude, the largest plausible one, their unit after a space."""

    sentence: str
    size: float
    most: float
    unit: str


def _implausible(where: str, section: KeyTable) -> Iterator[_Implausible]:
    """The numbers of a section, and of its nested ones, that are beyond their ranges."""
    known, kinds = keys_of(type(section)), type(section).composed_of or (type(section),)
    of_a_board = _keys_of_a_plate(section)
    for name in section:
        if name in of_a_board:
            continue
        key = known[name]
        value = getattr(section, key.field)
        nested = value if isinstance(value, list | tuple) else (value,)
        for number, each in enumerate(nested):
            if isinstance(each, KeyTable):
                place = f"{where}.{name}[{number}]" if isinstance(value, list | tuple) else f"{where}.{name}"
                yield from _implausible(place, each)
        # the last words of the sections that have the key: "cloth" and "mannequin" of a composed one
        declaring = (kind.section.rpartition(".")[2] for kind in kinds if name in keys_of(kind))
        found = next(filter(None, (plausible_range(own, key) for own in declaring)), None)
        size = _magnitude(value)
        if found is not None and size and not found[0] <= size <= found[1]:
            given = f"{value:g}" if isinstance(value, int | float) else f"of {size:.4g}"
            unit = "" if key.key.unit == "1" else f" {key.key.unit}"
            yield _Implausible(f"{where}.{name} is {given}{unit}, where {found[2]}", size, found[1], unit)


def _keys_of_a_plate(section: KeyTable) -> set[str]:
    """Keys of a cloth that its own thickness explains: it is as heavy, and at most as stiff, as a solid plate."""
    given = {name: getattr(section, key.field) for name, key in keys_of(type(section)).items() if name in section}
    density, thickness = given.get("density", 0.0), given.get("thickness", 0.0)
    low, high, _ = OF_KEY["rigid.density"]
    if not 0 < thickness <= OF_KEY["cloth.thickness"][1] or not low <= density / thickness <= high:
        return set()
    modulus, bending = (_magnitude(given.get(name, 0.0)) for name in ("youngs_modulus", "bending_stiffness"))
    stiffest = modulus * thickness**3 / 9  # E t^3 / (12 (1 - nu^2)), nu of a half
    return {"density"} | ({"bending_stiffness"} if 0 < bending <= stiffest else set())


def _magnitude(value: Any) -> float:
    """Largest magnitude of a number, of numbers in a list or an array, or of values of key frames; 0 of all else."""
    if isinstance(value, bool) or not isinstance(value, int | float | list | tuple | np.ndarray):
        return 0.0
    try:
        numbers = np.abs(np.asarray(value, np.float64))
    except (ValueError, TypeError):
        return 0.0
    if numbers.ndim == 2 and numbers.shape[1] == 2:
        numbers = numbers[:, 1]
    return float(numbers.max(initial=0.0)) if numbers.ndim < 2 else 0.0
