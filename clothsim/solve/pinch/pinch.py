"""Pinch policy "carry": cloth between two closing parts of bodies follows one of them until the pinch opens.

After Baraff, Witkin & Kass 2003, "Untangling cloth", section on pinches (flypapering). Before each step the vertices
about which a gap between opposing body surfaces will close are found (`pinch_gaps`); each is fixed to a triangle of the
part that it is closer to (`pinch_parts`), as a Dirichlet condition of the step, and its contact with the other part
is suspended (`candidate_subsets`). Where the pinch has opened they are raised until nothing intersects, then released
(`pinch_release`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.mesh.world import World
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.contact.candidate_subsets import SuspendedCandidates, Suspension
from clothsim.physics.contact.opposing import faces_of
from clothsim.solve.pinch.carried import (
    MEMORY,
    NONE_CARRIED,
    WIDENING,
    Carried,
    CarriedVertices,
    attached,
    carried_in,
    normals,
    with_bodies,
)
from clothsim.solve.pinch.pinch_gaps import Nearest, Sides, gaps_of, nearest, pinched
from clothsim.solve.pinch.pinch_release import OPEN, Opening, still_carried
from clothsim.solve.pinch.pinch_squeezed import squeezed
from clothsim.solve.stepping.state import State
from clothsim.solve.stepping.stepping import Integrator, StepReport, advance

# Parts of bodies at a pinch: the carrier of each vertex, and the patch of the body that is its own.

SAME_PINCH = 4.0
"""Distance within which a vertex is carried by the part that carries its neighbour, in median cloth edges."""
MUCH_MORE = 1.5
"""Ratio of the displacements of two parts in a step from which on they are not alike."""
OWN_PATCH = 2.5
"""Radius of the patch about a carrier with which contact goes on, in longest cloth edges."""
FACES_AWAY = -0.3
"""Cosine of the normals from which on a triangle does not belong to the patch of a carrier."""


def median_and_longest_edge(world: World, x: Floats) -> tuple[float, float]:
    """Median and largest length of the cloth edges at x [m]."""
    lengths = np.linalg.norm(x[world.edges[:, 1]] - x[world.edges[:, 0]], axis=1)
    return float(np.median(lengths)), float(lengths.max())


def with_carriers(world: World, x: Floats, end: Floats, found: Sides, known: Carried) -> Carried:
    """Carry the vertices of a pinch from where they are.

    The vertex in the narrowest gap is carried by the part that moves less against the whole cloth, of two alike by the
    one that it is closer to, and those about it by the same part: cloth that two parts carried would be torn where they
    slide along one another.

    Parameters
    ----------
    world : World
        Meshes.
    x, end : (N, 3) array
        At the start of the step, and as it would end: the bodies there, the cloth with its velocity [m].
    found : Sides
        The pinch, without vertices of `known`.
    known : Carried
        Carried already.
    """
    if not len(found.vertices):
        return known
    near, far = normals(x, found.near), normals(x, found.far)
    at, reach = x[found.vertices], SAME_PINCH * median_and_longest_edge(world, x)[0]
    distance, along = np.full(len(at), np.inf), near.copy()
    if len(known):
        distance, nearest = cKDTree(x[known.vertices]).query(at)
        along = normals(x, known.triangles)[nearest]
    takes_near, left = _moves_less(world, end - x, found), np.ones(len(at), bool)
    for _ in range(len(at)):
        rank = np.where(left, distance, np.inf)
        k = int(rank.argmin())
        if not rank[k] <= reach:
            k = int(np.where(left, found.gaps, np.inf).argmin())
        else:
            takes_near[k] = near[k] @ along[k] >= far[k] @ along[k]
        left[k] = False
        normal = near[k] if takes_near[k] else far[k]
        closer = np.linalg.norm(at - at[k], axis=1)
        distance, along = (
            np.where(closer < distance, closer, distance),
            np.where((closer < distance)[:, None], normal, along),
        )
    takes = takes_near[:, None]
    carrier = np.where(takes, found.near, found.far), np.where(takes, found.near_weights, found.far_weights)
    other = np.where(takes, found.far, found.near), np.where(takes, found.far_weights, found.near_weights)
    return known.joined(attached(x, found.vertices, carrier, other))


def _moves_less(world: World, moves: Floats, found: Sides) -> np.ndarray:
    """Mask (k,) of the vertices whose nearer part moves less against the cloth than the other, or about as much."""
    common = moves[: world.n_cloth].mean(axis=0)
    parts = (found.near, found.near_weights), (found.far, found.far_weights)
    near, far = (np.linalg.norm(np.einsum("kc,kcd->kd", w, moves[rows]) - common, axis=1) for rows, w in parts)
    return np.asarray(near <= MUCH_MORE * far)


def own_rows(world: World, x: Floats, carried: Carried) -> Ints:
    """Sorted keys v N + q of the body rows q of the patch about the carrier of each carried row v.

    The patch grows from the triangle over common edges, as far as OWN_PATCH and while the normals do not face away.
    """
    triangles = world.body_triangles
    unit, centres = normals(x, triangles), x[triangles].mean(axis=1)
    radii = np.linalg.norm(x[triangles] - centres[:, None], axis=2).max(axis=1)
    radius = OWN_PATCH * median_and_longest_edge(world, x)[1]
    starts = _faces(triangles, carried.triangles, len(x))
    points, across = carried.points(x), _adjacent(triangles, len(x))
    seen = front = np.arange(len(carried)) * len(triangles) + starts
    while len(front):
        of, face = np.repeat(front // len(triangles), 3), across[front % len(triangles)].ravel()
        of, face = of[face >= 0], face[face >= 0]
        closer = np.linalg.norm(centres[face] - points[of], axis=1) - radii[face] <= radius
        ahead = np.einsum("kd,kd->k", unit[face], unit[starts[of]]) > FACES_AWAY
        keys = (of * len(triangles) + face)[closer & ahead]
        front = np.setdiff1d(keys, seen)
        seen = np.union1d(seen, front)
    rows = triangles[seen % len(triangles)]
    return np.unique(carried.vertices[seen // len(triangles)][:, None] * len(x) + rows)


def _faces(triangles: Ints, wanted: Ints, size: int) -> Ints:
    """Indices of the `wanted` (k, 3) among the triangles (m, 3), whose rows are below `size`."""
    keys, sought = ((each[:, 0] * size + each[:, 1]) * size + each[:, 2] for each in (triangles, wanted))
    order = np.argsort(keys)
    return np.asarray(order[np.searchsorted(keys[order], sought)])


def _adjacent(triangles: Ints, size: int) -> Ints:
    """Triangle across each edge, (m, 3); -1 at a border, and where more than two meet."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    keys = edges[:, 0] * size + edges[:, 1]
    order = np.argsort(keys, kind="stable")
    _, first, counts = np.unique(keys[order], return_index=True, return_counts=True)
    pairs = first[counts == 2]
    across = np.full(len(keys), -1)
    across[order[pairs]], across[order[pairs + 1]] = order[pairs + 1] // 3, order[pairs] // 3
    return across.reshape(-1, 3)


