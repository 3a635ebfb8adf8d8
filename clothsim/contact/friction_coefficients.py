"""Coefficients of friction by pair of objects, from the keys of a scene."""

from collections.abc import Sequence

import numpy as np

from clothsim.arrays import Floats, as_positive
from clothsim.errors import InputError
from clothsim.mesh.world import World


def coefficient_tables(
    world: World,
    coefficient: float,
    mu_static: float | str,
    mu_kinetic: float | str,
    pairs: Sequence[Sequence[object]],
) -> tuple[Floats, Floats]:
    """mu_static and mu_kinetic of each pair of objects, (L, L). InputError for a value or name that is none.

    A coefficient that is "auto" is `coefficient`; mu_kinetic is then at most mu_static.
    """
    both = as_positive("effects.friction.coefficient", coefficient, zero=True)
    static = both if mu_static == "auto" else as_positive("effects.friction.mu_static", mu_static, zero=True)  # type: ignore[arg-type]
    kinetic = min(both, static)
    if mu_kinetic != "auto":
        kinetic = as_positive("effects.friction.mu_kinetic", mu_kinetic, zero=True)  # type: ignore[arg-type]
        static = max(static, kinetic) if mu_static == "auto" else static
    _check_order("effects.friction", static, kinetic)
    tables = np.full((2, len(world.names), len(world.names)), np.array([static, kinetic])[:, None, None])
    entries: dict[frozenset[int], int] = {}
    for number, entry in enumerate(pairs):
        a, b, of_pair = _pair(world, number, entry)
        first = entries.setdefault(frozenset((a, b)), number)
        if first != number:
            raise InputError(
                f"effects.friction.pairs[{number}] repeats the pair {world.names[a]} and {world.names[b]} of "
                f"pairs[{first}].",
                "Remove one of the two.",
            )
        tables[:, a, b] = tables[:, b, a] = of_pair
    return tables[0], tables[1]


def _check_order(where: str, static: float, kinetic: float) -> None:
    if kinetic > static:
        raise InputError(
            f"{where}: mu_kinetic is {kinetic:g}, more than mu_static, {static:g}.",
            "A contact that slides resists at most as much as one that holds.",
        )


def _pair(world: World, number: int, entry: Sequence[object]) -> tuple[int, int, tuple[float, float]]:
    """Objects and both coefficients of an entry of `pairs`."""
    key = f"effects.friction.pairs[{number}]"
    if isinstance(entry, str) or not isinstance(entry, Sequence) or len(entry) not in (3, 4):
        raise InputError(f"{key} must be two names and a coefficient, or mu_static and mu_kinetic, not {entry!r}.")
    for name in entry[:2]:
        if name not in world.names:
            raise InputError(f"{key}: unknown object {name!r}.", f"Choose from: {', '.join(world.names)}.")
    a, b = (world.names.index(str(name)) for name in entry[:2])
    static, kinetic = (as_positive(key, entry[k], zero=True) for k in (2, -1))  # type: ignore[arg-type]
    _check_order(key, static, kinetic)
    return a, b, (static, kinetic)
