"""Corrections of placed panels: separation where they intersect, lift, clearance of sleeves, approach to the body.

Lift: panels are often placed so low that the straight line between both sides of a shoulder seam runs through the
shoulder: drawn together there, the garment slips down over the arms.
Sleeve clearance: where the torso of a pattern is wide, its sides are placed beside the arms and its sleeves between its
front and its back. Springs of its side seams then run through the sleeves: drawn together, the torso closes round the
end of each sleeve, whose cloth then lies between both sides of the armhole. A narrow cuff that is moved past the hand
closes there, and does not come back over it.
Approach: panels are placed far from the body so that none intersects it. Seams at the ends of a panel that is far away
draw its ends inward while its middle lags behind: the panel bows, its shoulders sink below those of the body, and the
garment slips down.
"""

import igl
import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.base.text import many
from clothsim.base.triangles import area_vectors
from clothsim.engine import components, intersecting_pairs
from clothsim.garments.dress.closing import is_on_top
from clothsim.garments.dress.placement import CHEST, SHOULDERS, arm_line, hangs_on_shoulders, is_of_arm
from clothsim.garments.dress.rings import open_pairs_by_seam, rings, vertices_of
from clothsim.garments.dress.sewing_state import SewingState, count_crossing_body, crosses_body
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.penetration import count_penetrations, penetrations
from clothsim.patterns import TOUCHING
from transfer.signed_distance import BodySurface

CLEARANCE = 0.02
"""Distance that is left in front of a group of panels [m]."""
LEAST = 0.005
"""Least displacement that is worth it [m]."""
LEVEL = 0.5
"""Vertical part of the unit normal beyond which a group of panels is level."""


def approached(state: SewingState, body: BodyMesh, surface: BodySurface) -> tuple[SewingState, str]:
    """State whose groups of panels moved rigidly toward the body; and a description.

    A group of panels that touch moves against its outward normal, those nearest to the body first, until
    `CLEARANCE` is left to the body or to another group. One with nothing before it stays, and a level one, as half a
    collar drawn beside the shoulder, does not fall past what it is sewn to.
    """
    group = rigid_groups(state)
    outward = outward_of_groups(state, body)
    ahead = [_free_distance(state, group == k, -outward[k], surface) for k in range(len(outward))]
    moved_by = np.zeros(len(outward))
    order = np.argsort(ahead)
    for k in [*order, *order]:  # once more, since a group may have stood before another
        distance = _free_distance(state, group == k, -outward[k], surface) - CLEARANCE
        if not LEAST < distance < np.inf:
            continue
        moved = state.moved_to(state.positions - (distance * (group == k))[:, None] * outward[k])
        if abs(outward[k] @ body.up) > LEVEL and _length_of_springs(moved) > _length_of_springs(state):
            continue
        if count_penetrations(moved.positions, moved.triangles, surface).clean:
            state, moved_by[k] = moved, moved_by[k] + distance
    return state, f"moved toward the body by at most {1e3 * moved_by.max(initial=0.0):.3g} mm"


def _length_of_springs(state: SewingState) -> float:
    """Sum of the gaps of all seams [m]."""
    return float(sum(state.gaps(seam).sum() for seam in state.mesh.seams))


def _free_distance(state: SewingState, chosen: Ints, direction: Floats, surface: BodySurface) -> float:
    """Distance [m] that the chosen vertices can move along a direction before they meet the body or the rest; or inf.

    Measured at vertices of both sides: rays of the moving ones forward, rays of what they may meet backward.
    """
    inside = chosen[state.triangles[:, 0]]
    own, others = state.triangles[inside], state.triangles[~inside]
    moving = state.positions[chosen]
    onto_body, _ = surface.exits(moving, np.broadcast_to(direction, moving.shape))
    onto_rest = first_hits(moving, direction, state.positions, others)
    met = np.concatenate([surface.positions[np.unique(surface.triangles)], state.positions[np.unique(others)]])
    behind = first_hits(met, -direction, state.positions, own)
    return float(min(onto_body.min(initial=np.inf), onto_rest.min(initial=np.inf), behind.min(initial=np.inf)))