ATTEMPTS = 4
"""Largest number of tries of a step, each but the first with twice the limit, and more vertices carried."""
WIDER = 4.0
"""Factor on the limit within which the opposing surface of a squeezed vertex is looked for."""
NONE = np.zeros(0, np.int64)


@dataclass(frozen=True)
class _Attempt:
    """A try of a step: factor on the limit, further rows to carry, and whether own patches and layers keep contact."""

    widening: float
    rows: Ints
    own: bool


def advance_carrying(integrator: Integrator, state: State, until: float) -> tuple[StepReport, Integrator]:
    """Take one step from `state`, at most to `until` [s], with the vertices in a pinch carried.

    Returns
    -------
    StepReport
        As of `stepping.advance`; its state remembers the carried vertices.
    Integrator
        The integrator of that step, with the carried vertices among its constraints.
    """
    left = until - state.time
    end = state.time + left / max(1, int(np.ceil(left / state.dt - 1e-9)))
    widening = float(state.memory.get(WIDENING, 1.0))
    attempt = _Attempt(widening, NONE, own=widening == 1.0)
    before = None
    for _ in range(ATTEMPTS):
        carried = _carried(integrator, state, end, attempt)
        if before is not None and np.array_equal(carried.vertices, before.vertices) and not len(carried):
            break
        bound = _carrying(integrator, state, carried, attempt.own)
        report = advance(bound, state, until)
        _count(integrator, bound)
        held = carried.mask(len(state.positions))
        if report.converged:
            rows = _crossing(integrator, report.state.positions, held)
            if not len(rows):
                break
        else:
            rows = squeezed(integrator.world, report.potential.energies, report.result.x, held)
        if not len(rows) and not len(carried):
            break
        before, attempt = carried, _Attempt(2.0 * attempt.widening, np.union1d(attempt.rows, rows), own=False)
    if report.converged and len(carried):
        memory = {**report.state.memory, MEMORY: carried.as_array(), WIDENING: attempt.widening}
        report = replace(report, state=replace(report.state, memory=memory))
    return report, bound


