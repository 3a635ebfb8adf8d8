"""Pieces of a pattern that go round the body: a bodice, trousers, a skirt, its levels; moved to where they belong.

Levels of a slanting skirt are drawn beside the legs that they go round. Trousers of a low rise are drawn with their top
at the waist and their crotch inside the pelvis. Tight cuffs are narrower when flat than the leg is thick: wherever
their front and back are placed, strings between them run through the leg. Drawn together they slip to one side of the
leg and close beside it, so that they begin closed round it.
"""

from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.triangles import unique_edges
from clothsim.garments.dress.closing import MOST, WITHIN, is_on_top, order_of
from clothsim.garments.dress.limbs import SIDES, Wearer, limb_names, limbs_between
from clothsim.garments.dress.placement import CHEST, hangs_on_shoulders, is_of_arm
from clothsim.garments.dress.sewing_state import SewingState, as_placed, crosses_body
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.penetration import penetrations
from clothsim.patterns import PatternMesh
from transfer.errors import TransferError
from transfer.signed_distance import BodySurface


def rings(state: SewingState, body: BodyMesh) -> list[tuple[str, ...]]:
    """Names of the panels that seams round the body join, piece by piece: a bodice, a skirt, each of its levels.

    Panels of arms and those sewn on top are left out.
    """
    panels = state.mesh.pattern.panels
    names = [name for name, panel in panels.items() if not is_of_arm(panel) and not is_on_top(panel)]
    label = {name: k for k, name in enumerate(names)}
    axes = np.stack([np.cross(body.up, body.front), body.up, body.front])
    for seam in state.mesh.seams:
        first, second = (side.panel for side in seam.stitch.sides)
        if not {first, second} <= label.keys() or order_of(seam, state) != WITHIN:
            continue
        # from the front to the back of a garment, or one that runs upward; others join what is below
        lines = state.mesh.positions[seam.pairs]
        apart = np.abs(axes @ (lines[:, 1] - lines[:, 0]).mean(axis=0))
        span = np.ptp(lines @ axes.T, axis=0).mean(axis=0)
        if apart.argmax() == 2 or span.argmax() == 1:
            old, new = label[second], label[first]
            label |= {name: new for name, number in label.items() if number == old}
    return [tuple(name for name in names if label[name] == number) for number in sorted(set(label.values()))]


def open_pairs_by_seam(state: SewingState, names: tuple[str, ...]) -> list[Ints]:
    """Pairs of each open seam between two of these panels, (k, 2)."""
    inside = set(names)
    return [
        state.pairs(seam)
        for seam in (state.mesh.seams[k] for k in state.open_seams)
        if {side.panel for side in seam.stitch.sides} <= inside and order_of(seam, state) == WITHIN
    ]


def open_pairs_of(state: SewingState, names: tuple[str, ...]) -> Ints:
    """Pairs of all open seams between two of these panels, (k, 2)."""
    return np.concatenate([np.zeros((0, 2), np.int64), *open_pairs_by_seam(state, names)])


def vertices_of(state: SewingState, names: tuple[str, ...]) -> Ints:
    """Vertices of the garment that these panels have, (k,)."""
    return np.unique(np.concatenate([state.number[state.mesh.vertices[name]] for name in names]))


BESIDE = 0.03
"""Distance from the body that a spring at the side of a tube keeps [m], and least displacement that is made."""
SLICE = 0.04
"""Half the height of the slice of the body that a spring must pass [m]."""


