"""Placement of a pattern on a body: level and direction, sleeves along the arms, legs over the legs.

Patterns are placed for a body that faces z; panels drawn for another pose are moved rigidly with the limb that they
belong to. Trousers are often drawn for a wider stance than the body's: the straight line between both sides of the
inseam then runs through the ankle, and the narrower front panel is drawn past the foot on its outer side.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.garments.dress.limbs import form_a_tube
from clothsim.garments.inputs import BodyMesh, usual_front
from clothsim.patterns import Panel, PatternMesh
from transfer.body_frame import level_set, loops
from transfer.signed_distance import BodySurface

SHORTEST, TALLEST = 0.1, 10.0
"""Height of a body that a pattern can be for [m]."""
FARTHEST = 1e5
"""Largest coordinate of a body [m]: beyond, the distance of contact would lose its digits."""


def refuse_unsuitable(body: BodyMesh) -> None:
    """InputError for a body of no person's size, or so far away that contact would lose its digits."""
    extent, farthest = body.height, float(np.abs(body.positions).max())
    if not farthest <= FARTHEST:
        raise InputError(f"{body.name} has a vertex {farthest:.3g} m from the origin.", "Move it to the origin.")
    if not SHORTEST <= extent <= TALLEST:
        raise InputError(
            f"{body.name} is {extent:.3g} m tall; patterns are sewn on bodies of {SHORTEST:g} to {TALLEST:g} m.",
            "Give its unit: --scale METRES_PER_UNIT.",
        )


def turn_to_front(body: BodyMesh, front: Floats) -> Rotation:
    """Rotation about the vertical that takes the usual front to `front`."""
    usual = usual_front(body.up)
    angle = np.arctan2(np.cross(usual, front) @ body.up, usual @ front)
    return Rotation.from_rotvec(angle * body.up)


ORIGINS = ("auto", "floor", "waist")
ORIGIN_HEIGHT = 0.677
"""Height of the origin of Garment-Pattern-Generator's body (the template of SMPL) as a fraction of its own height."""
BELOW, LOW = 0.1, 0.6
"""Depth of a pattern below y = 0 and height of its top above it [m] that make the floor an unlikely origin."""
ASIDE = 0.2
"""Distance of a body from the vertical axis [m] beyond which the pattern follows it."""


def placed_on(mesh: PatternMesh, body: BodyMesh, origin: str = "auto") -> tuple[PatternMesh, tuple[str, ...]]:
    """The mesh placed on a body, and notes.

    Parameters
    ----------
    mesh : PatternMesh
        Panels as placed in the file, y upward.
    body : BodyMesh
        The body, y or z upward.
    origin : str
        Level y = 0 of the file: "floor", the lowest vertex of the body (GarmentCode), or "waist", the origin of SMPL's
        template (Garment-Pattern-Generator); "auto": the floor, unless the panels lie round y = 0.

    Raises
    ------
    InputError
        Another origin.
    """
    chosen, notes = chosen_origin(mesh.positions[:, 1], origin), []
    lowest = float(mesh.positions[:, 1].min())
    if chosen == "waist" and origin == "auto":
        notes.append(f"panels lie {-lowest:.2f} m below y = 0: read as made round the waist (origin = waist)")
    shift = (body.floor + height_of_origin(body, chosen)) * body.up
    aside = body.middle - (body.middle @ body.up) * body.up
    if np.linalg.norm(aside) > ASIDE:
        shift = shift + aside
        notes.append("the body is away from the vertical axis: the pattern follows it")
    positions = mesh.positions if body.up[1] else mesh.positions[:, [0, 2, 1]] * [1, -1, 1]  # y to z about the x axis
    front = body.front
    if front @ usual_front(body.up) < 1:
        positions = turn_to_front(body, front).apply(positions)
        facing = ", ".join(f"{value:.2f}" for value in front)
        notes.append(f"the body faces ({facing}) by its feet: the pattern is turned to it")
    positions = positions + shift
    return replace(mesh, positions=positions, up=body.up), tuple(notes)


def chosen_origin(heights: Floats, origin: str) -> str:
    """Level y = 0 of a pattern whose points have the heights (k,) [m] in it: "floor" or "waist"."""
    if origin not in ORIGINS:
        raise InputError(f"origin is {origin!r}.", f"Known: {', '.join(ORIGINS)}.")
    if origin != "auto":
        return origin
    return "waist" if heights.min() < -BELOW and heights.max() < LOW else "floor"


def height_of_origin(body: BodyMesh, origin: str) -> float:
    """Height of the origin of a pattern, "floor" or "waist", above the floor of a body [m]."""
    return ORIGIN_HEIGHT * body.height if origin == "waist" else 0.0


ARM_WORDS = ("sleeve", "cuff", "arm")
"""Words in the label or the name of a panel of the arm."""
LEAST_ANGLE = np.radians(20.0)
"""Angle between sleeve and arm below which the placement stays [rad]."""
BEYOND = 0.45
"""Part of the reach of the hand beyond which only the arm is."""


@dataclass(frozen=True)
class Arm:
    """Line of an arm: a point on it, the unit direction to the hand, both (3,), and how far it is to its tip [m]."""

    point: Floats
    direction: Floats
    reach: float


