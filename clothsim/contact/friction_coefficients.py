"""Coefficients of friction of the pairs of objects: the effect `friction`."""

from collections.abc import Sequence

import numpy as np

from clothsim.arrays import as_count, as_positive
from clothsim.energies.base import Energy, Off
from clothsim.energies.example import Example, Idle
from clothsim.errors import InputError
from clothsim.mesh.world import World


def friction(
    world: World,
    *,
    coefficient: float = 0.3,
    pairs: Sequence[Sequence[object]] = (),
    eps_v: float | str = "auto",
    iterations: int = 1,
    contacts: Sequence[str] = (),
) -> Energy | Off:
    """Coulomb friction of every contact of the scene.

    Parameters
    ----------
    world : World
        Cloths and bodies.
    coefficient : float
        mu of the pairs of objects that `pairs` does not name.
    pairs : sequence of [name, name, mu]
        Coefficients of single pairs of objects.
    eps_v : float or "auto"
        Speed below which a contact counts as sticking [m/s]; "auto": a thousandth of the largest cloth a second.
    iterations : int
        Solves of a step, each with the normal forces of the last.
    contacts : sequence of str
        Names of the contact effects that are on.

    Returns
    -------
    Energy or Off
        Off where the scene has no contact or every coefficient is 0.

    Raises
    ------
    InputError
        A value is out of range or a name unknown.

    Examples
    --------
    >>> import clothsim
    >>> from clothsim.build.scene_world import build
    >>> cloth, ball = {"mesh": "rectangle", "position": [0, 0, 0.5]}, {"mesh": "sphere", "name": "ball"}
    >>> effects = {"body_contact": {}, "friction": {"coefficient": 0.3, "pairs": [["cloth", "ball", 0.1]]}}
    >>> build(clothsim.Scene(cloth=cloth, body=ball, effects=effects)).energies["friction"].coefficients
    array([[0.3, 0.1],
           [0.1, 0.3]])
    """
    table = np.full((len(world.names),) * 2, as_positive("effects.friction.coefficient", coefficient, zero=True))
    entries: dict[frozenset[int], int] = {}
    for number, entry in enumerate(pairs):
        a, b, mu = _pair(world, number, entry)
        first = entries.setdefault(frozenset((a, b)), number)
        if first != number:
            raise InputError(
                f"effects.friction.pairs[{number}] repeats the pair {world.names[a]} and {world.names[b]} of "
                f"pairs[{first}].",
                "Remove one of the two.",
            )
        table[a, b] = table[b, a] = mu
    if not table.any():
        return Off("every coefficient is 0")
    if not contacts:
        return Off("the scene has no contact")
    size = max(float(np.linalg.norm(np.ptp(cloth.positions, axis=0))) for cloth in world.cloths)
    speed = 1e-3 * size if eps_v == "auto" else as_positive("effects.friction.eps_v", eps_v)  # type: ignore[arg-type]
    lag_iterations = as_count("effects.friction.iterations", iterations)
    from clothsim.contact.friction import NO_CONTACTS, Friction  # after the last Off: no kernel is imported for a zero

    empty = np.zeros((0, 4))
    rows = empty.astype(np.int64)
    return Friction(table, world.labels, speed, lag_iterations, NO_CONTACTS, rows, empty, np.zeros((0, 3)), np.zeros(0))


def _pair(world: World, number: int, entry: Sequence[object]) -> tuple[int, int, float]:
    """Objects and coefficient of an entry of `pairs`."""
    key = f"effects.friction.pairs[{number}]"
    if isinstance(entry, str) or not isinstance(entry, Sequence) or len(entry) != 3:
        raise InputError(f"{key} must be two names and a coefficient, not {entry!r}.")
    for name in entry[:2]:
        if name not in world.names:
            raise InputError(f"{key}: unknown object {name!r}.", f"Choose from: {', '.join(world.names)}.")
    a, b = (world.names.index(str(name)) for name in entry[:2])
    return a, b, as_positive(key, entry[2], zero=True)  # type: ignore[arg-type]


EXAMPLE = Example(
    keys={"coefficient": 0.7, "eps_v": 0.3},
    in_scene={},
    zero={"coefficient": 0},
    external=True,
    with_bodies=True,
    idle=Idle(always={"iterations": 3}, scene={"body": {"position": [0.0, 0.0, -50.0]}}),
)