def first_hits(points: Floats, directions: Floats, positions: Floats, triangles: Ints) -> Floats:
    """Distance to the first triangle that each ray meets, (k,) [m]; inf for none. Unit directions: (3,) or (k, 3)."""
    if not len(triangles):
        return np.full(len(points), np.inf)
    tree = igl.AABB()
    tree.init(positions, np.ascontiguousarray(triangles))
    rays = np.ascontiguousarray(np.broadcast_to(directions, points.shape))
    hit, distance, _ = tree.intersect_ray_first(positions, np.ascontiguousarray(triangles), points, rays)
    met = np.logical_and(hit.ravel() >= 0, np.isfinite(distance.ravel()))
    return np.where(met, distance.ravel(), np.inf)


STEP = 0.005
"""Displacement of a panel in each round [m]."""
ROUNDS = 24
"""Bound on the rounds."""
MARGIN = 0.004
"""Further displacement of all panels that were moved [m]: contact begins at a distance."""


def separated(state: SewingState, body: BodyMesh, surface: BodySurface) -> tuple[SewingState, str]:
    """State whose panels are moved rigidly, away from the body's axis, until none intersects; and a description.

    In each round the panels with an intersection move outward: along the normal of their plane, to the side that is
    farther from the vertical axis of the body. Of two panels that intersect each other the outer one moves, so that
    panels placed in one plane are stacked. Those above the shoulders that are not free then, as a hood whose lower edge
    is placed inside them, move upward.
    """
    of_panel = rigid_groups(state)
    middle = np.bincount(of_panel, state.positions @ body.up) / np.bincount(of_panel)
    above = middle > body.floor + SHOULDERS * body.height
    found: dict[int, str] = {}
    for name, rows in state.mesh.vertices.items():
        found.setdefault(int(of_panel[state.number[rows.start]]), name)
    names, texts = [found[group] for group in range(len(found))], []
    for where, directions in (("outward", outward_of_groups(state, body)), ("upward", above[:, None] * body.up)):
        state, shift = _moved_apart(state, surface, of_panel, directions)
        moved = ", ".join(name for name, distance in zip(names, shift, strict=True) if distance > 0)
        texts += [f"moved {where} by at most {1e3 * shift.max():.3g} mm: {moved}"] if moved else []
    return state, ", ".join(texts)


def _moved_apart(
    state: SewingState, surface: BodySurface, of_panel: Ints, directions: Floats
) -> tuple[SewingState, Floats]:
    """State whose groups moved along their directions (g, 3) until none intersects, and their distances (g,) [m].

    One without a direction stays.
    """
    shift = np.zeros(len(directions))
    positions = state.positions
    for _ in range(ROUNDS):
        counts, with_body, own = penetrations(positions, state.triangles, surface)
        groups: set[int] = set()
        if not counts.clean:
            groups = {int(group) for group in of_panel[state.triangles[with_body[:, 0], 0]]}
            groups |= {int(group) for group in of_panel[surface.closest(positions).signed_distance < 0]}
            for a, b in {tuple(sorted(pair)) for pair in of_panel[state.triangles[own][:, :, 0]].tolist()}:
                if a != b and not {a, b} & groups:
                    groups.add(b if shift[b] >= shift[a] else a)
        moving = [group for group in sorted(groups) if directions[group].any()]
        if not moving:
            break
        shift[moving] += STEP
        positions = state.positions + (shift[:, None] * directions)[of_panel]
    if shift.any():
        extended = state.positions + ((shift + MARGIN * (shift > 0))[:, None] * directions)[of_panel]
        if penetrations(extended, state.triangles, surface)[0].clean:
            positions = extended
    return state.moved_to(positions), shift


def panels_in_contact(state: SewingState, surface: BodySurface) -> list[str]:
    """Names of the panels that intersect the body, and of those that intersect another one."""
    _, with_body, _ = penetrations(state.positions, state.triangles, surface)
    starts = np.array([rows.start for rows in state.mesh.faces.values()])
    names = list(state.mesh.faces)
    hit = {names[k] for k in np.searchsorted(starts, with_body[:, 0], side="right") - 1}
    return sorted(hit | crossing_panels(state), key=names.index)