def turned_to_arms(mesh: PatternMesh, body: BodyMesh) -> tuple[PatternMesh, tuple[str, ...]]:
    """Mesh whose sleeves lie along the arms, and a note for each that was turned.

    The panels of an arm are those named so on one side of the body. Their axis leads from the middle of their seams
    with other panels to the middle of their free edges.
    """
    right = np.cross(body.up, body.front)
    middle = body.middle
    positions, notes = mesh.positions.copy(), []
    for side in (1.0, -1.0):
        names = [
            name
            for name, panel in mesh.pattern.panels.items()
            if is_of_arm(panel) and side * (positions[mesh.vertices[name]].mean(axis=0) - middle) @ right > 0
        ]
        ends = _find_ends(mesh, names)
        arm = arm_line(body, side * right, middle)
        if ends is None or arm is None:
            continue
        root, tip = ends
        along = (tip - root) / np.linalg.norm(tip - root)
        angle = float(np.arccos(np.clip(along @ arm.direction, -1, 1)))
        if angle < LEAST_ANGLE:
            continue
        turn, _ = Rotation.align_vectors(arm.direction[None], along[None])
        onto = arm.point + ((root - arm.point) @ arm.direction) * arm.direction
        for name in names:
            rows = mesh.vertices[name]
            positions[rows] = turn.apply(positions[rows] - root) + onto
        notes.append(f"{', '.join(names)} turned by {np.degrees(angle):.0f} degrees to lie along the arm")
    return replace(mesh, positions=positions), tuple(notes)


def is_of_arm(panel: Panel) -> bool:
    """True for a panel of an arm by its label, else by its name."""
    if panel.label:
        return panel.label == "arm"
    return any(word in panel.name.lower() for word in ARM_WORDS)


def _find_ends(mesh: PatternMesh, names: list[str]) -> tuple[Floats, Floats] | None:
    """Middle of the seams of these panels with others, and of their free edges, each (3,) [m]; None without either."""
    inside = set(names)
    sewn, root = set(), []
    for seam in mesh.seams:
        for side, other in (seam.stitch.sides, seam.stitch.sides[::-1]):
            if side.panel in inside:
                sewn.add(side)
                if other.panel not in inside:
                    root.append(mesh.positions[mesh.edges[side]].mean(axis=0))
    free = [
        mesh.positions[rows].mean(axis=0)
        for side, rows in mesh.edges.items()
        if side.panel in inside and side not in sewn
    ]
    if not root or not free:
        return None
    return np.mean(root, axis=0), np.mean(free, axis=0)


def arm_line(body: BodyMesh, outward: Floats, middle: Floats) -> Arm | None:
    """Line through the vertices of a body beyond its torso on the side `outward`; None where the arm hangs down."""
    positions = body.positions[: len(body.bare.positions)]  # in its pose, without what it wears
    reach = (positions - middle) @ outward
    chosen = positions[reach > BEYOND * reach.max()]
    centre = chosen.mean(axis=0)
    direction = np.linalg.svd(chosen - centre, full_matrices=False)[2][0]
    direction = direction if direction @ outward > 0 else -direction
    tip = float(((chosen - centre) @ direction).max())
    return Arm(centre, direction, tip) if direction @ outward > np.cos(np.radians(75)) else None


SHOULDERS = 0.8
"""Level above which a garment hangs on the shoulders, as a fraction of the body's height: armpits are at .76."""


CHEST = 0.7
"""The same for a piece as placed, which may lie too low: waists are at .62."""


def hangs_on_shoulders(positions: Floats, body: BodyMesh, level: float = SHOULDERS) -> bool:
    """True where a garment reaches over the level of the shoulders of its body, or over another one."""
    return bool((positions @ body.up).max() > body.floor + level * body.height)


SECTIONS = 24
"""Sections by which it is seen whether a garment surrounds a part of the body."""


def surrounds(positions: Floats, triangles: Ints, body: BodyMesh) -> bool:
    """True where a garment, positions (n, 3) [m] and triangles (m, 3), surrounds a part of a body, open or closed.

    It does where a section of the body has a piece whose middle sees the garment's section in directions that leave
    open less than a half turn. Sections are level, and upright ones between left and right, as arms may be level.
    """
    front = body.front
    for axis in (body.up, np.cross(body.up, front)):
        plane = np.stack([front, np.cross(axis, front)], axis=1)
        own, on_body = positions @ axis, body.positions @ axis
        low, high = max(own.min(), on_body.min()), min(own.max(), on_body.max())
        for level in np.linspace(low, high, SECTIONS + 2)[1:-1] if low < high else ():
            ring = level_set(positions, triangles, own, level)
            for piece in loops(level_set(body.positions, body.triangles, on_body, level), body.triangles):
                first, second = ((np.concatenate([ring.starts, ring.ends]) - piece.centre) @ plane).T
                angles = np.sort(np.arctan2(first, second))
                if len(angles) and np.diff(angles, append=angles[:1] + 2 * np.pi).max() < np.pi:
                    return True
    return False


