"""Sleeves turned to the arms: panels placed for another pose are moved rigidly with the arm that they belong to."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from clothsim.base.arrays import Floats
from clothsim.garments.dress.facing import front_of
from clothsim.garments.inputs import Figure
from clothsim.patterns import Panel, PatternMesh

ARM_WORDS = ("sleeve", "cuff", "arm")
"""Words in the label or the name of a panel of the arm."""
LEAST_ANGLE = np.radians(20.0)
"""Angle between sleeve and arm below which the placement stays [rad]."""
BEYOND = 0.45
"""Part of the reach of the hand beyond which only the arm is."""


@dataclass(frozen=True)
class Arm:
    """Line of an arm: a point on it and the unit direction to the hand, both (3,)."""

    point: Floats
    direction: Floats


def turned_to_arms(mesh: PatternMesh, body: Figure) -> tuple[PatternMesh, tuple[str, ...]]:
    """Mesh whose sleeves lie along the arms, and a note for each that was turned.

    The panels of an arm are those named so on one side of the body. Their axis leads from the middle of their seams
    with other panels to the middle of their free edges.
    """
    right = np.cross(body.up, front_of(body))
    middle = middle_of(body)
    positions, notes = mesh.positions.copy(), []
    for side in (1.0, -1.0):
        names = [
            name
            for name, panel in mesh.pattern.panels.items()
            if is_of_arm(panel) and side * (positions[mesh.vertices[name]].mean(axis=0) - middle) @ right > 0
        ]
        ends = _ends(mesh, names)
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


def _ends(mesh: PatternMesh, names: list[str]) -> tuple[Floats, Floats] | None:
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


def arm_line(body: Figure, outward: Floats, middle: Floats) -> Arm | None:
    """Line through the vertices of a body beyond its torso on the side `outward`; None where the arm hangs down."""
    reach = (body.positions - middle) @ outward
    chosen = body.positions[reach > BEYOND * reach.max()]
    centre = chosen.mean(axis=0)
    direction = np.linalg.svd(chosen - centre, full_matrices=False)[2][0]
    direction = direction if direction @ outward > 0 else -direction
    return Arm(centre, direction) if direction @ outward > np.cos(np.radians(75)) else None


def middle_of(body: Figure) -> Floats:
    """Middle of the bounding box of a body, (3,) [m]."""
    return np.asarray((body.positions.min(axis=0) + body.positions.max(axis=0)) / 2, np.float64)
