"""Meshes in memory: arrays, objects of trimesh, pyvista, meshio and scikit-fem, and the text of a run.

Objects are distinguished by their attributes, so that none of the libraries is imported.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.keys.mesh_arrays import TEXT, MeshArrays

REMEDIES = {
    "MultiBlock": "Give its surface: mesh.combine().extract_surface().triangulate().",
    "PointSet": "Give a surface mesh: vertices and triangles.",
    "PointCloud": "Give a surface mesh: vertices and triangles.",
    "Scene": "Give one mesh of it: scene.to_mesh().",
    "tuple": "Give two arguments, not a pair: clothsim.Cloth(vertices, triangles), clothsim.Body(vertices, triangles).",
    "list": "Give two arguments, not one: clothsim.Cloth(vertices, triangles), clothsim.Body(vertices, triangles).",
    "ndarray": "Give the triangles too: clothsim.Cloth(vertices, triangles), clothsim.Body(vertices, triangles).",
}
"""Remedies for the objects of these libraries that are not meshes, by the name of their type."""
KNOWN = (
    "Give vertices and triangles, or a mesh of trimesh, pyvista, meshio or scikit-fem; "
    'a file is named in a table: {"mesh": "shirt.obj"}.'
)

FACES = ("triangle", "quad", "polygon")
LOWER = ("vertex", "line")
"""Cell types of meshio that a surface mesh may hold beside its faces."""
VTK_FACES = {5: [0, 1, 2], 7: None, 8: [0, 1, 3, 2], 9: [0, 1, 2, 3]}
"""Cell types of VTK that are faces, and the order of their corners around the face; None: as they are."""
VTK_LOWER = (0, 1, 2, 3, 4)

ROUND_OFF = 1e-12
"""Fraction of the size of a mesh below which two points are one."""

Faces = list[Ints]
"""Faces of one number of corners each, (k, corners)."""


def surface_of(where: str, mesh: Any) -> tuple[Floats, Ints]:
    """Vertices and triangles of a surface mesh; quads and polygons are cut into triangles.

    Parameters
    ----------
    where : str
        Dotted name of the value, for messages.
    mesh : object
        A trimesh.Trimesh, a pyvista.PolyData or a grid of faces, a meshio.Mesh, or a scikit-fem MeshTri or MeshQuad
        (of higher order or discontinuous too, where it is the same surface).

    Returns
    -------
    vertices : (n, 3) ndarray [m]
        A copy; flat meshes get z = 0.
    triangles : (m, 3) ndarray
        Vertex numbers.

    Raises
    ------
    InputError
        Where the object is not a mesh or surface.
    """
    kind, read = type(mesh).__name__, _reader_of(mesh)
    if read is None:
        raise InputError(f"{where} is of the type {kind}, which is not a surface mesh.", REMEDIES.get(kind, KNOWN))
    try:
        points, faces = read(where, mesh)
    except (TypeError, ValueError) as error:  # another library's object, whose faces may be anything
        sentence = f"{where}: the faces of the {kind} cannot be read ({error})."
        raise InputError(sentence, "Give vertices and triangles.") from error
    vertices = np.array(points, np.float64)
    if vertices.ndim != 2 or vertices.shape[1] not in (2, 3):
        raise InputError(f"{where}: its points have shape {vertices.shape}, not (n, 3).", "Give points in space.")
    if vertices.shape[1] == 2:
        vertices = np.column_stack([vertices, np.zeros(len(vertices))])
    faces = [block for block in faces if len(block)]
    if not faces:
        raise InputError(f"{where}: the {kind} has no faces.", "Give a surface mesh of triangles.")
    if all(block.shape[1] == 3 for block in faces):
        triangles = np.concatenate(faces).astype(np.int64)
    else:
        from clothsim.files.meshes.polygons import Polygons, cut_polygons  # SciPy, which triangles do not need

        corners = np.concatenate([block.ravel() for block in faces]).astype(np.int64)
        sizes = np.concatenate([np.full(len(block), block.shape[1]) for block in faces])
        if (sizes < 3).any():
            raise InputError(f"{where}: face {(sizes < 3).argmax()} has fewer than three corners.", "Remove it.")
        bad = np.flatnonzero((corners < 0) | (corners >= len(vertices)))
        if len(bad):
            raise InputError(f"{where} names vertex {corners[bad[0]]}, outside 0..{len(vertices) - 1}.", "Correct it.")
        rows, _, _ = cut_polygons(Polygons(vertices, corners, np.concatenate([[0], np.cumsum(sizes)])))
        triangles = corners[rows]
    return vertices, _wound_alike(vertices, triangles) if read is _read_skfem else triangles


def is_mesh(value: Any) -> bool:
    """True for an object that `surface_of` reads."""
    return _reader_of(value) is not None


def _wound_alike(vertices: Floats, triangles: Ints) -> Ints:
    """All triangles with the same winding, a flat mesh facing +z: scikit-fem sorts the vertices of each cell."""
    from clothsim.mesh.winding import joined_half_edges, turned_triangles

    if vertices[:, 2].any():
        turned = turned_triangles(triangles, joined_half_edges(triangles))[0]
    else:
        edge1, edge2 = (vertices[triangles[:, k], :2] - vertices[triangles[:, 0], :2] for k in (1, 2))
        turned = np.flatnonzero(edge1[:, 0] * edge2[:, 1] < edge1[:, 1] * edge2[:, 0])
    triangles = triangles.copy()
    triangles[turned] = triangles[turned][:, [0, 2, 1]]
    return triangles


def _read_polydata(where: str, mesh: Any) -> tuple[Any, Faces]:
    """Faces and strips of triangles."""
    padded = np.asarray(mesh.faces, np.int64)
    strips = [_unroll_strip(strip) for strip in _unpadded(np.asarray(getattr(mesh, "strips", ()), np.int64))]
    if len(padded) and len(padded) % 4 == 0 and (padded[::4] == 3).all():
        return mesh.points, [padded.reshape(-1, 4)[:, 1:], *strips]
    return mesh.points, [*(face[None] for face in _unpadded(padded)), *strips]


def _unpadded(padded: Ints) -> Iterator[Ints]:
    """Cells in VTK's padded form: [count, vertex, ..., count, ...]."""
    offset = 0
    while offset < len(padded):
        count = int(padded[offset])
        yield padded[offset + 1 : offset + 1 + count]
        offset += 1 + count