LEG_WORDS = ("leg", "pant", "trouser")
"""Words in the name of a panel of a leg."""
LOW_LEVEL = 0.3
"""Height as a fraction of the body's below which a level meets the legs alone, not the hands."""
HEM = 0.04
"""Height of the lowest part of a panel that is its hem, and of the slice of the leg there [m]."""
CLEARANCE = 0.025
"""Distance from the body that every spring should keep [m]."""
LEAST_TURN_DEGREES = 0.5
"""Least turn of a leg's panels that is made."""
ACROSS = 0.01
"""Distance by which a panel of one leg may reach across the middle of the body [m]; panels of a skirt reach further."""
SAMPLES = np.linspace(0.0, 1.0, 12)
"""Points of a spring at which its distance is measured."""


def turned_to_legs(mesh: PatternMesh, body: BodyMesh, surface: BodySurface) -> tuple[PatternMesh, tuple[str, ...]]:
    """Mesh whose legs are turned to those of the body, and a note for each that was turned.

    Where springs of the seams of a leg come close to the body, its front and its back turn in the body's frontal plane,
    each by the angle that brings the middle of its hem over the leg. A turn that frees no spring is not made. Panels
    that form no tube, as the gores of a skirt, are of no leg.
    """
    front = body.front
    right = np.cross(body.up, front)
    middle = body.middle
    positions, notes = mesh.positions.copy(), []
    for side in (1.0, -1.0):
        place = {
            name: mesh.positions[mesh.vertices[name]] - middle
            for name, panel in mesh.pattern.panels.items()
            if is_of_leg(panel)
        }
        names = [name for name, points in place.items() if (side * points @ right).min() > -ACROSS]
        inside = set(names)
        of_leg = [
            seam.pairs
            for seam in mesh.seams
            if (panels := {side.panel for side in seam.stitch.sides}) <= inside and len(panels) == 2
        ]
        pairs = np.concatenate([np.zeros((0, 2), np.int64), *of_leg])
        if not len(pairs) or not form_a_tube(mesh, names, body.up):
            continue
        middles = mesh.positions[pairs].mean(axis=1)
        crotch = middles[np.argmin(np.abs((middles - middle) @ right))]
        turned, angles = positions, []
        for facing in (1.0, -1.0):
            ahead = [name for name in names if facing * place[name].mean(axis=0) @ front > 0]
            if not ahead:
                angles.append(0.0)
                continue
            rows = np.concatenate([np.arange(len(mesh.positions))[mesh.vertices[name]] for name in ahead])
            outward = side * right
            angle = _angle_to_leg(positions[rows], crotch, body, outward)
            rotation = Rotation.from_rotvec(angle * np.cross(body.up, outward))
            moved = turned.copy()
            moved[rows] = rotation.apply(turned[rows] - crotch) + crotch
            nearer = float((turned[rows] @ outward).min() - (moved[rows] @ outward).min())
            moved[rows] += max(nearer, 0.0) * outward  # none comes nearer to the middle
            turned = moved
            angles.append(abs(np.degrees(angle)))
        if max(angles) < LEAST_TURN_DEGREES:
            continue
        if _missing_clearance(turned[pairs], surface) < _missing_clearance(positions[pairs], surface):
            positions = turned
            notes.append(
                f"{', '.join(names)} turned about the crotch to the leg, the front by {angles[0]:.0f} and the back by"
                f" {angles[1]:.0f} degrees: springs of the seams would run through the leg, or close to it"
            )
    return replace(mesh, positions=positions), tuple(notes)


def is_of_leg(panel: Panel) -> bool:
    """True for a panel of a leg by its label, else by its name."""
    if panel.label:
        return panel.label == "leg"
    return any(word in panel.name.lower() for word in LEG_WORDS)


def _angle_to_leg(points: Floats, crotch: Floats, body: BodyMesh, outward: Floats) -> float:
    """Angle [rad] that brings the middle of the hem of a panel over the leg; 0 for a hem above the legs."""
    up = body.up
    lowest = float((points @ up).min())
    hem = points[points @ up < lowest + HEM].mean(axis=0)
    if lowest > body.floor + LOW_LEVEL * body.height:
        return 0.0
    slice_ = (np.abs(body.positions @ up - hem @ up) < HEM) & ((body.positions - body.middle) @ outward > 0)
    if not slice_.any():
        return 0.0
    reach = body.positions[slice_] @ outward
    target = (reach.min() + reach.max()) / 2
    along, below = (hem - crotch) @ outward, (crotch - hem) @ up
    return float(np.arctan2(along, below) - np.arctan2(target - crotch @ outward, below))


def _missing_clearance(ends: Floats, surface: BodySurface) -> float:
    """Sum over springs (k, 2, 3) of what each lacks of `CLEARANCE` from the body, the depth inside it included [m]."""
    points = ends[:, :1] + SAMPLES[:, None] * (ends[:, 1:] - ends[:, :1])
    distance = surface.closest(points.reshape(-1, 3)).signed_distance.reshape(len(ends), -1)
    return float(np.maximum(CLEARANCE - distance.min(axis=1), 0.0).sum())