def crossing_panels(state: SewingState) -> set[str]:
    """Names of the panels that intersect another one."""
    pairs = intersecting_pairs(state.positions, state.triangles)
    starts = np.array([rows.start for rows in state.mesh.faces.values()])
    panels = np.searchsorted(starts, pairs, side="right") - 1
    names = list(state.mesh.faces)
    return {names[k] for k in np.unique(panels[panels[:, 0] != panels[:, 1]])}


def touching_seams(state: SewingState) -> list[int]:
    """Seams that are closed as placed, except those of panels that intersect, which must be moved apart."""
    touching = [k for k in state.open_seams if state.gaps(state.mesh.seams[k]).max(initial=0.0) < TOUCHING]
    crossing = crossing_panels(state.weld(touching))
    return [k for k in touching if not crossing & {side.panel for side in state.mesh.seams[k].stitch.sides}]


TIP = 0.1
"""Fraction of the way to its neighbours by which a vertex that touches another panel is drawn back."""


def parted(state: SewingState) -> tuple[SewingState, tuple[str, ...]]:
    """State without vertices that lie on one another and are not sewn together, as the tips of two godets; a note.

    Each is drawn back into its panel; its rest shape stays.
    """
    pairs = cKDTree(state.positions).query_pairs(TOUCHING, output_type="ndarray")
    if not len(pairs):
        return state, ()
    corners = state.triangles[np.isin(state.triangles, pairs).any(axis=1)]
    positions = state.positions.copy()
    for vertex in np.unique(pairs):
        around = np.unique(corners[(corners == vertex).any(axis=1)])
        positions[vertex] += TIP * (state.positions[around[around != vertex]].mean(axis=0) - state.positions[vertex])
    least = np.linalg.norm(np.diff(positions[pairs], axis=1), axis=2).min()
    note = f"{many(len(pairs), 'pair')} of tips of panels that touched are {1e3 * least:.2g} mm apart or more"
    return state.moved_to(positions), (note,)


def rigid_groups(state: SewingState) -> Ints:
    """Group of panels joined by welds of each vertex of the garment, (k,)."""
    return components(state.triangles, len(state.positions))


def outward_of_groups(state: SewingState, body: BodyMesh) -> Floats:
    """Unit normal of each group, horizontal where it can be, on the side away from the body's axis, (g, 3)."""
    label = rigid_groups(state)
    found = []
    for group in range(label.max() + 1):
        faces = state.triangles[label[state.triangles[:, 0]] == group]
        corners = state.positions[faces]
        normal = area_vectors(corners).sum(axis=0)
        flat = normal - (normal @ body.up) * body.up
        normal = flat if np.linalg.norm(flat) > 0.3 * np.linalg.norm(normal) else normal
        normal = normal / np.linalg.norm(normal)
        away = corners.mean(axis=(0, 1)) - body.middle
        found.append(normal if normal @ away >= 0 else -normal)
    return np.array(found)


LIFTS = np.arange(0.0, 0.151, 0.01)
"""Lifts that are tried [m]."""
LIFT_CLEAR = 0.01
"""Further lift above the least that frees the most springs [m]."""


def lifted(state: SewingState, body: BodyMesh, surface: BodySurface) -> tuple[SewingState, str]:
    """State whose pieces on the shoulders, and what is sewn on top of them, are lifted; and a note.

    By the least height at which the smallest part of each seam of these pieces runs through the body. A skirt below
    stays: lifted, it would close above the hips that it is cut for.
    """
    hanging = [
        names
        for names in rings(state, body)
        if hangs_on_shoulders(state.positions[vertices_of(state, names)], body, level=CHEST)
    ]
    seams = [pairs for names in hanging for pairs in open_pairs_by_seam(state, names)]
    if not seams:
        return state, ""
    through = np.array(
        [[count_crossing_body(state.positions[pairs] + lift * body.up, surface) for pairs in seams] for lift in LIFTS]
    )
    best = _best_lift(through / [len(pairs) for pairs in seams])
    if best == 0:
        return state, ""
    on_top = tuple(name for name, panel in state.mesh.pattern.panels.items() if is_on_top(panel))
    rows = vertices_of(state, (*(name for names in hanging for name in names), *on_top))
    positions = state.positions.copy()
    height = LIFTS[best] + LIFT_CLEAR
    positions[rows] += height * body.up
    note = (
        f"the torso was lifted by {1e3 * height:.0f} mm: {through[0].sum()} springs of its seams ran through the body"
    )
    return state.moved_to(positions), f"{note}, {through[best].sum()} do now"