def _unroll_strip(strip: Ints) -> Ints:
    """The triangles of a strip of vertices (n,), (n - 2, 3): every second one is wound the other way in it."""
    triangles = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
    triangles[1::2] = triangles[1::2, [1, 0, 2]]
    return triangles


def _read_grid(where: str, mesh: Any) -> tuple[Any, Faces]:
    """Cells of an unstructured grid by VTK type."""
    faces = []
    for kind, cells in mesh.cells_dict.items():
        if int(kind) in VTK_FACES:
            order = VTK_FACES[int(kind)]
            corners = np.asarray(cells, np.int64)
            faces.append(corners if order is None else corners[:, order])
        elif int(kind) not in VTK_LOWER:
            remedy = "Give its surface: mesh.extract_surface().triangulate()."
            raise _no_surface(where, f"VTK cells of type {int(kind)}", remedy)
    return mesh.points, faces


def _read_meshio(where: str, mesh: Any) -> tuple[Any, Faces]:
    faces = []
    for block in mesh.cells:
        if block.type in FACES:
            faces.append(np.asarray(block.data, np.int64))
        elif block.type not in LOWER:
            raise _no_surface(where, f"cells of the type {block.type!r}", "Give its boundary triangles.")
    return mesh.points, faces


def _read_skfem(where: str, mesh: Any) -> tuple[Any, Faces]:
    """Points (2 or 3, n) and cells (corners, m); another mesh than one of first order where it is the same surface."""
    if mesh.elem.refdom.name not in ("Triangular", "Quadrilateral"):
        raise _no_surface(where, f"{mesh.elem.refdom.name.lower()} cells", "Give a MeshTri or MeshQuad.")
    points, cells = np.asarray(mesh.p, np.float64).T, np.asarray(mesh.t, np.int64).T
    if not hasattr(mesh, "dofs") or len(points) == mesh.nvertices:
        return points, [cells]
    nodes = np.asarray(points[mesh.dofs.element_dofs.T])  # (m, nodes, 2 or 3) of each cell: corners, sides, middle
    corners = nodes[:, : cells.shape[1]]
    vertices = np.zeros((int(cells.max()) + 1, points.shape[1]))
    vertices[cells] = corners
    sides, middle = corners[:, mesh.elem.refdom.facets].mean(axis=2), corners.mean(axis=1, keepdims=True)
    straight = np.concatenate([corners, sides, middle], axis=1)[:, : nodes.shape[1]]
    size = float(np.ptp(corners.reshape(-1, points.shape[1]), axis=0).max())
    if np.abs(np.concatenate([nodes - straight, vertices[cells] - corners], axis=1)).max() > ROUND_OFF * size:
        raise InputError(
            f"{where} is a {type(mesh).__name__} with curved sides or gaps between its cells.",
            f"Give straight triangles: skfem.{'MeshQuad' if cells.shape[1] == 4 else 'MeshTri'}.from_mesh(mesh).",
        )
    return vertices, [cells]