def centred(state: SewingState, body: BodyMesh) -> tuple[SewingState, tuple[str, ...]]:
    """State with each tube below the shoulders moved to the side until it is round the body; a note for each.

    Levels of a slanting skirt are drawn so far to one side that the strings of the other pass through a leg, or below
    the foot: drawn together they close round one leg. Such a tube moves until its strings from front to back pass the
    legs and the trunk equally far on both sides, those of a trouser leg this leg, and none is below the floor.
    """
    front = body.front
    right, middle = np.cross(body.up, front), body.middle
    limbs = limb_names(body)
    trunk = body.positions[~(np.char.endswith(limbs, "arm") | np.char.endswith(limbs, "hand"))]
    pieces = rings(state, body)
    of_legs = _on_trouser_legs(state, pieces, body)
    positions, notes = state.positions.copy(), []
    for names in pieces:
        rows, ends = vertices_of(state, names), state.positions[open_pairs_of(state, names)]
        ahead = (ends - middle) @ front
        ends = ends[ahead[:, 0] * ahead[:, 1] < 0]
        own = state.positions[rows]
        if not len(ends) or hangs_on_shoulders(own, body) or _borders(state, names) != TUBE:
            continue
        centre, beside = float(own.mean(axis=0) @ right), trunk
        if names in of_legs:
            beside = trunk[((trunk - middle) @ right > 0) == (centre > middle @ right)]
        at = ends.mean(axis=1)
        lacking = _lacking_beside(at, centre, beside, body.up, right)
        if names in of_legs and sum(lacking) > 0:  # narrower than the leg: off its middle, it closes beside it
            # mean of the middles of the leg at the levels of the springs [m]
            slices = [_slice_at(beside, level, body.up) @ right for level in at @ body.up]
            shift = float(np.mean([(part.min() + part.max()) / 2 for part in slices if len(part)])) - centre
        else:
            # after which both sides lack equally much: drawn together, a tube becomes round, and narrower than flat
            both = max(lacking) > 0 and np.isfinite(sum(lacking))
            shift = (lacking[0] - lacking[1]) / 2 if both else 0.0
        if abs(shift) < BESIDE:
            continue
        raised = max(float((trunk @ body.up).min() - (ends @ body.up).min()), 0.0)
        positions[rows] += shift * right + raised * body.up
        upward = f" and by {1e3 * raised:.0f} mm upward" if raised else ""
        side = f"{1e3 * abs(shift):.0f} mm to the {SIDES[int(shift < 0)]}"
        notes.append(f"{', '.join(names)} moved by {side}{upward}, to go round the body")
    return state.moved_to(positions), tuple(notes)


def _on_trouser_legs(state: SewingState, pieces: list[tuple[str, ...]], body: BodyMesh) -> set[tuple[str, ...]]:
    """Pieces below trousers, sewn to them or to one another: trousers have three borders and are not bodices."""
    level = {names: float((state.positions[vertices_of(state, names)] @ body.up).mean()) for names in pieces}
    piece = {name: names for names in pieces for name in names}
    sewn = [tuple(piece.get(side.panel) for side in seam.stitch.sides) for seam in state.mesh.seams]
    above = [
        names
        for names in pieces
        if _borders(state, names) > TUBE
        and not hangs_on_shoulders(state.positions[vertices_of(state, names)], body, level=CHEST)
    ]
    found: set[tuple[str, ...]] = set()
    while above:
        upper = above.pop()
        for pair in sewn:
            lower = pair[pair[0] == upper]
            if upper in pair and lower is not None and lower not in found and level[lower] < level[upper]:
                found.add(lower)
                above.append(lower)
    return found


def _lacking_beside(at: Floats, middle: float, body: Floats, up: Floats, right: Floats) -> tuple[float, float]:
    """What springs at points (k, 3) on both sides of a middle lack of passing beside a body (n, 3) [m].

    First those on the side `right`, how far they must move that way, then the others; below 0: by how much they pass.
    """
    heights, sides = body @ up, body @ right
    lacking = [-np.inf, -np.inf]
    for point in at:
        level = np.clip(point @ up, heights.min(), heights.max())
        slice_ = sides[np.abs(heights - level) < SLICE]
        beside = float(point @ right)
        if not len(slice_):
            continue
        if beside > middle:
            lacking[0] = max(lacking[0], float(slice_.max()) + BESIDE - beside)
        else:
            lacking[1] = max(lacking[1], beside - float(slice_.min()) + BESIDE)
    return lacking[0], lacking[1]


def _slice_at(leg: Floats, level: float, up: Floats) -> Floats:
    """Vertices (k, 3) of a leg (n, 3) near a level, at most as low as its foot and as high as its top."""
    heights = leg @ up
    return leg[np.abs(heights - np.clip(level, heights.min(), heights.max())) < SLICE]


TUBE = 2
"""Borders of a tube."""


def _borders(state: SewingState, names: tuple[str, ...]) -> int:
    """Number of borders of panels sewn together, a surface without handles: 2 of a skirt, 3 of trousers."""
    inside = set(names)
    seams = [k for k, seam in enumerate(state.mesh.seams) if {side.panel for side in seam.stitch.sides} <= inside]
    faces = np.concatenate([np.arange(rows.start, rows.stop) for rows in (state.mesh.faces[name] for name in names)])
    triangles = state.weld(seams).triangles[faces]
    return 2 - (len(np.unique(triangles)) - len(unique_edges(triangles)) + len(triangles))


