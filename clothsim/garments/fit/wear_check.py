"""Wear check of a fitted garment: distortion against the garment as given, front in front, hem at its height."""

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats
from clothsim.engine import deformation_gradients, principal_stretches, triangle_planes
from clothsim.garments.inputs import BodyMesh, Garment, known_surface
from transfer.body_frame import BodyFrame
from transfer.errors import TransferError
from transfer.gradients import doubled_areas
from transfer.part_warp import heights_onto
from transfer.triangle_surface import edges_of

EDGES = (0.75, 1.35)
"""Bounds of the 1st and 99th percentile of the edges' ratios to their lengths as given, the mean scale taken out."""
DISTORTED = 0.02
"""Largest fraction of triangles with more than twice or less than half of their area, the mean scale taken out."""
IN_FRONT = 0.5
"""Least correlation of the directions, to the front and to the side, in which the nearest skin of both bodies faces."""
HEM = 0.03
"""Largest shift of the hem, as a fraction of the height of the body."""
LOWEST = 0.02
"""Fraction of the vertices that are the hem."""


@dataclass(frozen=True)
class WearCheck:
    """Measures of a worn garment.

    Attributes
    ----------
    scale : float
        Square root of the ratio of the areas.
    edge_low, edge_high : float
        1st and 99th percentile of the edges' ratios, over `scale`.
    distorted : float
        Fraction of triangles of more than twice or less than half of their area, over `scale` squared.
    front : float
        Least correlation of the directions, to the front and to the side, in which the nearest skin of the two bodies
        faces; 1 where a body has no frame.
    hem : float
        Rise of the hem as a fraction of the height of the body, against its height between the same landmarks (ground,
        crotch, armpits, neck) of its own body; 0 where a body has no frame.
    fault : str
        The first measure beyond its bound, one sentence; empty where the garment meets the bar.
    place : tuple of float
        Position of the worst edge or of the hem [m].
    """

    scale: float
    edge_low: float
    edge_high: float
    distorted: float
    front: float
    hem: float
    fault: str
    place: tuple[float, float, float]

    def as_dict(self) -> dict[str, Any]:
        """Entry in summary.json."""
        names = ("scale", "edge_low", "edge_high", "distorted", "front", "hem", "fault")
        return {name: getattr(self, name) for name in names} | {"place": list(self.place)}


def check_wear(garment: Garment, positions: Floats, source: BodyMesh, target: BodyMesh) -> WearCheck:
    """Measures of the garment at `positions` (n, 3) [m] on the target against the garment as given on the source."""
    edges = edges_of(garment.triangles)
    before, after = (
        np.linalg.norm(shape[edges[:, 0]] - shape[edges[:, 1]], axis=1) for shape in (garment.positions, positions)
    )
    shapes = (garment.positions, positions)
    areas = [np.linalg.norm(doubled_areas(shape, garment.triangles), axis=1) for shape in shapes]
    scale = float(np.sqrt(areas[1].sum() / areas[0].sum()))
    ratios, parts = after / before / scale, areas[1] / areas[0] / scale**2
    low, high = (float(value) for value in np.percentile(ratios, (1.0, 99.0)))
    distorted = float(((parts > 2.0) | (parts < 0.5)).mean())
    worst = edges[int(np.argmax(np.abs(np.log(np.maximum(ratios, 1e-12)))))]
    place, front, hem = positions[worst].mean(axis=0), 1.0, 0.0
    frames: tuple[BodyFrame, ...] = ()
    with suppress(TransferError):  # one of them is not a standing body
        frames = source.frame, target.frame
    if frames:
        # by the skin and not by the places: of trousers on a body that walks one leg is in front
        skin = []
        for body, shape in zip((source, target), shapes, strict=True):
            surface = known_surface(body.positions, body.triangles)  # its triangles are turned outward
            outer = np.unique(surface.triangles[surface.outer])
            nearest = outer[cKDTree(body.positions[outer]).query(shape)[1]]
            skin.append(surface.vertex_normals[nearest] @ body.frame.axes.T)
        front = float(min(np.corrcoef(skin[0][:, axis], skin[1][:, axis])[0, 1] for axis in (0, 2)))
        # rise of the lowest vertices against the height that they had on their own body, which becomes that of the
        # other by crotch, armpits and neck: a hem above the knees belongs there on longer legs too
        own, worn = (
            float(np.sort(body.frame.local(shape)[:, 1])[: max(1, round(LOWEST * len(shape)))].mean())
            for body, shape in ((source, garment.positions), (target, positions))
        )
        try:
            there = float(heights_onto(source.parts, target.parts, np.array([own]))[0])
        except TransferError:
            there = own / source.frame.height * target.frame.height
        hem = (worn - there) / target.frame.height
    fault = ""
    if low < EDGES[0] or high > EDGES[1]:
        fault = f"its edges are {low:.2f} to {high:.2f} of their lengths (1st to 99th percentile, scale {scale:.2f})"
    elif distorted > DISTORTED:
        fault = f"{100 * distorted:.1f} % of its triangles have more than twice or less than half of their area"
    elif front < IN_FRONT:
        fault = "it is turned on the body"
    elif abs(hem) > HEM:
        fault = f"its hem is {100 * abs(hem):.1f} % of the body's height {'higher' if hem > 0 else 'lower'}"
        place = positions[np.argmin(frames[1].local(positions)[:, 1])]
    x, y, z = (float(value) for value in place)
    return WearCheck(scale, low, high, distorted, front, hem, fault, (x, y, z))


PERCENTILES = (1.0, 99.0)


@dataclass(frozen=True)
class Distortion:
    """Distortion of a fitted garment.

    Attributes
    ----------
    stretches : ndarray (m, 2)
        Principal stretches of each triangle relative to the garment as given.
    low, high : float
        Their 1st and 99th percentile.
    displacement : float
        Largest distance of a vertex from where it was worn [m], if known, else as given.
    """

    stretches: Floats
    low: float
    high: float
    displacement: float

    def as_dict(self) -> dict[str, Any]:
        """Entry in summary.json."""
        return {"stretch_low": self.low, "stretch_high": self.high, "displacement": self.displacement}


def cost_of(garment: Garment, positions: Floats, worn: Floats | None = None) -> Distortion:
    """Distortion of the garment at `positions` (n, 3) [m]; worn (n, 3) [m]: its place on that body; None: as given."""
    planes = triangle_planes(garment.positions, garment.triangles)
    edges = np.stack([planes[:, 1] - planes[:, 0], planes[:, 2] - planes[:, 0]], axis=2)
    F = deformation_gradients(positions, garment.triangles, np.linalg.inv(edges))
    stretches = np.asarray(principal_stretches(np.asarray(F)), np.float64)
    low, high = np.percentile(stretches, PERCENTILES)
    moved = np.linalg.norm(positions - (garment.positions if worn is None else worn), axis=1)
    return Distortion(stretches, float(low), float(high), float(moved.max()))
