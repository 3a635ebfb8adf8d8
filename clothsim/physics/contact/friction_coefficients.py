"""Coefficients and scales of friction from the keys of a scene: the effect `friction`."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import Friction
from clothsim.mesh.world import World
from clothsim.physics.contact.anchors import NO_ANCHORS
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example, Idle

ELASTIC_SLIP = 1e-5
"""Largest elastic slip of an anchor as a fraction of the cloth's size: micrometres for a cloth of a metre."""


def friction(world: World, keys: Friction, *, contacts: Sequence[str] = ()) -> Energy | Off:
    """Coulomb friction of every contact; off where the scene has none, or every coefficient is 0.

    Contacts hold by anchors; with eps_v they creep below that speed instead (the friction of IPC).

    Raises
    ------
    InputError
        A name of a pair is unknown, or both elastic_slip and eps_v are given.

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
    static, kinetic = coefficient_tables(world, keys)
    if not static.any():
        return Off("every coefficient is 0")
    if not contacts:
        return Off("the scene has no contact")
    size = max(float(np.linalg.norm(np.ptp(each.positions, axis=0))) for each in world.cloths or world.rigid)
    speed, slip = 0.0, ELASTIC_SLIP * size if isinstance(keys.elastic_slip, str) else keys.elastic_slip
    if not isinstance(keys.eps_v, str):
        if keys.elastic_slip != "auto" or (static != kinetic).any():
            other = "elastic_slip" if keys.elastic_slip != "auto" else "different mu_static and mu_kinetic"
            raise InputError(
                f"effects.friction has both eps_v and {other}.", "Leave eps_v out: contacts then hold by anchors."
            )
        speed, slip = keys.eps_v, 0.0
    from clothsim.physics.contact.friction import (  # after the last Off: no kernel for a zero
        NO_CONTACTS,
        FrictionEnergy,
    )

    none, rows = np.zeros((0, 3)), NO_ANCHORS.elements
    lagged = rows, NO_ANCHORS.weights, none, none, none, np.zeros(0), np.zeros(0, bool)
    at, passes = triangles_at(world), keys.iterations
    return FrictionEnergy(kinetic, static, world.labels, at, speed, slip, passes, NO_CONTACTS, NO_ANCHORS, *lagged)


def triangles_at(world: World) -> Ints:
    """Rows (N, 3) of a triangle at each vertex of a body; -1 for vertices of none, and of cloths."""
    found = np.full((world.n_vertices, 3), -1)
    found[world.body_triangles.ravel()] = np.repeat(world.body_triangles, 3, axis=0)
    return found


def coefficient_tables(world: World, keys: Friction) -> tuple[Floats, Floats]:
    """mu_static and mu_kinetic of each pair of objects, (L, L). InputError for an invalid value or name.

    A coefficient that is "auto" is `coefficient`; mu_kinetic is then at most mu_static.
    """
    static = keys.coefficient if isinstance(keys.mu_static, str) else keys.mu_static
    kinetic = min(keys.coefficient, static)
    if not isinstance(keys.mu_kinetic, str):
        kinetic = keys.mu_kinetic
        static = max(static, kinetic) if keys.mu_static == "auto" else static
    _check_order("effects.friction", static, kinetic)
    tables = np.full((2, len(world.names), len(world.names)), np.array([static, kinetic])[:, None, None])
    entries: dict[frozenset[int], int] = {}
    for number, entry in enumerate(keys.pairs):
        key = f"effects.friction.pairs[{number}]"
        if isinstance(entry, str) or not isinstance(entry, Sequence) or len(entry) not in (3, 4):
            raise InputError(f"{key} must be two names and a coefficient, or mu_static and mu_kinetic, not {entry!r}.")
        for name in entry[:2]:
            if name not in world.names:
                raise InputError(f"{key}: unknown object {name!r}.", f"Choose from: {', '.join(world.names)}.")
        a, b = (world.names.index(str(name)) for name in entry[:2])
        of_pair = [as_positive(key, entry[k], zero=True) for k in (2, -1)]  # type: ignore[arg-type]
        _check_order(key, *of_pair)
        first = entries.setdefault(frozenset((a, b)), number)
        if first != number:
            raise InputError(
                f"{key} repeats the pair {world.names[a]} and {world.names[b]} of pairs[{first}].",
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


EXAMPLE = Example(
    keys={"coefficient": 0.7, "elastic_slip": 3e-3},
    in_scene={},
    zero={"coefficient": 0},
    external=True,
    with_bodies=True,
    idle=Idle(always={"iterations": 3}, scene={"body": {"position": [0.0, 0.0, -50.0]}}),
)
