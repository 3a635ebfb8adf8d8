"""Pinch policy "carry": cloth between two closing parts of bodies follows one of them until the pinch opens.

After Baraff, Witkin & Kass 2003, "Untangling cloth", section on pinches (flypapering). Before each step the vertices
about which a gap between opposing body surfaces will close are found (`pinch_gaps`); each is fixed to a triangle of one
of the two parts (`with_supports`), as a Dirichlet condition of the step, and its contact with the other is
excluded (`contact.candidate_subsets`). Where the pinch has opened they are raised until nothing intersects, then
released.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.mesh.world import World
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.contact.candidate_subsets import ExclusionMask, MaskedCandidates
from clothsim.physics.energies.base import Energy
from clothsim.solve.newton.outcome import Ending
from clothsim.solve.pinch.flypaper import (
    EASE,
    MEMORY,
    NONE_FLYPAPERED,
    WIDENING,
    Flypapered,
    FlypaperedPositions,
    attached,
    flypapered_in,
    median_and_longest_edge,
    own_rows,
    with_bodies,
)
from clothsim.solve.pinch.pinch_gaps import (
    INSIDE,
    LEAST,
    Faces,
    PinchedVertices,
    faces_of,
    line_hits,
    nearest_faces,
    normals,
    pinched,
    sides,
)
from clothsim.solve.stepping.state import State
from clothsim.solve.stepping.stepping import Integrator, StepReport, advance

ATTEMPTS = 4
"""Largest number of tries of a step, each but the first with twice the limit, and more vertices flypapered."""
MOST_REMEMBERED = 2.0
"""Largest factor on the limit with which the next step begins: one that grew with each block would never release."""
WIDER = 4.0
"""Factor on the limit within which the opposing surface of a squeezed vertex is looked for."""
NONE = np.zeros(0, np.int64)
CONTACTS = "body_contact", "self_contact"


@dataclass(frozen=True)
class _Attempt:
    """A try of a step: factor on the limit, further rows to carry, and whether own patches and layers keep contact."""

    widening: float
    rows: Ints
    own: bool


def advance_flypapering(integrator: Integrator, state: State, until: float) -> tuple[StepReport, Integrator]:
    """Take one step from `state`, at most to `until` [s], with the vertices in a pinch flypapered.

    Returns
    -------
    StepReport
        As of `stepping.advance`; its state remembers the flypapered vertices.
    Integrator
        The integrator of that step, with the flypapered vertices among its constraints.
    """
    left = until - state.time
    end = state.time + left / max(1, int(np.ceil(left / state.dt - 1e-9)))
    widening = float(state.memory.get(WIDENING, 1.0))
    attempt = _Attempt(widening, NONE, own=widening == 1.0)
    before: Flypapered | None = None
    failures: tuple[str, ...] = ()
    for number in range(ATTEMPTS):
        flypapered = _find_flypapered(integrator, state, end, attempt)
        if before is not None and np.array_equal(flypapered.vertices, before.vertices) and not len(flypapered):
            break
        held, bound = None, integrator
        if len(flypapered):
            patch = own_rows(integrator.world, state.positions, flypapered) if attempt.own else NONE
            exclusion = ExclusionMask(flypapered.mask(len(state.positions)), patch, layers=not attempt.own)
            limit = attempt.widening * pinch_gap(_barriers(integrator)["body_contact"])
            held = FlypaperedPositions(integrator.world, flypapered, exclusion, limit, attempt.widening, end)
            bound = with_flypapered(integrator, held)
        report = advance(bound, state, until, retries=number > 0)
        rows = _pinched_rows(integrator, report, flypapered)
        blocked = report.result.outcome.ending is Ending.BLOCKED
        if number == 0 and not report.converged and not (blocked and len(rows)):
            report = advance(bound, state, until)  # no pinch: shorter steps
            rows = _pinched_rows(integrator, report, flypapered)
        report = replace(report, failures=(*failures, *report.failures))
        for name, barrier in _barriers(integrator).items():  # the run counts the work of the step's candidates
            own = _barriers(bound)[name].candidates
            if isinstance(own, MaskedCandidates):
                own.count_for(barrier.candidates)
        if not len(rows) and (report.converged or not len(flypapered)):
            break
        before, failures = flypapered, report.failures
        attempt = _Attempt(2.0 * attempt.widening, np.union1d(attempt.rows, rows), own=False)
    if report.converged and held is not None:
        report = remembering(report, held, attempt.widening)
    return report, bound


def _pinched_rows(integrator: Integrator, report: StepReport, flypapered: Flypapered) -> Ints:
    """Rows that keep a try from being taken: squeezed where it failed, or free and of triangles that cross at its end.

    Flypapered layers may force free cloth through others.
    """
    world, barriers, held = integrator.world, _barriers(integrator), flypapered.mask(len(report.result.x))
    if not report.converged:
        return squeezed(world, report.potential.energies, report.result.x, held)
    if not held.any():
        return NONE
    # exempt are triangles with a flypapered vertex against bodies, and two such triangles
    x, some = report.state.positions, np.asarray(held[world.triangles].any(axis=1))
    pairs = intersecting_pairs(x, world.triangles[~some], world.body_triangles)
    rows = [world.triangles[~some][pairs[:, 0]].ravel()]
    if "self_contact" in barriers:
        pairs = intersecting_pairs(x, world.triangles)
        rows.append(world.triangles[pairs[~some[pairs].all(axis=1)]].ravel())
    return np.setdiff1d(np.concatenate(rows), np.flatnonzero(held))


def _barriers(integrator: Integrator) -> dict[str, Barrier]:
    energies = integrator.potential.energies
    return {name: each for name in CONTACTS if isinstance(each := energies.get(name), Barrier)}


def _find_flypapered(integrator: Integrator, state: State, end: float, attempt: _Attempt) -> Flypapered:
    """The vertices that are flypapered in the step from `state` to `end` [s]."""
    world, x, known = integrator.world, state.positions, flypapered_in(state.memory)
    after, barriers = with_bodies(world, x, end), _barriers(integrator)
    bodies = np.arange(world.n_cloth, world.n_vertices - len(world.ghosts))
    moves = after[bodies] - x[bodies]
    if not len(known) and not moves.any():
        return NONE_FLYPAPERED
    body = barriers["body_contact"]
    limit = attempt.widening * pinch_gap(body)
    relative = float(np.linalg.norm(moves - moves.mean(axis=0), axis=1).max())
    reach = OPEN * limit + 2.0 * relative
    faces = faces_of(body.candidates.search.surface, x)
    if len(known):
        gaps = [gaps_of(known, faces, world, each, OPEN * limit, reach) for each in (x, after)]
        known = still_flypapered(known, Opening(world, barriers, x, faces, np.minimum(*gaps), limit))
    # cloth rows that the scene prescribes
    held = [constraint.at(state.time).vertices for constraint in integrator.constraints.values()]
    fixed = np.concatenate([NONE, *held])
    near = nearest_faces(faces, x, np.arange(world.n_cloth), reach)
    found = pinched(faces, near, x, after, limit, reach).without(np.concatenate([known.vertices, fixed]))
    ahead = after.copy()
    ahead[: world.n_cloth] += (end - state.time) * state.velocities[: world.n_cloth]
    flypapered = with_supports(world, x, ahead, found, known)
    if not len(attempt.rows):
        return flypapered
    near = near.only(attempt.rows)
    wider = pinched(faces, near, x, after, WIDER * limit, reach).without(np.concatenate([flypapered.vertices, fixed]))
    flypapered = with_supports(world, x, ahead, wider, flypapered)
    near = near.without(np.concatenate([flypapered.vertices, fixed]))
    closest = near.triangles, near.weights
    return flypapered.joined(attached(x, near.vertices, closest, closest))


def masked(energies: Mapping[str, Energy], exclusion: ExclusionMask) -> dict[str, Energy]:
    """Return energies whose contacts leave out the excluded pairs."""
    return {
        name: replace(each, candidates=MaskedCandidates(each.candidates, exclusion))
        if name in CONTACTS and isinstance(each, Barrier)
        else each
        for name, each in energies.items()
    }


def with_flypapered(integrator: Integrator, held: FlypaperedPositions) -> Integrator:
    """Return the integrator of a step with flypapered vertices."""
    energies = masked(integrator.potential.energies, held.exclusion)
    constraints = {**integrator.constraints, MEMORY: held}
    return replace(integrator, potential=replace(integrator.potential, energies=energies), constraints=constraints)


def remembering(report: StepReport, held: FlypaperedPositions, widening: float) -> StepReport:
    """Return the report of a step with its flypapered vertices in the memory of its end, for the next one."""
    memory = {**report.state.memory, MEMORY: held.flypapered.as_array(), WIDENING: min(widening, MOST_REMEMBERED)}
    return replace(report, state=replace(report.state, memory=memory))


def pinch_gap(body: Barrier) -> float:
    """Return the gap of the body below which a pinch closes, not widened [m]."""
    return 2.0 * body.offset + body.d_hat


def flypapered_mask(world: World, memory: Mapping[str, Floats | float]) -> np.ndarray:
    """Mask of the cloth vertices that a state remembers as flypapered, (n_cloth,)."""
    return flypapered_in(memory).mask(world.n_cloth)


def gaps_of(flypapered: Flypapered, faces: Faces, world: World, x: Floats, limit: float, reach: float) -> Floats:
    """Gaps in front of the triangles that support vertices, at x (N, 3), (k,) [m].

    -inf where the parts have crossed, or the triangle is inside another part of the bodies; inf where nothing is in
    front of it within `reach` [m].
    """
    points, along = flypapered.points(x), normals(x, flypapered.triangles)
    gaps = line_hits(faces, x, flypapered.vertices, (points, along), (LEAST * limit, reach), entering=True)
    wide = np.flatnonzero(gaps >= limit)
    inside = sides(x, points[wide], along[wide], world.body_triangles, LEAST * limit) == INSIDE
    gaps[wide[inside]] = -np.inf
    gaps[flypapered.far_heights(x) < -LEAST * limit] = -np.inf
    return gaps


# Parts of bodies at a pinch: which of the two holds each vertex.

SAME_PINCH = 4.0
"""Distance within which a vertex is held by the part that carries its neighbour, in median cloth edges."""
MUCH_MORE = 1.5
"""Ratio of the displacements of two parts in a step from which on they are not alike."""
OWN_PART = 2.0
"""Ratio of the distances of two points at the start of the run from which on a vertex is of the part of the nearer."""


def with_supports(world: World, x: Floats, end: Floats, found: PinchedVertices, known: Flypapered) -> Flypapered:
    """Carry the vertices of a pinch from where they are.

    Of the two points between which a vertex is pinched, one may have been much nearer to it at the start of the run:
    its part holds the vertex. So the trunk holds the side of a shirt, also where an arm turns back and both move alike.
    Among other vertices, that in the narrowest gap is held by the part that moves less against the whole cloth; where
    both move about alike, by the closer one. Those about it are held by the same part: cloth on two parts would be torn
    where they slide along one another.

    Parameters
    ----------
    world : World
        Meshes.
    x, end : (N, 3) array
        At the start of the step, and as it would end: the bodies there, the cloth with its velocity [m].
    found : PinchedVertices
        The pinch, without vertices of `known`.
    known : Flypapered
        Flypapered already.
    """
    if not len(found.vertices):
        return known
    near, far = normals(x, found.near), normals(x, found.far)
    at, reach = x[found.vertices], SAME_PINCH * median_and_longest_edge(world, x)[0]
    distance, along = np.full(len(at), np.inf), near.copy()
    if len(known):
        distance, nearest = cKDTree(x[known.vertices]).query(at)
        along = normals(x, known.triangles)[nearest]
    moves = end - x
    common, left = moves[: world.n_cloth].mean(axis=0), np.ones(len(at), bool)
    parts = (found.near, found.near_weights), (found.far, found.far_weights)
    slow, fast = (np.linalg.norm(np.einsum("kc,kcd->kd", w, moves[rows]) - common, axis=1) for rows, w in parts)
    takes_near = slow <= MUCH_MORE * fast  # the nearer part moves less against the cloth, or about as much
    begun = world.start()
    for body, rows in zip(world.bodies, world.body_slices, strict=True):
        begun[rows] = body.positions  # also where a body is moved by hand
    points = (np.einsum("kc,kcd->kd", w, begun[rows]) for rows, w in parts)
    from_near, from_far = (np.linalg.norm(begun[found.vertices] - point, axis=1) for point in points)
    is_of_near, is_of_far = OWN_PART * from_near <= from_far, OWN_PART * from_far <= from_near
    takes_near = (takes_near | is_of_near) & ~is_of_far
    for _ in range(len(at)):
        rank = np.where(left, distance, np.inf)
        k = int(rank.argmin())
        if not rank[k] <= reach:
            k = int(np.where(left, found.gaps, np.inf).argmin())
        elif not (is_of_near[k] or is_of_far[k]):
            takes_near[k] = near[k] @ along[k] >= far[k] @ along[k]
        left[k] = False
        normal = near[k] if takes_near[k] else far[k]
        closer = np.linalg.norm(at - at[k], axis=1)
        distance, along = (
            np.where(closer < distance, closer, distance),
            np.where((closer < distance)[:, None], normal, along),
        )
    takes = takes_near[:, None]
    support = np.where(takes, found.near, found.far), np.where(takes, found.near_weights, found.far_weights)
    other = np.where(takes, found.far, found.near), np.where(takes, found.far_weights, found.near_weights)
    return known.joined(attached(x, found.vertices, support, other))


# Release of flypapered vertices where a pinch opens: displaced along the normals of the supporting triangles.


OPEN = 1.5
"""Gap from which a pinch counts as open, over the gap below which it closes."""
LEAST_HEIGHT = 0.25
"""Height above the supporting triangle below which no vertex is released, in units of d_hat: the barrier would throw
it out."""
LEAST_GAP = 0.02
"""Gap below which no pair is taken up again, in units of d_hat."""


@dataclass(frozen=True)
class Opening:
    """What a release needs to know of a step.

    barriers: contacts of bodies and of cloth; faces: body triangles; gaps (k,): in front of the flypapered
    vertices [m]; limit: gap of a pinch [m].
    """

    world: World
    barriers: Mapping[str, Barrier]
    x: Floats
    faces: Faces
    gaps: Floats
    limit: float


def still_flypapered(flypapered: Flypapered, opening: Opening) -> Flypapered:
    """Return those that stay flypapered; where the pinch is open they are raised towards the middle of the gap."""
    body, limit, gaps = opening.barriers["body_contact"], opening.limit, opening.gaps
    is_open = gaps >= OPEN * limit
    heights = flypapered.offsets[:, 2]
    free = is_open & (heights >= body.offset + LEAST_HEIGHT * body.d_hat)
    for _ in range(len(flypapered) + 1):
        if not free.any():
            break
        blocked = np.isin(flypapered.vertices, _tangled(flypapered.only(~free), flypapered.vertices[free], opening))
        if not (blocked & free).any():
            break
        free &= ~blocked
    middle = 0.5 * np.minimum(gaps, 4.0 * limit)
    raised = np.where(is_open, np.clip(middle - heights, -EASE * limit, EASE * limit), 0.0)
    return flypapered.raised(raised).only(~free)


def _tangled(remaining: Flypapered, released: Ints, opening: Opening) -> Ints:
    """Rows of x whose release would leave something intersecting, or closer than contact allows."""
    x, world = opening.x, opening.world
    held = remaining.mask(len(x))
    whole = world.triangles[~held[world.triangles].any(axis=1)]
    touched = whole[np.isin(whole, released).any(axis=1)]
    rows = [touched[intersecting_pairs(x, touched, world.body_triangles)[:, 0]].ravel()]
    edges = world.edges[np.isin(world.edges, released).any(axis=1) & ~held[world.edges].any(axis=1)]
    ends = np.concatenate([edges, edges[:, ::-1]])
    lines = x[ends[:, 0]], x[ends[:, 1]] - x[ends[:, 0]]
    hits = line_hits(opening.faces, x, np.ascontiguousarray(ends[:, 0]), lines, (0.0, 1.0), entering=False)
    rows.append(ends[np.isfinite(hits)].ravel())
    exclusion = ExclusionMask(held, np.zeros(0, np.int64))
    for name, barrier in opening.barriers.items():
        if name == "self_contact":
            both = intersecting_pairs(x, world.triangles)
            partly = np.asarray(held[world.triangles].any(axis=1))[both].all(axis=1)
            rows.append(world.triangles[both[~partly]].ravel())
        pairs, distances = barrier.candidates.search.pairs(x, x, barrier.offset + LEAST_GAP * barrier.d_hat)
        taken_up = ~exclusion.mask(pairs.elements, pairs.n_points, name == "self_contact")
        rows.append(pairs.elements[taken_up & (distances <= barrier.offset + LEAST_GAP * barrier.d_hat)].ravel())
    return np.unique(np.concatenate(rows))


# Squeezed vertices of a failed step: cloth with active contacts that push it from opposite sides.


TIGHT = 0.2
"""Gap below which a contact counts as squeezed, in units of d_hat."""
OPPOSITE = -0.3
"""Cosine of two directions of contact below which they oppose one another."""
RADIUS = 2.0
"""Distance within which they belong to one pinch, in median cloth edges."""


def squeezed(world: World, energies: Mapping[str, Energy], x: Floats, flypapered: np.ndarray) -> Ints:
    """Rows of x of cloth vertices at contacts that oppose one another, and their neighbours.

    One of the two is with a body, or with cloth that a body carries.

    Parameters
    ----------
    world : World
        Meshes.
    energies : mapping
        Energies bound to the step.
    x : (N, 3) array
        Where the step ended [m].
    flypapered : (N,) bool array
        Flypapered rows of x.
    """
    rows, places, directions, bodies = [], [], [], []
    for name in ("body_contact", "self_contact"):
        energy = energies.get(name)
        if isinstance(energy, Barrier):
            for each, place, direction, partners in _contacts(energy, x, world.n_cloth):
                rows.append(each)
                places.append(place)
                directions.append(direction)
                bodies.append((name == "body_contact") | (flypapered[partners] & (partners >= 0)).any(axis=1))
    if not sum(len(each) for each in rows):
        return np.zeros(0, np.int64)
    of_pair, at, along, with_body = (np.concatenate(each) for each in (rows, places, directions, bodies))
    ends = x[world.edges]
    edge = float(np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
    i, j = cKDTree(at).query_pairs(RADIUS * edge, output_type="ndarray").T
    opposed = (np.einsum("kd,kd->k", along[i], along[j]) < OPPOSITE) & (with_body[i] | with_body[j])
    found = np.unique(of_pair[np.concatenate([i[opposed], j[opposed]])])
    found = found[(found >= 0) & (found < world.n_cloth)]
    return np.unique(world.edges[np.isin(world.edges, found).any(axis=1)])


def _contacts(barrier: Barrier, x: Floats, n_cloth: int) -> list[tuple[Ints, Floats, Floats, Ints]]:
    """Cloth rows (p, 4) of tight contacts, their places and directions (p, 3), and rows (p, 4) of their partners.

    -1 in the place of rows of the other side.
    """
    elements, weights, lines, _ = barrier.normal_forces(x, barrier.stiffness)
    gaps = np.linalg.norm(lines, axis=1)
    tight = gaps - barrier.offset < TIGHT * barrier.d_hat
    elements, weights, lines = elements[tight], weights[tight], lines[tight] / gaps[tight, None]
    contacts = []
    for sign in (1.0, -1.0):
        on_side = (sign * weights > 0.0) & (elements < n_cloth)
        some = on_side.any(axis=1)
        place = np.einsum("pk,pkd->pd", np.where(on_side, np.abs(weights), 0.0), x[elements])
        partners = np.where(sign * weights < 0.0, elements, -1)
        contacts.append((np.where(on_side, elements, -1)[some], place[some], sign * lines[some], partners[some]))
    return contacts
