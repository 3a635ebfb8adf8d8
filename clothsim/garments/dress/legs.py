"""Turn of the panels of a leg about the crotch, so that their hems lie over the legs of the body.

Trousers are often drawn for a wider stance than the body's: the straight line between both sides of the inseam then
runs through the ankle, and the narrower front panel is drawn past the foot on its outer side.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from clothsim.base.arrays import Floats, Ints
from clothsim.garments.dress.facing import front_of
from clothsim.garments.dress.sleeves import middle_of
from clothsim.garments.inputs import Figure
from clothsim.patterns import Panel, PatternMesh
from transfer.signed_distance import BodySurface

LEG_WORDS = ("leg", "pant", "trouser")
"""Words in the name of a panel of a leg."""
LOW = 0.3
"""Height as a fraction of the body's below which a level meets the legs alone, not the hands."""
HEM = 0.04
"""Height of the lowest part of a panel that is its hem, and of the slice of the leg there [m]."""
CLEARANCE = 0.025
"""Distance from the body that every string should keep [m]."""
ACROSS = 0.01
"""Distance by which a panel of one leg may reach across the middle of the body [m]; panels of a skirt reach further."""
SAMPLES = np.linspace(0.0, 1.0, 12)
"""Points of a string at which its distance is measured."""


def turned_to_legs(mesh: PatternMesh, body: Figure, surface: BodySurface) -> tuple[PatternMesh, tuple[str, ...]]:
    """Mesh whose legs are turned to those of the body, and a note for each that was turned.

    Where strings of the seams of a leg come close to the body, its front and its back turn in the body's frontal plane,
    each by the angle that brings the middle of its hem over the leg. A turn that frees no string is not made.
    """
    front = front_of(body)
    right = np.cross(body.up, front)
    middle = middle_of(body)
    positions, notes = mesh.positions.copy(), []
    for side in (1.0, -1.0):
        place = {
            name: mesh.positions[mesh.vertices[name]] - middle
            for name, panel in mesh.pattern.panels.items()
            if is_of_leg(panel)
        }
        names = [name for name, points in place.items() if (side * points @ right).min() > -ACROSS]
        pairs = _strings(mesh, names)
        if not len(pairs):
            continue
        middles = mesh.positions[pairs].mean(axis=1)
        crotch = middles[np.argmin(np.abs((middles - middle) @ right))]
        turned, angles = positions, []
        for facing in (1.0, -1.0):
            rows = _rows(mesh, [name for name in names if facing * place[name].mean(axis=0) @ front > 0])
            angle = _angle_to_leg(positions[rows], crotch, body, side * right) if len(rows) else 0.0
            axis = np.cross(body.up, side * right)
            turned = _turned(turned, rows, crotch, angle * axis, side * right)
            angles.append(abs(np.degrees(angle)))
        if _missing(turned[pairs], surface) < _missing(positions[pairs], surface):
            positions = turned
            notes.append(
                f"{', '.join(names)} turned about the crotch to the leg, the front by {angles[0]:.0f} and the back by"
                f" {angles[1]:.0f} degrees: strings of the seams would run through the leg, or close to it"
            )
    return replace(mesh, positions=positions), tuple(notes)


def is_of_leg(panel: Panel) -> bool:
    """True for a panel of a leg by its label, else by its name."""
    if panel.label:
        return panel.label == "leg"
    return any(word in panel.name.lower() for word in LEG_WORDS)


def _strings(mesh: PatternMesh, names: list[str]) -> Ints:
    """Pairs of vertices of all seams between two panels of one leg, (k, 2)."""
    inside = set(names)
    pairs = [
        seam.pairs
        for seam in mesh.seams
        if (panels := {side.panel for side in seam.stitch.sides}) <= inside and len(panels) == 2
    ]
    return np.concatenate([np.zeros((0, 2), np.int64), *pairs])


def _rows(mesh: PatternMesh, names: list[str]) -> Ints:
    """Vertices of some panels."""
    every = np.arange(len(mesh.positions))
    return np.concatenate([np.zeros(0, np.int64), *(every[mesh.vertices[name]] for name in names)])


def _angle_to_leg(points: Floats, crotch: Floats, body: Figure, outward: Floats) -> float:
    """Angle [rad] that brings the middle of the hem of a panel over the leg; 0 for a hem above the legs."""
    up = body.up
    lowest = float((points @ up).min())
    hem = points[points @ up < lowest + HEM].mean(axis=0)
    levels = body.positions @ up
    if lowest > levels.min() + LOW * np.ptp(levels):
        return 0.0
    slice_ = (np.abs(levels - hem @ up) < HEM) & ((body.positions - middle_of(body)) @ outward > 0)
    if not slice_.any():
        return 0.0
    reach = body.positions[slice_] @ outward
    target = (reach.min() + reach.max()) / 2
    along, below = (hem - crotch) @ outward, (crotch - hem) @ up
    return float(np.arctan2(along, below) - np.arctan2(target - crotch @ outward, below))


def _turned(positions: Floats, rows: Ints, pivot: Floats, rotation: Floats, outward: Floats) -> Floats:
    """Positions of which `rows` are turned about a pivot, then moved outward until none is nearer to the middle."""
    if not len(rows):
        return positions
    moved = positions.copy()
    moved[rows] = Rotation.from_rotvec(rotation).apply(positions[rows] - pivot) + pivot
    nearer = float((positions[rows] @ outward).min() - (moved[rows] @ outward).min())
    moved[rows] += max(nearer, 0.0) * outward
    return moved


def _missing(ends: Floats, surface: BodySurface) -> float:
    """Sum over strings (k, 2, 3) of what each lacks of `CLEARANCE` from the body, the depth inside it included [m]."""
    points = ends[:, :1] + SAMPLES[:, None] * (ends[:, 1:] - ends[:, :1])
    distance = surface.closest(points.reshape(-1, 3)).signed_distance.reshape(len(ends), -1)
    return float(np.maximum(CLEARANCE - distance.min(axis=1), 0.0).sum())
