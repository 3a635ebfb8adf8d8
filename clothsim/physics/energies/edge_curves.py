"""Curves along edges of the cloth, such as a waist or a hem: their vertices in order, and their lengths at rest."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.triangles import distinct_edges
from clothsim.keys.effect_tables import Band, Cord
from clothsim.keys.schema import Selection
from clothsim.mesh.topology import border_edges, half_edges
from clothsim.mesh.world import World
from clothsim.physics.energies.key_values import (
    TABLES,
    Schedule,
    of_pattern,
    schedule,
    selected_vertices,
    vertex_numbers,
)


@dataclass(frozen=True)
class EdgeCurve:
    """A connected line of edges.

    Parameters
    ----------
    vertices : (k,) int array
        Rows of x in order, k >= 2; a closed curve ends at the vertex at which it begins.
    lengths : (k - 1,) array
        Length of each edge at rest [m].
    """

    vertices: Ints
    lengths: Floats

    @property
    def edges(self) -> Ints:
        """Rows of x of the ends of each edge, (k - 1, 2)."""
        return np.column_stack([self.vertices[:-1], self.vertices[1:]])


def edge_curves(where: str, world: World, select: Selection) -> tuple[EdgeCurve, ...]:
    """The curves of a selection of vertices.

    Of a side or a box the edges of the border between selected vertices count, of { panel, edge } and { label } those
    of the pattern, and vertex numbers are taken in their order.

    Parameters
    ----------
    where : str
        Key of the scene, for messages.
    world : World
        Cloths and bodies.
    select : str, mapping or sequence of int
        As of pins.

    Returns
    -------
    tuple of EdgeCurve
        One for each connected piece, at least one.

    Raises
    ------
    InputError
        Where the selection has no edge, a line branches, or neighbouring numbers are not an edge of the cloth.
    """
    if isinstance(select, Mapping) and set(select) == {"panel"}:
        raise InputError(f"{where} names a whole panel.", "Name an edge of it: { panel = ..., edge = ... }.")
    if isinstance(select, str) or (isinstance(select, Mapping) and "box" in select):
        border = border_edges(world.triangles)[0]
        lines = chained(where, border[np.isin(border, selected_vertices(where, world, select)).all(axis=1)])
    elif isinstance(select, Mapping):
        lines = chained(where, _pattern_edges(where, world, select))
    else:
        lines = [vertex_numbers(where, np.asarray(select if len(select) else np.zeros(0, np.int64)), world.n_cloth)]
    if not len(world.triangles):
        raise InputError(f"{where} selects edges of cloth, and the scene has none.", "Add a [cloth], or leave it out.")
    if not lines or any(len(line) < 2 for line in lines):
        border_only = isinstance(select, (str, Mapping))
        raise InputError(
            f"{where} selects no edge of the {'border of the ' * border_only}cloth.",
            f"Name a side, or vertices in order. {TABLES}",
        )
    for line in lines:
        numbers = _numbers(np.sort(np.column_stack([line[:-1], line[1:]]), axis=1), world)
        twice = np.setdiff1d(np.arange(len(numbers)), np.unique(numbers, return_index=True)[1])
        if twice.size:
            ends = f"{line[twice[0]]} and {line[twice[0] + 1]}"
            raise InputError(f"{where} takes the edge between the vertices {ends} twice.", "Name each edge once.")
    return tuple(EdgeCurve(line, _lengths_at_rest(where, world, line)) for line in lines)


def chained(where: str, edges: Ints) -> list[Ints]:
    """Vertices in order of each connected line of `edges` (e, 2); a closed one ends where it begins.

    Examples
    --------
    >>> import numpy as np
    >>> chained("a waist", np.array([[7, 3], [3, 5], [1, 2], [5, 7]]))
    [array([1, 2]), array([3, 5, 7, 3])]
    """
    neighbours: dict[int, list[int]] = {}
    for a, b in distinct_edges(edges)[0].tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    branching = next((vertex for vertex, others in neighbours.items() if len(others) > 2), None)
    if branching is not None:
        raise InputError(f"{where}: its line branches at vertex {branching}.", "Give each line by itself.")
    lines = []
    for vertex in sorted(neighbours, key=lambda vertex: (len(neighbours[vertex]), vertex)):  # open lines from an end
        line = [vertex]
        while neighbours[line[-1]]:
            following = neighbours[line[-1]].pop(0)
            neighbours[following].remove(line[-1])
            line.append(following)
        if len(line) > 1:
            lines.append(np.array(line, np.int64))
    return lines


def _pattern_edges(where: str, world: World, select: Mapping[str, object]) -> Ints:
    """Edges (e, 2) of a panel's edge or of all edges of a label, those of the mesh that are left of them."""
    of_pattern(where, world, select)  # refuses unknown names
    found = [np.zeros((0, 2), np.int64)]
    for cloth, rows in zip(world.cloths, world.cloth_slices, strict=True):
        names = cloth.lines.labels.get(str(select.get("label")), ())
        if "edge" in select:
            names = ((str(select["panel"]), int(str(select["edge"]))),)
        found.append(cloth.lines.segments(name for name in names if name in cloth.lines.edges) + rows.start)
    edges = distinct_edges(np.concatenate(found))[0]
    return edges[np.isin(_numbers(edges, world), _numbers(world.edges, world))]


def _lengths_at_rest(where: str, world: World, line: Ints) -> Floats:
    """Length of each edge of a line [m], the mean of its triangles', which differ along a seam that is eased."""
    corners = np.concatenate([cloth.material_coordinates for cloth in world.cloths])
    sides = np.linalg.norm(corners[:, [1, 2, 0]] - corners, axis=2).ravel()
    directed = np.sort(half_edges(world.triangles), axis=1)
    numbers, group, count = np.unique(_numbers(directed, world), return_inverse=True, return_counts=True)
    means = np.bincount(group.ravel(), weights=sides) / count
    wanted = _numbers(np.sort(np.column_stack([line[:-1], line[1:]]), axis=1), world)
    at = np.minimum(np.searchsorted(numbers, wanted), len(numbers) - 1)
    absent = np.flatnonzero(numbers[at] != wanted)
    if absent.size:
        ends = f"{line[absent[0]]} and {line[absent[0] + 1]}"
        raise InputError(f"{where}: between the vertices {ends} the cloth has no edge.", "Give neighbours in order.")
    return np.asarray(means[at], np.float64)


def _numbers(edges: Ints, world: World) -> Ints:
    """One number for each sorted pair of vertices."""
    return edges[:, 0] * world.n_cloth + edges[:, 1]


def drawn_curves(
    where: str, world: World, tables: Sequence[Band | Cord], shortest: float
) -> Iterator[tuple[str, Schedule, Schedule, tuple[EdgeCurve, ...]]]:
    """Name, stiffness [N], length ratio and curves of each table of a scene whose stiffness is not 0 at all times.

    where: key of the tables; shortest: least length ratio. InputError names the table and key.
    """
    for k, each in enumerate(tables):
        name = f"{where}[{k}]"
        stiffness = schedule(f"{name}.stiffness", each.stiffness, 0.0)
        ratio = schedule(f"{name}.length_ratio", each.length_ratio, shortest)
        if not stiffness.is_zero:
            yield name, stiffness, ratio, edge_curves(f"{name}.select", world, each.select)
