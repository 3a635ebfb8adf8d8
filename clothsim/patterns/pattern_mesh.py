"""Mesh of a sewing pattern: triangles of all panels, placed in space, and the vertices that its seams join.

A panel is triangulated by a hexagonal lattice inside its border, constrained Delaunay triangulation and smoothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pythoncdt as cdt

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.base.triangles import connected
from clothsim.patterns.borders import Border, borders, mended, refuse_self_crossing, without_slivers
from clothsim.patterns.curves import scaled_curve
from clothsim.patterns.pattern import Pattern, Side, Stitch, gather_notes, turned_panels

CLEARANCE = 0.65
"""Distance of lattice points from the border, as a fraction of the spacing: nearer ones would make flat triangles."""
ROUNDS = 10
"""Rounds of smoothing; more gain less than a degree."""
SHARP, INSERTIONS = 25.0, 8
"""Angle below which a triangle of a graded panel gets its circumcentre [degrees], and bound on the rounds."""
BLOCK = 2**22
"""Largest number of point-segment pairs that are held at once."""


@dataclass(frozen=True)
class PanelMesh:
    """Triangles of a panel.

    Attributes
    ----------
    points : (n, 2) array
        Vertices [m]; the first are the samples of the border in their order.
    triangles : (m, 3) int array
        Counter-clockwise in the plane.
    """

    points: Floats
    triangles: Ints


def mesh_panel(border: Floats, spacing: float, graded: bool = False) -> PanelMesh:
    """Triangulate the inside of a closed polygon; its vertices and sides stay as they are.

    Each round of smoothing moves every inner vertex to the mean of the centroids of its triangles, weighted by their
    areas, and triangulates again.

    Parameters
    ----------
    border : (k, 2) array
        Simple polygon of either sense [m].
    spacing : float
        Distance between neighbouring inner vertices [m].
    graded : bool
        True: circumcentres of sharp triangles are inserted between a border with short sides and the lattice.

    Examples
    --------
    >>> import numpy as np
    >>> from clothsim.patterns.pattern_mesh import mesh_panel
    >>> mesh = mesh_panel(np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]), 2.0)
    >>> len(mesh.points), len(mesh.triangles)
    (4, 2)
    """
    count = len(border)
    # a hexagonal lattice inside the border and clear of it, (n, 2) [m]
    low, high = border.min(axis=0), border.max(axis=0)
    height = spacing * np.sqrt(3) / 2
    rows = np.arange(int((high[1] - low[1]) / height) + 2)
    columns = np.arange(-1, int((high[0] - low[0]) / spacing) + 2)
    x, y = np.meshgrid(columns * spacing, rows * height)
    x[1::2] += spacing / 2
    centred = (high - low - [0, rows[-1] * height]) / 2  # a symmetric panel has a nearly symmetric lattice
    lattice = np.column_stack([x.ravel() + low[0] + centred[0] % spacing, y.ravel() + low[1] + centred[1]])
    points = np.concatenate([border, lattice[inside_and_clear(lattice, border, CLEARANCE * spacing)]])
    triangles = _constrained_delaunay(points, count)
    points, triangles = _smoothed(points, triangles, count)
    for _ in range(INSERTIONS if graded else 0):
        # circumcentres of triangles with a sharp angle, apart from one another and from the border, (k, 2) [m]
        corners = points[triangles]
        a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]  # twice
        lengths = np.sort(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2), axis=1)
        sine = area / (lengths[:, 1] * lengths[:, 2])
        square_a, square_b = (a**2).sum(axis=1), (b**2).sum(axis=1)
        offset = np.column_stack([b[:, 1] * square_a - a[:, 1] * square_b, a[:, 0] * square_b - b[:, 0] * square_a])
        centres = corners[:, 0] + offset / (2 * area)[:, None]
        radius = np.linalg.norm(offset, axis=1) / (2 * area)
        chosen: list[int] = []
        start, end = border, np.roll(border, -1, axis=0)
        for k in np.argsort(sine)[: int((sine < np.sin(np.radians(SHARP))).sum())]:
            outside = ((centres[k] - start) * (centres[k] - end)).sum(axis=1).min() > 0
            apart = all(np.linalg.norm(centres[k] - centres[j]) > max(radius[k], radius[j]) for j in chosen)
            if outside and apart and inside_and_clear(centres[k : k + 1], border, 0.0)[0]:
                chosen.append(int(k))
        inserted = centres[chosen]
        if not len(inserted):
            break
        points = np.concatenate([points, inserted])
        points, triangles = _smoothed(points, _constrained_delaunay(points, count), count)
    return PanelMesh(points, triangles)


def _smoothed(points: Floats, triangles: Ints, count: int) -> tuple[Floats, Ints]:
    """Points and triangles after all rounds of smoothing; the first `count` points stay."""
    for _ in range(ROUNDS if len(points) > count else 0):
        # to the mean of the centroids of the triangles of each point, weighted by their areas, (n, 2) [m]
        corners = points[triangles]
        area = np.repeat(enclosed_areas(corners), 3)
        centroids = np.repeat(corners.mean(axis=1), 3, axis=0)
        rows, n = triangles.ravel(), len(points)
        total = np.bincount(rows, weights=area, minlength=n)
        means = [np.bincount(rows, weights=area * c, minlength=n) / total for c in centroids.T]
        points[count:] = np.column_stack(means)[count:]
        triangles = _constrained_delaunay(points, count)
    return points, triangles


def inside_and_clear(points: Floats, border: Floats, clearance: float) -> np.ndarray:
    """Mask (n,) of the points inside a polygon (k, 2) and further than `clearance` [m] from all of its sides."""
    found = np.zeros(len(points), bool)
    block = max(1, BLOCK // len(border))
    start, end = border, np.roll(border, -1, axis=0)
    side = end - start
    lengths = np.maximum((side**2).sum(axis=1), np.finfo(float).tiny)
    for first in range(0, len(points), block):
        offset = points[first : first + block, None, :] - start
        along = np.clip((offset * side).sum(axis=2) / lengths, 0, 1)
        squared = ((offset - along[:, :, None] * side) ** 2).sum(axis=2).min(axis=1)
        y = points[first : first + block, None, 1]
        upward, downward = (start[:, 1] <= y) & (end[:, 1] > y), (end[:, 1] <= y) & (start[:, 1] > y)
        left = side[:, 0] * offset[:, :, 1] - side[:, 1] * offset[:, :, 0]
        winding = (upward & (left > 0)).sum(axis=1) - (downward & (left < 0)).sum(axis=1)
        found[first : first + block] = (winding != 0) & (squared > clearance**2)
    return found


def _constrained_delaunay(points: Floats, count: int) -> Ints:
    """Triangles inside the closed polygon of the first `count` points, counter-clockwise (m, 3)."""
    made: Any = cdt.Triangulation(cdt.VertexInsertionOrder.AUTO, cdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0)
    made.insert_vertices(np.ascontiguousarray(points))
    rows = np.arange(count, dtype=np.uint32)
    made.insert_edges(np.ascontiguousarray(np.column_stack([rows, np.roll(rows, -1)])))
    made.erase_outer_triangles_and_holes()
    return np.asarray(made.triangles_array()["vertices"], np.int64).reshape(-1, 3)


MOST_VERTICES = 300_000
"""Largest number of lattice points of a pattern: some hundred times what a drape takes minutes for."""


MOST_SAMPLES = 20_000
"""Largest number of border samples of a panel."""


def refuse_too_fine(pattern: Pattern, spacing: float) -> None:
    """InputError for a mesh of far too many vertices, before it is made."""
    total = 0.0
    for panel in pattern.panels.values():
        samples = sum(1 + panel.edge_length(number) / spacing for number in range(len(panel.edges)))
        if samples > MOST_SAMPLES:
            raise InputError(
                f"Panel {panel.name} would have {samples:.3g} vertices on its border at a size of {spacing:.3g} m "
                f"({len(panel.edges)} edges; at most {MOST_SAMPLES:,}).",
                "Choose a larger --size, or merge short edges.",
            )
        total += float(np.ptp(panel.vertices, axis=0).prod()) / (np.sqrt(3) / 2 * spacing**2)
    if total > MOST_VERTICES:
        least = spacing * np.sqrt(total / MOST_VERTICES)
        raise InputError(
            f"A size of {spacing:.3g} m would give about {total:.2g} vertices; at most {MOST_VERTICES:,} are meshed.",
            f"Choose a --size of {least:.2g} m or more.",
        )


def refuse_too_coarse(pattern: Pattern, spacing: float) -> None:
    """InputError for a size that no panel has: of another unit."""
    largest = max(float(np.ptp(panel.vertices, axis=0).max()) for panel in pattern.panels.values())
    if spacing > largest:
        raise InputError(
            f"The size of the mesh is {spacing:.3g} m, and the largest panel is {largest:.2g} m long.",
            "Give it with its unit, such as --size 2cm; in Python in metres, such as 0.02.",
        )


NARROWEST = 1e-3
"""Height of a triangle below which it counts as flat, as a fraction of its longest side."""


FLATTEST = 0.3
"""Least area of a triangle of a halved mesh with its new vertices on the curves of the border, as a fraction of that
with them on the chords: below it they stay on the chords."""


@dataclass(frozen=True)
class MeshedSeam:
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
    seams : tuple of MeshedSeam
        Seams in the order of the stitches.
    fractions : mapping of Side to (k,) array
        Fractions of the arc length of each edge at which its vertices lie.
    up : (3,) array
        Unit vector upward: y of the file, or of the body that the panels are placed on.
    """

    pattern: Pattern
    positions: Floats
    triangles: Ints
    material_coordinates: Floats
    panel_coordinates: Floats
    vertices: Mapping[str, slice]
    faces: Mapping[str, slice]
    edges: Mapping[Side, Ints]
    seams: tuple[MeshedSeam, ...]
    fractions: Mapping[Side, Floats]
    up: Floats = field(default_factory=lambda: np.array([0.0, 1.0, 0.0]))

    def labelled(self) -> dict[str, tuple[Side, ...]]:
        """Edges of each label."""
        found: dict[str, tuple[Side, ...]] = {}
        for side in self.edges:
            label = self.pattern.panels[side.panel].edges[side.edge].label
            if label:
                found[label] = (*found.get(label, ()), side)
        return found

    def halved(self) -> tuple["PatternMesh", Ints]:
        """The mesh with each triangle divided into four at the middles of its sides, and the origin of its vertices.

        Triangle t is divided into 4 t to 4 t + 3. In space the surface stays. At rest the new vertices of the border
        lie on the curves of the pattern, but where a triangle would become flat.

        Returns
        -------
        mesh : PatternMesh
        parents : (n, 2) int array
            Vertices in whose middle each vertex lies: one twice where it was a vertex.
        """
        points, triangles, parents = [], [], []
        vertices: dict[str, slice] = {}
        edges: dict[Side, Ints] = {}
        fractions: dict[Side, Floats] = {}
        n = 0
        for name, panel in self.pattern.panels.items():
            rows, corners = self.vertices[name], self.triangles[self.faces[name]] - self.vertices[name].start
            count = rows.stop - rows.start
            sides = np.sort(corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
            links, inverse = np.unique(sides, axis=0, return_inverse=True)
            (a, b, c), (ab, bc, ca) = corners.T, count + inverse.reshape(-1, 3).T
            divided = np.stack([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]).transpose(2, 0, 1).reshape(-1, 3)
            plane = self.panel_coordinates[rows]
            flat = np.concatenate([plane, plane[links].mean(axis=1)])
            curved, middle_of = flat.copy(), {(*link,): count + k for k, link in enumerate(links.tolist())}
            for number in range(len(panel.edges)):
                side = Side(name, number)
                line, at = (self.edges[side] - rows.start).tolist(), self.fractions[side]
                new = [middle_of[min(pair), max(pair)] for pair in zip(line, line[1:], strict=False)]
                at_new = (at[:-1] + at[1:]) / 2
                ends = panel.edge_points(number, at)
                curved[new] += panel.edge_points(number, at_new) - (ends[:-1] + ends[1:]) / 2
                edges[side] = np.insert(line, np.arange(1, len(line)), new) + n
                fractions[side] = np.insert(at, np.arange(1, len(line)), at_new)
            for _ in range(3):  # a triangle at a corner has two sides on the border
                before, after = (enclosed_areas(each[divided]) for each in (flat, curved))
                flattened = np.unique(divided[after / before < FLATTEST])
                curved[flattened] = flat[flattened]
            points.append(curved)
            triangles.append(divided + n)
            parents.append(rows.start + np.concatenate([np.repeat(np.arange(count)[:, None], 2, axis=1), links]))
            vertices[name] = slice(n, n + len(flat))
            n += len(flat)
        both, plane = np.concatenate(parents), np.concatenate(points)
        # x of the panel is mirrored in the material plane where the front is the other side
        across = self.panel_coordinates[self.triangles][..., 0]
        mirrored = (self.material_coordinates[..., 1] * across).sum(axis=1) < 0
        sign, corners = np.where(np.repeat(mirrored, 4), -1.0, 1.0)[:, None], plane[np.concatenate(triangles)]
        material = np.stack([corners[..., 1], sign * corners[..., 0]], axis=-1)
        fine = replace(
            self,
            positions=self.positions[both].mean(axis=1),
            triangles=np.concatenate(triangles),
            material_coordinates=material,
            panel_coordinates=plane,
            vertices=vertices,
            faces={name: slice(4 * rows.start, 4 * rows.stop) for name, rows in self.faces.items()},
            edges=edges,
            seams=tuple(MeshedSeam(seam.stitch, seam_pairs(seam.stitch, edges)) for seam in self.seams),
            fractions=fractions,
        )
        return fine, both


def enclosed_areas(corners: Floats) -> Floats:
    """Twice the signed areas of triangles (m, 3, 2) in a plane, (m,) [m2]."""
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(edge[:, 0] * other[:, 1] - edge[:, 1] * other[:, 0])


def mesh_pattern(pattern: Pattern, spacing: float, halvings: int = 0) -> PatternMesh:
    """Mesh the panels of a pattern.

    Parameters
    ----------
    pattern : Pattern
        Panels and stitches.
    spacing : float
        Distance between neighbouring vertices [m].
    halvings : int
        Mesh at 2^halvings times the spacing, for a mesh that will be `halved` as often.

    Raises
    ------
    InputError
        A panel that crosses itself, stitches that make the garment one-sided, or a seam whose two sides share a
        triangle.
    """
    spacing = as_positive("The size of the mesh", spacing)
    turned = turned_panels(pattern)
    refuse_too_fine(pattern, spacing)
    pattern = without_slivers(pattern, spacing)  # none that the halved mesh has room for: a seam may be one
    spacing *= 2**halvings
    refuse_too_coarse(pattern, spacing)
    sampled = borders(pattern, spacing)
    repairs = []
    for panel in pattern.panels.values():
        sampled[panel.name], note = mended(panel, sampled[panel.name])
        repairs += [note] if note else []
        refuse_self_crossing(panel, sampled[panel.name])
    parts, n, m = [], 0, 0
    vertices: dict[str, slice] = {}
    faces: dict[str, slice] = {}
    edges: dict[Side, Ints] = {}
    for name, panel in pattern.panels.items():
        border = sampled[name]
        mesh = _meshed(name, border, spacing)
        follows = border.counter_clockwise != turned[name]
        triangles, corners = wound_for_front(mesh.points, mesh.triangles, follows)
        parts.append((panel.placed(mesh.points), triangles + n, corners, mesh.points))
        edges |= {Side(name, number): border.along(number) + n for number in range(len(panel.edges))}
        vertices[name], faces[name] = slice(n, n + len(mesh.points)), slice(m, m + len(triangles))
        n, m = vertices[name].stop, faces[name].stop
    positions, triangles, corners, plane = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    seams = tuple(MeshedSeam(stitch, seam_pairs(stitch, edges)) for stitch in pattern.stitches)
    pattern = replace(pattern, notes=(*pattern.notes, *repairs, *gather_notes(pattern, spacing)))
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
        raise InputError(f"Panel {name} cannot be triangulated: {reason}.", "Check its vertices.") from error
    corners = mesh.points[mesh.triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    heights = np.abs(enclosed_areas(corners)) / sides.max(axis=1)
    thinnest = int(np.argmin(heights))
    if heights[thinnest] < NARROWEST * min(spacing, float(sides[thinnest].max())):
        x, y = corners[thinnest].mean(axis=0)
        raise InputError(
            f"Panel {name} is {1e6 * heights[thinnest]:.2g} micrometres wide near ({x:.3g}, {y:.3g}) m: its triangles "
            "there would have no area.",
            "Move its edges apart there.",
        )
    return mesh


def wound_for_front(points: Floats, triangles: Ints, follows: bool) -> tuple[Ints, Floats]:
    """Triangles wound for the front of the garment, and their corners in the material plane, (m, 3, 2) [m].

    follows: True if the front of the sewn garment is the side from which the panel's x, y are right-handed; else the
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


TOUCHING = 1e-4
"""Gap of a seam that is closed as placed [m]."""


def sewn_vertices(mesh: PatternMesh, seams: Sequence[MeshedSeam]) -> Ints:
    """Number of each vertex after `seams` are closed, (n,), as `joined_vertices`."""
    return joined_vertices(mesh, np.concatenate([np.zeros((0, 2), np.int64), *(seam.pairs for seam in seams)]))


def joined_vertices(mesh: PatternMesh, pairs: Ints | None = None) -> Ints:
    """Number of each vertex after `pairs` (k, 2) are joined, (n,): ascending in the order of the first of each group.

    None: those of all seams.
    InputError for pairs that join two corners of one triangle.
    """
    if pairs is None:
        return sewn_vertices(mesh, mesh.seams)
    labels = connected(pairs[:, 0], pairs[:, 1], len(mesh.positions))
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    number = rank[inverse.ravel()]
    corners = number[mesh.triangles]
    collapsed = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    if collapsed.any():
        face = int(np.flatnonzero(collapsed)[0])
        panel = next(name for name, rows in mesh.faces.items() if rows.start <= face < rows.stop)
        own = set(mesh.triangles[face].tolist())
        direct = [seam.name for seam in mesh.seams if any(own >= {*pair} for pair in seam.pairs.tolist())]
        what = f"The seam {direct[0]} joins" if direct else f"The seams of {panel} join"
        raise InputError(
            f"{what} two corners of one triangle of {panel} ({int(collapsed.sum())} such triangles).",
            "Mesh it finer: --size; edges that meet in a convex corner cannot be sewn to each other.",
        )
    return number


def largest_gap(positions: Floats, seam: MeshedSeam) -> float:
    """Largest distance of the two sides of a seam [m]; 0 if they are one vertex throughout."""
    if not len(seam.pairs):
        return 0.0
    ends = positions[seam.pairs]
    return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max())
