"""Mesh of a sewing pattern: triangles of all panels, placed in space, and the vertices that its seams join."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.patterns.borders import Border, borders, refuse_self_crossing
from clothsim.patterns.curves import scaled_curve
from clothsim.patterns.limits import refuse_too_fine
from clothsim.patterns.panel_mesh import PanelMesh, mesh_panel, without_slivers
from clothsim.patterns.pattern import Pattern, Side, Stitch

# Orientation of panels: which of them are turned so that the sewn surface has one front.


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
        piece = _piece(first, beside)
        opposite = sum(piece.values()) > len(piece) / 2
        turned |= {name: value != opposite for name, value in piece.items()}
    return turned


def _piece(first: str, beside: Mapping[str, list[tuple[str, bool, int]]]) -> dict[str, bool]:
    """Panels sewn to `first`, True where their front is opposite to its own."""
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
    return piece


# Gathers: seams whose sides differ in length, and the strain that their cells take.
#
# Both sides of a seam have equally many samples, so that the cells beside it cannot fold between two stitches: they are
# strained, one side shorter and the other longer, and the cloth beyond them folds freely. For a ratio g of the lengths
# and rows of cells of one stiffness the least energy is at 2 g / (1 + g) for the shorter and 2 / (1 + g) for the longer
# side; the strained strip is one row high, whatever the size is.

LEAST = 1.25
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
        if ratio >= LEAST:
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


NARROWEST = 1e-3
"""Height of a triangle below which it counts as flat, as a fraction of its longest side."""


@dataclass(frozen=True)
class Seam:
    """Vertices that a stitch joins, one of either side in a row.

    Attributes
    ----------
    stitch : Stitch
        Stitch of the pattern.
    pairs : (k, 2) int array
        Vertices; a vertex is never joined to itself.
    """

    stitch: Stitch
    pairs: Ints

    @property
    def name(self) -> str:
        """Both edges."""
        first, second = self.stitch.sides
        return f"{first.panel}.{first.edge} to {second.panel}.{second.edge}"


@dataclass(frozen=True)
class PatternMesh:
    """Panels as triangles.

    Attributes
    ----------
    pattern : Pattern
        Pattern that was meshed: without edges far below the spacing.
    positions : (n, 3) array
        Vertices of the placed panels [m].
    triangles : (m, 3) int array
        Wound so that sewn panels have one front.
    material_coordinates : (m, 3, 2) array
        Corners of each triangle at rest [m]: first axis along the warp (y of the panel), second along the weft.
    panel_coordinates : (n, 2) array
        Vertices in the planes of their panels [m].
    vertices, faces : mapping of str to slice
        Rows of each panel in the vertices and in the triangles.
    edges : mapping of Side to (k,) int array
        Vertices of each edge of a panel from its start to its end.
    seams : tuple of Seam
        Seams in the order of the stitches.
    fractions : mapping of Side to (k,) array
        Fractions of the arc length of each edge at which its vertices lie.
    """

    pattern: Pattern
    positions: Floats
    triangles: Ints
    material_coordinates: Floats
    panel_coordinates: Floats
    vertices: Mapping[str, slice]
    faces: Mapping[str, slice]
    edges: Mapping[Side, Ints]
    seams: tuple[Seam, ...]
    fractions: Mapping[Side, Floats]

    def labelled(self) -> dict[str, tuple[Side, ...]]:
        """Edges of each label."""
        found: dict[str, tuple[Side, ...]] = {}
        for side in self.edges:
            label = self.pattern.panels[side.panel].edges[side.edge].label
            if label:
                found[label] = (*found.get(label, ()), side)
        return found


def mesh_pattern(pattern: Pattern, spacing: float) -> PatternMesh:
    """Mesh the panels of a pattern.

    Parameters
    ----------
    pattern : Pattern
        Panels and stitches.
    spacing : float
        Distance of neighbouring vertices [m].

    Raises
    ------
    InputError
        A panel that crosses itself; stitches that give the garment one side only; a seam whose two sides share a
        triangle.
    """
    spacing = as_positive("The size of the mesh", spacing)
    turned = turned_panels(pattern)
    refuse_too_fine(pattern, spacing)
    pattern = without_slivers(pattern, spacing)
    sampled = borders(pattern, spacing)
    for panel in pattern.panels.values():
        refuse_self_crossing(panel, sampled[panel.name])
    parts, n, m = [], 0, 0
    vertices: dict[str, slice] = {}
    faces: dict[str, slice] = {}
    edges: dict[Side, Ints] = {}
    for name, panel in pattern.panels.items():
        border = sampled[name]
        mesh = _meshed(name, border, spacing)
        follows = border.counter_clockwise != turned[name]
        triangles, corners = wound(mesh.points, mesh.triangles, follows)
        parts.append((panel.placed(mesh.points), triangles + n, corners, mesh.points))
        edges |= {Side(name, number): border.along(number) + n for number in range(len(panel.edges))}
        vertices[name], faces[name] = slice(n, n + len(mesh.points)), slice(m, m + len(triangles))
        n, m = vertices[name].stop, faces[name].stop
    positions, triangles, corners, plane = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    seams = tuple(Seam(stitch, seam_pairs(stitch, edges)) for stitch in pattern.stitches)
    pattern = replace(pattern, notes=(*pattern.notes, *gather_notes(pattern, spacing)))
    fractions = {side: sampled[side.panel].fractions[side.edge] for side in edges}
    return PatternMesh(pattern, positions, triangles, corners, plane, vertices, faces, edges, seams, fractions)


def scaled_mesh(mesh: PatternMesh, scale: float) -> PatternMesh:
    """A mesh and its pattern larger by a factor; radii of arcs as well."""
    panels = {
        name: replace(
            panel,
            vertices=scale * panel.vertices,
            translation=scale * panel.translation,
            edges=tuple(replace(edge, curve=scaled_curve(edge.curve, scale)) for edge in panel.edges),
        )
        for name, panel in mesh.pattern.panels.items()
    }
    return replace(
        mesh,
        pattern=replace(mesh.pattern, panels=panels),
        positions=scale * mesh.positions,
        material_coordinates=scale * mesh.material_coordinates,
        panel_coordinates=scale * mesh.panel_coordinates,
    )


def _meshed(name: str, border: Border, spacing: float) -> PanelMesh:
    """Mesh of a panel. InputError with its name where its border cannot be triangulated, or is nowhere near as wide."""
    try:
        mesh = mesh_panel(border.points, spacing, graded=border.graded)
    except RuntimeError as error:  # samples that coincide or nearly cross
        reason = str(error).partition("\n")[0]
        raise InputError(f"Panel {name} cannot be triangulated: {reason}.", "Look at its vertices.") from error
    corners = mesh.points[mesh.triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    heights = np.abs(edge[:, 0] * other[:, 1] - edge[:, 1] * other[:, 0]) / sides.max(axis=1)
    thinnest = int(np.argmin(heights))
    if heights[thinnest] < NARROWEST * min(spacing, float(sides[thinnest].max())):
        x, y = corners[thinnest].mean(axis=0)
        raise InputError(
            f"Panel {name} is {1e6 * heights[thinnest]:.2g} micrometres wide near ({x:.3g}, {y:.3g}) m: its triangles "
            "there would have no area.",
            "Move its edges apart there.",
        )
    return mesh


def wound(points: Floats, triangles: Ints, follows: bool) -> tuple[Ints, Floats]:
    """Triangles wound for the front of the garment, and their corners in the material plane, (m, 3, 2) [m].

    follows: True where the front of the sewn garment is the side from which the panel's x, y are right-handed; else the
    triangles are reversed, and the material is seen from its other side: x is mirrored, the warp stays along y.
    """
    across = -points[:, 0] if follows else points[:, 0]
    rows = triangles if follows else triangles[:, ::-1]
    return rows, np.stack([points[:, 1], across], axis=1)[rows]


def seam_pairs(stitch: Stitch, edges: Mapping[Side, Ints]) -> Ints:
    """Vertices that a stitch joins, (k, 2): start to end, or start to start for right on wrong; none to itself."""
    first, second = (edges[side] for side in stitch.sides)
    pairs = np.column_stack([first, second if stitch.right_wrong else second[::-1]])
    return pairs[pairs[:, 0] != pairs[:, 1]]