def _barriers(integrator: Integrator) -> dict[str, Barrier]:
    energies = integrator.potential.energies
    return {name: each for name in ("body_contact", "self_contact") if isinstance(each := energies.get(name), Barrier)}


def _carried(integrator: Integrator, state: State, end: float, attempt: _Attempt) -> Carried:
    """The vertices that are carried in the step from `state` to `end` [s]."""
    world, x, known = integrator.world, state.positions, carried_in(state.memory)
    after, barriers = with_bodies(world, x, end), _barriers(integrator)
    bodies = np.arange(world.n_cloth, world.n_vertices - len(world.ghosts))
    moves = after[bodies] - x[bodies]
    if not len(known) and not moves.any():
        return NONE_CARRIED
    body = barriers["body_contact"]
    limit = attempt.widening * (2.0 * body.offset + body.d_hat)
    relative = float(np.linalg.norm(moves - moves.mean(axis=0), axis=1).max())
    reach = OPEN * limit + 2.0 * relative
    faces = faces_of(body.candidates.search.surface, x)
    if len(known):
        gaps = [gaps_of(known, faces, world, each, OPEN * limit, reach) for each in (x, after)]
        known = still_carried(known, Opening(world, barriers, x, faces, np.minimum(*gaps), limit))
    fixed = _fixed(integrator, state)
    near = nearest(faces, x, np.arange(world.n_cloth), reach)
    found = pinched(faces, near, x, after, limit, reach).without(np.concatenate([known.vertices, fixed]))
    ahead = after.copy()
    ahead[: world.n_cloth] += (end - state.time) * state.velocities[: world.n_cloth]
    carried = with_carriers(world, x, ahead, found, known)
    if not len(attempt.rows):
        return carried
    near = near.only(attempt.rows)
    wider = pinched(faces, near, x, after, WIDER * limit, reach).without(np.concatenate([carried.vertices, fixed]))
    carried = with_carriers(world, x, ahead, wider, carried)
    return carried.joined(_by_closest(x, near.without(np.concatenate([carried.vertices, fixed]))))


def _by_closest(x: Floats, near: Nearest) -> Carried:
    """Carry vertices by the closest body triangle."""
    part = near.triangles, near.weights
    return attached(x, near.vertices, part, part)


def _fixed(integrator: Integrator, state: State) -> Ints:
    """Cloth rows that the scene prescribes."""
    held = [constraint.at(state.time).vertices for constraint in integrator.constraints.values()]
    return np.concatenate([NONE, *held])


def _carrying(integrator: Integrator, state: State, carried: Carried, own: bool) -> Integrator:
    """The integrator with these vertices carried; itself where there are none."""
    if not len(carried):
        return integrator
    world, x = integrator.world, state.positions
    patch = own_rows(world, x, carried) if own else NONE
    suspension = Suspension(carried.mask(len(x)), patch, layers=not own)
    energies = dict(integrator.potential.energies)
    energies |= {
        name: replace(each, candidates=SuspendedCandidates(each.candidates, suspension))
        for name, each in _barriers(integrator).items()
    }
    constraints = {**integrator.constraints, "contact.pinch": CarriedVertices(world, carried)}
    return replace(integrator, potential=replace(integrator.potential, energies=energies), constraints=constraints)


def _crossing(integrator: Integrator, x: Floats, held: np.ndarray) -> Ints:
    """Free cloth rows of triangles that intersect at x without being exempt: carried layers may force them through.

    Exempt are triangles with a carried vertex against bodies, and two such triangles.
    """
    if not held.any():
        return NONE
    world, barriers = integrator.world, _barriers(integrator)
    some = np.asarray(held[world.triangles].any(axis=1))
    pairs = intersecting_pairs(x, world.triangles[~some], world.body_triangles)
    rows = [world.triangles[~some][pairs[:, 0]].ravel()]
    if "self_contact" in barriers:
        pairs = intersecting_pairs(x, world.triangles)
        rows.append(world.triangles[pairs[~some[pairs].all(axis=1)]].ravel())
    return np.setdiff1d(np.concatenate(rows), np.flatnonzero(held))


def _count(integrator: Integrator, bound: Integrator) -> None:
    """Add the work of the step's candidates to the counters of the run."""
    for name, barrier in _barriers(integrator).items():
        own = _barriers(bound)[name].candidates
        if isinstance(own, SuspendedCandidates):
            own.count_for(barrier.candidates)


def carried_by(world: World, memory: Mapping[str, Floats | float]) -> np.ndarray:
    """Mask of the cloth vertices that a state remembers as carried, (n_cloth,)."""
    return carried_in(memory).mask(world.n_cloth)
