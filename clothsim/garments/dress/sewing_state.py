"""State of a garment in sewing: vertices that are welded already, seams that are open, and the cloth of its scenes.

Welding: pairs whose gap is small become one vertex where the exact check allows it, the rest after untangling.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from clothsim import Cloth, Pattern
from clothsim.base.arrays import Floats, Ints
from clothsim.engine import (
    Fabric,
    deformation_gradients,
    fabric_named,
    fabrics_of,
    intersecting_pairs,
    mean_of_parts,
    principal_stretches,
    untangle,
)
from clothsim.garments.inputs import Garment
from clothsim.garments.penetration import count_penetrations
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

    def halved(self) -> "SewingState":
        """Copy with each triangle divided into four: the same surface, welded where it was."""
        mesh, parents = self.mesh.halved()
        number = np.sort(self.number[parents], axis=1)
        pairs = np.concatenate([np.zeros((0, 2), np.int64), *(seam.pairs for seam in mesh.seams)])
        joined = pairs[(number[pairs[:, 0]] == number[pairs[:, 1]]).all(axis=1)]
        separate = SewingState(mesh, np.arange(len(parents)), self.positions[number].mean(axis=1), tight=self.tight)
        return separate.join(joined)

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


FARTHEST = 1.0
"""Largest gap that a weld may close, as a fraction of the mean edge: it moves a vertex by half an edge at most."""


def welded_where_closed(state: SewingState, limit: float, surface: BodySurface) -> SewingState:
    """State in which every pair with a gap of at most `limit` [m] is welded, unless its weld would intersect.

    No gap above FARTHEST of the mean edge is welded, whatever the limit. All pairs are tried at one time; pairs that
    would intersect are halved, seam after seam, down to single ones.
    """
    groups = []
    for pairs in (state.mesh.seams[k].pairs for k in state.open_seams):
        ends = state.number[pairs]
        gaps = np.linalg.norm(state.positions[ends[:, 0]] - state.positions[ends[:, 1]], axis=1)
        closed = pairs[(ends[:, 0] != ends[:, 1]) & (gaps <= min(limit, FARTHEST * mean_edge(state)))]
        groups += [closed] if len(closed) else []
    if not groups:
        return state
    whole = state.join(np.concatenate(groups))
    if _is_clean(whole, surface):
        return whole
    for pairs in groups:
        state = _weld_by_halving(state, pairs, surface)
    return state


def _is_clean(state: SewingState, surface: BodySurface) -> bool:
    """True without an intersection by the exact check; with itself first, a tenth of the check against a body."""
    own = intersecting_pairs(state.positions, state.triangles)
    return not len(own) and count_penetrations(state.positions, state.triangles, surface).clean


def _weld_by_halving(state: SewingState, pairs: Ints, surface: BodySurface) -> SewingState:
    """State with as many of these neighbouring pairs welded as halving finds."""
    tried = state.join(pairs)
    if _is_clean(tried, surface):
        return tried
    if len(pairs) == 1:
        return state
    middle = len(pairs) // 2
    return _weld_by_halving(_weld_by_halving(state, pairs[:middle], surface), pairs[middle:], surface)


def mean_edge(state: SewingState) -> float:
    """Mean length of the sides of all triangles at rest [m]."""
    corners = state.mesh.material_coordinates
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


ROUNDS = 100
"""Bound on the rounds of untangling: what comes free does so in some tens."""


def welded_and_untangled(state: SewingState, surface: BodySurface) -> SewingState:
    """State in which seams whose weld would intersect are welded too, where the cloth can be untangled after it.

    Between the sides of such a seam other cloth lies, folded between two godets or at a corner of several panels: it is
    moved out by the motion that shrinks the contours of intersection (`untangle`). First all of them, then each alone.
    What opens another seam beyond what may be welded is not taken.
    """
    farthest = FARTHEST * mean_edge(state)
    near = [k for k in state.open_seams if state.gaps(state.mesh.seams[k]).max(initial=0.0) <= farthest]
    seams = [state.mesh.seams[k].pairs for k in near]
    for pairs in (np.concatenate(seams), *seams) if seams else ():
        if np.ptp(state.number[pairs], axis=1).any():
            joined = state.join(pairs)
            freed = untangle(
                joined.positions,
                joined.triangles,
                material=state.mesh.material_coordinates,
                body=(surface.positions, surface.triangles),
                rounds=ROUNDS,
            )
            tried = joined.moved_to(freed.positions)
            stay_closed = worst_gap(tried)[0] <= max(farthest, worst_gap(state)[0])
            state = tried if stay_closed and _is_clean(tried, surface) else state
    return state