def _no_surface(where: str, has: str, remedy: str) -> InputError:
    return InputError(f"{where} has {has}, so it is not a surface.", remedy)


def _has(*names: str) -> Callable[[Any], bool]:
    return lambda mesh: not isinstance(mesh, type) and all(hasattr(mesh, name) for name in names)


def _is_meshio(mesh: Any) -> bool:
    cells = getattr(mesh, "cells", None)
    return hasattr(mesh, "points") and isinstance(cells, Iterable) and all(hasattr(block, "type") for block in cells)


Reader = Callable[[str, Any], tuple[Any, Faces]]
"""Points and faces of an object, whose name in messages comes first."""

_KINDS: tuple[tuple[Callable[[Any], bool], Reader], ...] = (
    (_has("vertices", "faces"), lambda where, mesh: (mesh.vertices, [np.asarray(mesh.faces).reshape(-1, 3)])),
    (_has("points", "faces"), _read_polydata),
    (_has("points", "cells_dict", "celltypes"), _read_grid),
    (  # a grid that is not unstructured, such as one of an image
        _has("points", "dimensions", "cast_to_unstructured_grid"),
        lambda where, mesh: _read_grid(where, mesh.cast_to_unstructured_grid()),
    ),
    (_is_meshio, _read_meshio),
    (_has("p", "t", "elem"), _read_skfem),
)


def _reader_of(mesh: Any) -> Reader | None:
    """What reads an object; None where it is not a mesh."""
    return next((read for is_of_kind, read in _KINDS if is_of_kind(mesh)), None)


def checked_mesh(where: str, vertices: Any, triangles: Any = None, **others: Any) -> MeshArrays:
    """The mesh of arrays, or of a mesh object where `triangles` is None; others: as of `MeshArrays.checked`.

    InputError for another shape, a number that is not finite or an index out of range: it names array and index.
    """
    if triangles is None:
        name = where if is_mesh(vertices) else f"{where}.vertices"
        vertices, triangles = surface_of(name, vertices)
    return MeshArrays.checked(where, vertices, triangles, **others)


def mesh_arrays(where: str, value: Any) -> MeshArrays:
    """The mesh in memory that a key `mesh` holds: arrays, a mesh object, or the text of one.

    InputError where it is none of them.
    """
    if isinstance(value, MeshArrays):
        return value
    if isinstance(value, Mapping):
        if set(value) == {TEXT}:
            return MeshArrays.from_text(where, value[TEXT])
        raise InputError(
            f"{where} must be a mesh, not a table with {', '.join(map(repr, value)) or 'no key'}.",
            "Name a generator or a file; or give a mesh object, or clothsim.Cloth(vertices, triangles).",
        )
    if isinstance(value, tuple | list):
        if len(value) != 2:
            raise InputError(
                f"{where} has {len(value)} entries.", "Give a pair (vertices, triangles), or clothsim.Cloth(...)."
            )
        return checked_mesh(where, *value)
    return checked_mesh(where, value)
