"""Coefficients and scales of friction from the keys of a scene: the effect `friction`."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_count, as_positive
from clothsim.base.errors import InputError
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example, Idle

ELASTIC_SLIP = 1e-5
"""Largest elastic slip of an anchor as a fraction of the cloth's size: micrometres for a cloth of a metre."""


def friction(
    world: World,
    *,
    coefficient: float = 0.3,
    mu_static: float | str = "auto",
    mu_kinetic: float | str = "auto",
    pairs: Sequence[Sequence[object]] = (),
    elastic_slip: float | str = "auto",
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
    mu_static, mu_kinetic : float or "auto"
        Coefficients of contacts that hold and that slide; "auto": `coefficient`, and mu_kinetic at most mu_static.
    pairs : sequence of [name, name, mu] or [name, name, mu_static, mu_kinetic]
        Coefficients of single pairs of objects.
    elastic_slip : float or "auto"
        Displacement after which a contact that holds slides [m]; "auto": 1e-5 of the largest cloth.
    eps_v : float or "auto"
        Speed below which contacts creep in place of holding [m/s] (the friction of IPC); "auto": they hold.
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
        A value is out of range or a name unknown, or both elastic_slip and eps_v are given.

    Examples
    --------
    >>> import clothsim
    >>> from clothsim.scene.assembly.scene_world import build
    >>> cloth, ball = {"mesh": "rectangle", "position": [0, 0, 0.5]}, {"mesh": "sphere", "name": "ball"}
    >>> effects = {"body_contact": {}, "friction": {"mu_static": 0.3, "pairs": [["cloth", "ball", 0.2, 0.1]]}}
    >>> made = build(clothsim.Scene(cloth=cloth, body=ball, effects=effects)).energies["friction"]
    >>> made.static[0], made.kinetic[0]
    (array([0.3, 0.2]), array([0.3, 0.1]))
    """
    static, kinetic = coefficient_tables(world, coefficient, mu_static, mu_kinetic, pairs)
    if not static.any():
        return Off("every coefficient is 0")
    if not contacts:
        return Off("the scene has no contact")
    size = max(float(np.linalg.norm(np.ptp(cloth.positions, axis=0))) for cloth in world.cloths)
    speed, slip = _scales(size, eps_v, elastic_slip, bool((static != kinetic).any()))
    lag_iterations = as_count("effects.friction.iterations", iterations)
    from clothsim.physics.contact.friction import (  # after the last Off: no kernel for a zero
        NO_ANCHORS,
        NO_CONTACTS,
        Friction,
    )

    none, rows = np.zeros((0, 3)), NO_ANCHORS.elements
    lagged = rows, NO_ANCHORS.weights, none, none, none, np.zeros(0), np.zeros(0, bool)
    at = triangles_at(world)
    return Friction(kinetic, static, world.labels, at, speed, slip, lag_iterations, NO_CONTACTS, NO_ANCHORS, *lagged)


def triangles_at(world: World) -> Ints:
    """Rows (N, 3) of a triangle at each vertex of a body; -1 for vertices of none, and of cloths."""
    found = np.full((world.n_vertices, 3), -1)
    found[world.body_triangles.ravel()] = np.repeat(world.body_triangles, 3, axis=0)
    return found


def _scales(size: float, eps_v: float | str, elastic_slip: float | str, two: bool) -> tuple[float, float]:
    """eps_v [m/s] and the elastic slip [m], one of them 0, for cloth of `size` [m]; two: different coefficients."""
    if eps_v == "auto":
        key = "effects.friction.elastic_slip"
        return 0.0, ELASTIC_SLIP * size if elastic_slip == "auto" else as_positive(key, elastic_slip)  # type: ignore[arg-type]
    if elastic_slip != "auto" or two:
        other = "elastic_slip" if elastic_slip != "auto" else "different mu_static and mu_kinetic"
        raise InputError(
            f"effects.friction has both eps_v and {other}.", "Leave eps_v out: contacts then hold by anchors."
        )
    return as_positive("effects.friction.eps_v", eps_v), 0.0  # type: ignore[arg-type]


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


EXAMPLE = Example(
    keys={"coefficient": 0.7, "elastic_slip": 3e-3},
    in_scene={},
    zero={"coefficient": 0},
    external=True,
    with_bodies=True,
    idle=Idle(always={"iterations": 3}, scene={"body": {"position": [0.0, 0.0, -50.0]}}),
)