CLEARANCE = 0.005
"""Distance of the vertices from the leg, and step by which those of triangles that intersect it move outward [m]."""
ROUNDS = 10
"""Bound on these steps: two legs are no farther apart."""


def closed_round_legs(state: SewingState, body: BodyMesh, surface: BodySurface) -> tuple[SewingState, tuple[str, ...]]:
    """State whose tight tubes of a leg are closed round it, and a note for each.

    These are tubes of a front and a back below trousers that are narrower than the leg at most of their heights. One
    for which there is no room stays as it is.
    """
    right, middle = np.cross(body.up, body.front), body.middle
    notes = []
    for names in sorted(_on_trouser_legs(state, rings(state, body), body)):
        ends, own = state.positions[open_pairs_of(state, names)], state.positions[vertices_of(state, names)]
        if len(names) != 2 or not len(ends):
            continue
        side = np.sign((own.mean(axis=0) - middle) @ right)
        leg = body.positions[side * ((body.positions - middle) @ right) > 0]
        levels = ends.mean(axis=1) @ body.up
        inner, outer = _reach_of_sides(ends, levels, body.up, right)
        thickness = np.array([np.ptp(_slice_at(leg, level, body.up) @ right) for level in levels])
        if np.mean(outer - inner < thickness) <= MOST:  # wider than the leg
            continue
        closed = _closed_round(state, names, ends, leg, body, surface)
        if closed is not None:
            state = replace(closed, tight=(*state.tight, *names))
            notes.append(f"{', '.join(names)} begin closed round the leg, which is thicker than they are wide")
    return state, tuple(notes)


def _reach_of_sides(ends: Floats, levels: Floats, up: Floats, right: Floats) -> list[Floats]:
    """How far to the right both sides of a tube are at some heights, two of (n,) [m], from its strings (k, 2, 3)."""
    lines = ends.mean(axis=1)
    lines = lines[np.argsort(lines @ up)]
    outer = (lines - lines.mean(axis=0)) @ right > 0
    return [np.interp(levels, lines[chosen] @ up, lines[chosen] @ right) for chosen in (~outer, outer)]


def _closed_round(
    state: SewingState, names: tuple[str, ...], ends: Floats, leg: Floats, body: BodyMesh, surface: BodySurface
) -> SewingState | None:
    """State whose panels `names` are welded to a tube round a leg; None where it would intersect something."""
    seams = [k for k in state.open_seams if {end.panel for end in state.mesh.seams[k].stitch.sides} == {*names}]
    closed = state.weld(seams)
    positions, out = closed.positions.copy(), np.zeros_like(closed.positions)
    for name in names:
        rows = state.mesh.vertices[name]
        points = state.positions[state.number[rows]]
        positions[closed.number[rows]], out[closed.number[rows]] = _bent_round(points, ends, leg, body, surface)
    if not np.isfinite(positions).all():
        return None
    distance = np.full(len(positions), CLEARANCE)
    for _ in range(ROUNDS):
        tried = closed.moved_to(positions + distance[:, None] * out)
        _, with_body, own = penetrations(tried.positions, tried.triangles, surface)
        of_tube = np.concatenate([np.arange(len(tried.triangles))[tried.mesh.faces[name]] for name in names])
        hit = np.intersect1d(of_tube, np.concatenate([with_body[:, 0], own.ravel()]))  # others are moved apart later
        if not len(hit):
            return tried
        distance[np.unique(tried.triangles[hit])] += CLEARANCE
    return None


