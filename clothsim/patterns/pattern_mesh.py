"""Mesh of a sewing pattern: triangles of all panels, placed in space, and the vertices that its seams join."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.patterns.borders import Border, borders
from clothsim.patterns.curves import scaled_curve
from clothsim.patterns.gathers import gather_notes
from clothsim.patterns.limits import refuse_too_fine
from clothsim.patterns.orientation import turned_panels
from clothsim.patterns.panel_mesh import PanelMesh, mesh_panel
from clothsim.patterns.pattern import Pattern, Side, Stitch
from clothsim.patterns.self_crossing import refuse_self_crossing
from clothsim.patterns.slivers import without_slivers

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

    Returns
    -------
    PatternMesh

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