def _best_lift(through: Floats) -> int:
    """Number of the least of `LIFTS` with the least sum of `through`, the part of each seam through the body, (s, k).

    Parts, not numbers of springs: the seam of a shoulder is short, and a bodice whose shoulders stay open slides off.
    Where more springs of a seam run through the body on the way up, as those of a side seam through an arm, it is not
    freed above: it would close there.
    """
    most = np.maximum.accumulate(through, axis=0)
    return int(np.argmin(np.where(most > through[0], most, through).sum(axis=1)))


SHIFTS = np.arange(0.0, 0.301, 0.01)
"""Distances along the arm that are tried [m]."""
SHIFT_CLEAR = 0.02
"""Further distance beyond the least that frees the most springs [m]."""


def sleeves_cleared(state: SewingState, body: BodyMesh, surface: BodySurface) -> tuple[SewingState, tuple[str, ...]]:
    """State with each sleeve moved along its arm, and a note for each that was moved.

    By the least distance at which the fewest springs of the torso run through its panels;
    sleeves that are welded to other panels stay.
    """
    right, middle = np.cross(body.up, body.front), body.middle
    panels = state.mesh.pattern.panels
    found: list[Ints] = [np.zeros((0, 2), np.int64)]
    for k in state.open_seams:
        sides = [panels[side.panel] for side in state.mesh.seams[k].stitch.sides]
        if not any(is_of_arm(panel) or is_on_top(panel) for panel in sides):
            found.append(state.pairs(state.mesh.seams[k]))
    springs = np.asarray(state.positions[np.concatenate(found)], np.float64)  # between panels of the torso, (k, 2, 3)
    waiting = crosses_body(springs, surface)
    positions, notes = state.positions.copy(), []
    for side in (1.0, -1.0):
        names = [
            name
            for name, panel in state.mesh.pattern.panels.items()
            if is_of_arm(panel)
            and side * (state.positions[state.number[state.mesh.vertices[name]]] - middle).mean(axis=0) @ right > 0
        ]
        arm = arm_line(body, side * right, middle)
        if not names or not len(springs) or arm is None:
            continue
        faces = np.concatenate([state.triangles[state.mesh.faces[name]] for name in names])
        others = [state.triangles[rows] for name, rows in state.mesh.faces.items() if name not in names]
        if np.isin(faces, np.concatenate([np.zeros((0, 3), np.int64), *others])).any():
            continue
        crossing = []
        for shift in SHIFTS:
            ends = springs - shift * arm.direction
            along = ends[:, 1] - ends[:, 0]
            lengths = np.linalg.norm(along, axis=1)
            directions = along / np.maximum(lengths, np.finfo(float).tiny)[:, None]
            crossing.append(first_hits(ends[:, 0], directions, state.positions, faces) < lengths)
        through = np.array(crossing)
        tip = float(((state.positions[np.unique(faces)] - arm.point) @ arm.direction).max())
        # the sleeve stays within the tip of the hand, but for SHIFT_CLEAR, unless springs that do not wait ask for more
        drawn = (through & ~waiting).sum(
            axis=1
        )  # those that run through the body are drawn last, when panels lie on it
        allowed = max(np.count_nonzero(arm.reach - tip >= SHIFTS), 1)
        allowed = allowed if drawn[:allowed].min() == drawn.min() else len(SHIFTS)
        best = int(np.argmin(through[:allowed].sum(axis=1)))
        if best:
            distance = SHIFTS[best] + SHIFT_CLEAR
            positions[np.unique(faces)] += distance * arm.direction
            before, after = through[[0, best]].sum(axis=1)
            notes.append(
                f"{', '.join(names)} moved by {1e3 * distance:.0f} mm along the arm: {before} springs of the torso"
                f" ran through, {after} do now"
            )
    return state.moved_to(positions), tuple(notes)
