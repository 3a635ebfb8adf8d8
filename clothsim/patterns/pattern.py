"""Sewing pattern: flat panels with edges, their placement in space, and the stitches that join edges."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.patterns.curves import Curve

FARTHEST = 1000.0
"""Largest coordinate of a panel and largest length of an edge [m]: beyond, the unit of the file is wrong."""
UNITS = "Check properties.units_in_meter, and the numbers of that panel."
SAMPLES = 33
"""Points of an edge of an outline."""
SHORTEST = 1e-8
"""Distance of the ends of an edge below which it has no length [m]: rounding of coordinates far from the origin."""


@dataclass(frozen=True)
class PatternEdge:
    """Edge of a panel.

    Attributes
    ----------
    start, end : int
        Numbers of two vertices of the panel.
    curve : Curve
        Curve between them.
    label : str
        Name of an attachment such as "lower_interface" or "left_collar"; empty for none.
    """

    start: int
    end: int
    curve: Curve
    label: str = ""


@dataclass(frozen=True)
class Panel:
    """Flat piece of fabric inside a closed loop of edges.

    Attributes
    ----------
    name : str
        Name.
    vertices : (k, 2) array
        Corners in the plane of the panel [m]; y runs along the warp.
    edges : tuple of PatternEdge
        The loop in order: each edge starts where the one before it ends.
    translation : (3,) array
        Placement in space: p = R (x, y, 0) + translation [m].
    rotation : (3,) array
        Angles about x, y and z [rad]: R = Rz Ry Rx.
    label : str
        Part of the body ("body", "leg", "arm"); empty for none.
    """

    name: str
    vertices: Floats
    edges: tuple[PatternEdge, ...]
    translation: Floats
    rotation: Floats
    label: str = ""

    @property
    def matrix(self) -> Floats:
        """Rotation R = Rz Ry Rx of the placement, (3, 3)."""
        (sx, sy, sz), (cx, cy, cz) = np.sin(self.rotation), np.cos(self.rotation)
        about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        return np.asarray(about_z @ about_y @ about_x, np.float64)

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height of its outline [m]."""
        width, height = np.ptp(self.outline, axis=0)
        return float(width), float(height)

    @property
    def outline(self) -> Floats:
        """Its border as a closed polygon, (k, 2) [m]."""
        fractions = np.linspace(0, 1, SAMPLES)[:-1]
        return np.concatenate([self.edge_points(number, fractions) for number in range(len(self.edges))])

    def placed(self, points: Floats) -> Floats:
        """Points (k, 2) of the plane in space, (k, 3) [m]."""
        return np.asarray(points @ self.matrix[:, :2].T + self.translation, np.float64)

    def edge_points(self, number: int, fractions: Floats) -> Floats:
        """Points (k, 2) [m] of an edge at the fractions `fractions (k,)` of its arc length."""
        edge = self.edges[number]
        return edge.curve.by_length(self.vertices[edge.start], self.vertices[edge.end], fractions)

    def edge_length(self, number: int) -> float:
        """Arc length of an edge [m]."""
        edge = self.edges[number]
        return edge.curve.length(self.vertices[edge.start], self.vertices[edge.end])


@dataclass(frozen=True)
class Side:
    """One edge of one panel, as a side of a seam."""

    panel: str
    edge: int

    def __str__(self) -> str:
        return f"edge {self.edge} of {self.panel}"


@dataclass(frozen=True)
class Stitch:
    """Two edges that are sewn together.

    Attributes
    ----------
    first, second : Side
        The edges: the start of the first meets the end of the second.
    right_wrong : bool
        True if start meets start: the right side of the one fabric lies on the wrong side of the other.
    """

    first: Side
    second: Side
    right_wrong: bool = False

    @property
    def sides(self) -> tuple[Side, Side]:
        """Both edges."""
        return self.first, self.second


@dataclass(frozen=True)
class Pattern:
    """Panels and stitches of a garment.

    Attributes
    ----------
    panels : mapping of str to Panel
        Panels by name, in order.
    stitches : tuple of Stitch
        Seams.
    notes : tuple of str
        Assumptions made in reading.
    source : mapping
        Entries of the file that are not read, written back as they are.

    Raises
    ------
    InputError
        An open loop, an edge of zero length, a stitch to a missing edge, or an edge in two stitches.
    """

    panels: Mapping[str, Panel]
    stitches: tuple[Stitch, ...]
    notes: tuple[str, ...] = ()
    source: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.panels:
            raise InputError("The pattern has no panel.", "Give it one or more.")
        for panel in self.panels.values():
            _check_loop(panel)
            refuse_unreal(panel)
        sewn: dict[Side, int] = {}
        for number, stitch in enumerate(self.stitches):
            for side in stitch.sides:
                if side.panel not in self.panels:
                    raise InputError(
                        f"Stitch {number} names the panel {side.panel!r}.", f"Known: {', '.join(self.panels)}."
                    )
                edges = len(self.panels[side.panel].edges)
                if not 0 <= side.edge < edges:
                    raise InputError(
                        f"Stitch {number} names the {side}, which has {edges} edges.", "Edges count from 0."
                    )
                if side in sewn:
                    raise InputError(
                        f"The {side} is in two stitches, {sewn[side]} and {number}.",
                        "Split the edge where one seam ends and the other begins.",
                    )
                sewn[side] = number


