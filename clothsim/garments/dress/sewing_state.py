"""State of a garment in sewing: vertices that are welded already, seams that are open, and the cloth of its scenes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from clothsim import Cloth, Pattern
from clothsim.base.arrays import Floats, Ints
from clothsim.engine import Fabric, deformation_gradients, fabric_named, fabrics_of, mean_of_parts, principal_stretches
from clothsim.garments.inputs import Garment
from clothsim.patterns import MeshedSeam, PatternMesh, joined_vertices
from transfer.signed_distance import BodySurface


@dataclass(frozen=True)
class SewingState:
    """A garment in sewing.

    Attributes
    ----------
    mesh : PatternMesh
        The panels.
    number : (n,) int array
        Vertex of the garment of each vertex of the panels.
    positions : (k, 3) array
        Vertices of the garment [m].
    joined : (j, 2) int array
        Pairs of vertices of the panels that are welded.
    tight : tuple of str
        Panels that began closed round a leg that they are narrower than (`closed_round_legs`).
    """

    mesh: PatternMesh
    number: Ints
    positions: Floats
    joined: Ints = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    tight: tuple[str, ...] = ()

    @property
    def triangles(self) -> Ints:
        """Triangles of the garment, (m, 3)."""
        return self.number[self.mesh.triangles]

    @property
    def open_seams(self) -> tuple[int, ...]:
        """Seams with a pair that is not welded."""
        return tuple(k for k, seam in enumerate(self.mesh.seams) if len(self.pairs(seam)))

    @property
    def welded(self) -> tuple[int, ...]:
        """Seams that are welded throughout."""
        return tuple(sorted(set(range(len(self.mesh.seams))) - set(self.open_seams)))

    def pairs(self, seam: MeshedSeam) -> Ints:
        """Pairs of different vertices of the garment that a seam joins, (k, 2)."""
        pairs = self.number[seam.pairs]
        return pairs[pairs[:, 0] != pairs[:, 1]]

    def gaps(self, seam: MeshedSeam) -> Floats:
        """Distance of each pair of a seam [m]; empty where it is closed."""
        return self.distances(self.pairs(seam))

    def distances(self, pairs: Ints) -> Floats:
        """Distance of each pair (k, 2) of vertices of the garment [m]."""
        ends = self.positions[pairs]
        return np.asarray(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1), np.float64)

    def weld(self, seams: Sequence[int]) -> "SewingState":
        """Copy in which these seams are welded too. InputError as for a mesh."""
        return self.join(np.concatenate([np.zeros((0, 2), np.int64), *(self.mesh.seams[k].pairs for k in seams)]))

    def join(self, pairs: Ints) -> "SewingState":
        """Copy in which these pairs (k, 2) of vertices of the panels are welded too, each group at its mean."""
        joined = np.concatenate([self.joined, pairs])
        number = joined_vertices(self.mesh, joined)
        positions = mean_of_parts(self.positions[self.number], number)
        return replace(self, number=number, positions=positions, joined=joined)

    def moved_to(self, positions: Floats) -> "SewingState":
        """Copy at other positions (k, 3) [m]."""
        return replace(self, positions=positions)

    def garment(self, name: str) -> Garment:
        """As a garment of the stages of a fit."""
        return Garment(name, self.positions, self.triangles, sewn=True)

    def stretches(self) -> Floats:
        """Principal stretches of each triangle against its panel, (m, 2)."""
        corners = self.mesh.material_coordinates
        edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
        F = deformation_gradients(self.positions, self.triangles, np.linalg.inv(edges))
        return np.asarray(principal_stretches(np.asarray(F)), np.float64)


def as_placed(mesh: PatternMesh) -> SewingState:
    """The panels as placed, no seam welded."""
    return SewingState(mesh, np.arange(len(mesh.positions)), mesh.positions)


def worst_gap(state: SewingState) -> tuple[float, str]:
    """Largest gap of all open seams [m], and the name of its seam."""
    gaps = [(float(state.gaps(seam).max(initial=0.0)), seam.name) for seam in state.mesh.seams]
    return max(gaps, default=(0.0, "none"))


def count_crossing_body(ends: Floats, surface: BodySurface) -> int:
    """Number of the segments (k, 2, 3) that meet the body."""
    return int(crosses_body(ends, surface).sum())


def crosses_body(ends: Floats, surface: BodySurface) -> NDArray[np.bool_]:
    """True for each segment (k, 2, 3) that meets the body, (k,)."""
    return np.asarray(body_hits(ends, surface) >= 0)


def body_hits(ends: Floats, surface: BodySurface) -> Ints:
    """First triangle of the body that each segment (k, 2, 3) meets, (k,); -1 for none."""
    along = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    directions = along / np.maximum(lengths, np.finfo(float).tiny)[:, None]
    distance, triangles = surface.exits(ends[:, 0], directions)
    return np.asarray(np.where(distance < lengths, triangles, -1), np.int64)


@dataclass(frozen=True)
class Fabrics:
    """Named fabric of a garment, and those of panels with one of their own, by panel (see `fabrics_of`)."""

    main: str
    of_panels: Mapping[str, str] = field(default_factory=dict)

    def of(self, pattern: Pattern) -> dict[str, Fabric]:
        """The fabric of every panel. InputError for an unknown fabric or panel."""
        main = fabric_named("fabric", self.main)
        own = fabrics_of("fabrics", list(pattern.panels), self.of_panels)
        return {panel: own.get(panel, main) for panel in pattern.panels}


def sewn_cloth(state: SewingState, fabrics: Fabrics) -> Cloth:
    """The garment at its positions as a cloth of a scene; its panels are named groups of triangles."""
    return Cloth(
        state.positions,
        state.triangles,
        rest=state.mesh.material_coordinates,
        groups={panel: np.arange(rows.start, rows.stop) for panel, rows in state.mesh.faces.items()},
        name="garment",
        fabric=fabrics.main,
        fabric_of=fabrics.of_panels or None,
        sewn=True,
    )