def _bent_round(
    points: Floats, ends: Floats, leg: Floats, body: BodyMesh, surface: BodySurface
) -> tuple[Floats, Floats]:
    """Points (k, 3) of the front or the back of a tube, bent by half a turn onto a leg at their heights [m].

    And the horizontal directions there out of the leg. ends: the strings of both sides of the tube, (s, 2, 3); a point
    is as far round from one side as it is across.
    """
    up, right = body.up, np.cross(body.up, body.front)
    levels = points @ up
    inner, outer = _reach_of_sides(ends, levels, up, right)
    angle = np.pi * (np.clip((points @ right - inner) / (outer - inner), 0.0, 1.0) - 0.5)
    facing = np.sign((points.mean(axis=0) - ends.mean(axis=(0, 1))) @ body.front) * body.front
    out = np.sin(angle)[:, None] * right + np.cos(angle)[:, None] * facing
    slices = [_slice_at(leg, level, up) for level in levels]
    axis = np.array([(part.min(axis=0) + part.max(axis=0)) / 2 for part in slices])
    axis += (levels - np.sum(axis * up, axis=1))[:, None] * up
    reach, _ = surface.exits(axis, out)
    reach = np.where(
        np.isfinite(reach), reach, np.nan
    )  # an axis outside the body, as between a leg and a hand beside it
    return axis + reach[:, None] * out, out


RISE = 0.01
"""Distance below the crotch of the body to which that of trousers is lowered, and least distance above it [m]."""


def lowered_to_crotch(mesh: PatternMesh, body: BodyMesh, crotch: float = np.inf) -> tuple[PatternMesh, tuple[str, ...]]:
    """Mesh whose trousers, with what is sewn to them, are lowered until their crotch is below that of the body; a note.

    crotch: height at which it may end at most [m], as that for which the trousers were graded. Trousers that hang from
    a bodice stay: its seam, not their top, is at the waist.
    """
    state = as_placed(mesh)
    try:
        parts = body.parts
    except TransferError:
        return mesh, ()
    crotch = min(crotch, parts.landmarks["crotch"])
    positions, notes = mesh.positions.copy(), []
    for names in rings(state, body):
        if _borders(state, names) <= TUBE:
            continue
        sewn = _sewn_to(state, names)
        if hangs_on_shoulders(mesh.positions[vertices_of(state, sewn)], body, level=CHEST):
            continue
        # strings of the inseams: from front to back, in the inner half of the trousers' width
        right, middle = np.cross(body.up, body.front), body.middle
        ends = state.positions[open_pairs_of(state, names)]
        ahead, aside = (ends - middle) @ body.front, np.abs((ends.mean(axis=1) - middle) @ right)
        width = float(np.abs((state.positions[vertices_of(state, names)] - middle) @ right).max())
        inseam = ends[(ahead[:, 0] * ahead[:, 1] < 0) & (aside < width / 2)]
        if not len(inseam):
            continue
        above = float(parts.frame.local(inseam.mean(axis=1))[:, 1].max() - crotch)
        if above > RISE:
            positions[vertices_of(state, sewn)] -= (above + RISE) * body.up
            notes.append(
                f"{', '.join(names)} lowered by {1e3 * (above + RISE):.0f} mm, and what is sewn to them: the crotch was"
                " placed above that of the body"
            )
    return replace(mesh, positions=positions), tuple(notes)


def _sewn_to(state: SewingState, names: tuple[str, ...]) -> tuple[str, ...]:
    """Panels that are sewn to some panels, to these, and so on, in the order of the pattern."""
    found = set(names)
    while True:
        sides = [{side.panel for side in seam.stitch.sides} for seam in state.mesh.seams]
        more = found.union(*(each for each in sides if each & found))
        if more == found:
            return tuple(name for name in state.mesh.vertices if name in found)
        found = more


def arms_between(state: SewingState, wearer: Wearer) -> tuple[str, ...]:
    """Limbs of the arms in the way of strings between panels of no arm.

    Hands and forearms that any of them runs through, as those of a wide skirt. An upper arm is not an obstacle to some:
    strings below an armpit pass below it once their neighbours are closed. Where most strings of a seam run through it,
    as those of a short side seam, they close above it.
    """
    panels = state.mesh.pattern.panels
    open_seams = (state.mesh.seams[k] for k in state.open_seams)
    seams = [seam for seam in open_seams if not any(is_of_arm(panels[side.panel]) for side in seam.stitch.sides)]
    blocked = [seam for seam in seams if crosses_body(state.positions[state.pairs(seam)], wearer.surface).mean() > MOST]
    found = [limb for limb in limbs_between(state, seams, wearer, 0.0) if limb.endswith(("forearm", "hand"))]
    upper = [limb for limb in limbs_between(state, blocked, wearer, 0.0) if limb.endswith(" arm")]
    return (*found, *upper)