def _check_loop(panel: Panel) -> None:
    """InputError for edges that form no closed loop of edges with a length."""
    name, count = panel.name, len(panel.vertices)
    if not panel.edges:
        raise InputError(f"Panel {name} has no edge.", "A panel is a closed loop of edges.")
    for number, edge in enumerate(panel.edges):
        following = (number + 1) % len(panel.edges)
        for end in (edge.start, edge.end):
            if not 0 <= end < count:
                raise InputError(
                    f"Edge {number} of panel {name} names vertex {end} of {count}.", "Vertices count from 0."
                )
        if edge.end != panel.edges[following].start:
            raise InputError(
                f"The loop of panel {name} is open: edge {number} ends at vertex {edge.end}, "
                f"edge {following} starts at vertex {panel.edges[following].start}.",
                "Give the edges in the order of the loop, each in its direction.",
            )
        if np.abs(panel.vertices[edge.start] - panel.vertices[edge.end]).max() < SHORTEST:
            raise InputError(
                f"Edge {number} of panel {name} has no length: both ends are at "
                f"{panel.vertices[edge.start].tolist()} m.",
                "Remove it, or split a closed curve in two.",
            )


def refuse_unreal(panel: Panel) -> None:
    """InputError for coordinates, placements and edges far beyond the size of a garment, by panel and edge."""
    for what, values in (("vertex", panel.vertices), ("translation", panel.translation)):
        farthest = float(np.abs(values).max(initial=0.0))
        if not farthest <= FARTHEST:
            raise InputError(f"Panel {panel.name} has a {what} {farthest:.3g} m from the origin.", UNITS)
    for number in range(len(panel.edges)):
        with np.errstate(all="ignore"):
            length = panel.edge_length(number)
        if not length <= FARTHEST:
            raise InputError(f"Edge {number} of panel {panel.name} is {length:.3g} m long.", UNITS)


def turned_panels(pattern: Pattern) -> Mapping[str, bool]:
    """Panels whose front is turned over against the direction of their loop.

    A stitch whose start meets the end of its partner joins equal fronts, one of right on wrong opposite fronts. In each
    piece of the garment the larger part of the panels keeps its front.

    Raises
    ------
    InputError
        Stitches that ask for both: the sewn surface would have one side (a Moebius band).
    """
    beside: dict[str, list[tuple[str, bool, int]]] = {name: [] for name in pattern.panels}
    for number, stitch in enumerate(pattern.stitches):
        a, b = (side.panel for side in stitch.sides)
        beside[a].append((b, stitch.right_wrong, number))
        beside[b].append((a, stitch.right_wrong, number))
    turned: dict[str, bool] = {}
    for first in pattern.panels:
        if first in turned:
            continue
        # panels sewn to `first`, True if their front is opposite to its own
        piece, waiting = {first: False}, deque([first])
        while waiting:
            name = waiting.popleft()
            for other, opposite, number in beside[name]:
                if other not in piece:
                    piece[other] = piece[name] != opposite
                    waiting.append(other)
                elif piece[other] != (piece[name] != opposite):
                    raise InputError(
                        f"Stitch {number} of {name} and {other} gives the garment one side only (a Moebius band).",
                        "Turn that stitch: right_wrong joins opposite fronts.",
                    )
        opposite = sum(piece.values()) > len(piece) / 2
        turned |= {name: value != opposite for name, value in piece.items()}
    return turned


# Gathers: seams whose sides differ in length, and the strain that their cells take.
#
# Both sides of a seam have equally many samples, so that the cells beside it cannot fold between two stitches: they are
# strained, one side shorter and the other longer, and the cloth beyond them folds freely. For a ratio g of the lengths
# and rows of cells of one stiffness the least energy is at 2 g / (1 + g) for the shorter and 2 / (1 + g) for the longer
# side; the strained strip is one row high, whatever the size is.

LEAST_GATHER = 1.25
"""Ratio of the lengths of both sides from which on a seam is a gather."""


STRIP = 0.005
"""Height of the strained strip that is no wider than a seam's own stitching [m]."""


ROW = 0.866
"""Height of a row of cells, as a multiple of the spacing."""


NAMED = 4


def gather_ratios(pattern: Pattern) -> dict[str, float]:
    """Ratio of the longer to the shorter side of each seam that is a gather, by name, the largest first."""
    found = {}
    for stitch in pattern.stitches:
        first, second = (pattern.panels[side.panel].edge_length(side.edge) for side in stitch.sides)
        ratio = max(first, second) / min(first, second)
        if ratio >= LEAST_GATHER:
            a, b = stitch.sides
            found[f"{a.panel}.{a.edge} to {b.panel}.{b.edge}"] = ratio
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def gather_notes(pattern: Pattern, spacing: float) -> tuple[str, ...]:
    """A note with the gathers of a pattern, the strain beside them and the spacing [m] that confines it to 5 mm."""
    found = gather_ratios(pattern)
    height, needed = ROW * spacing, STRIP / ROW
    if not found or height <= STRIP:
        return ()
    named = ", ".join(f"{name} ({ratio:.2g} : 1)" for name, ratio in list(found.items())[:NAMED])
    named += f" and {len(found) - NAMED} more" if len(found) > NAMED else ""
    most = max(found.values())
    return (
        f"gathered: {named}; the row of cells beside such a seam, {1e3 * height:.2g} mm high, is strained to about"
        f" {2 / (1 + most):.2f} and {2 * most / (1 + most):.2f}; --size {1e3 * needed:.2g}mm makes it"
        f" {1e3 * STRIP:.2g} mm",
    )
