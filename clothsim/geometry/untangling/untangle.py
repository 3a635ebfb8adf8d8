"""Untangling of cloth from itself and from a body: intersection contours shrink until the exact check finds no pair.

In each round, for each intersection contour, the surface whose region is to pass through the other is chosen
(`regions`; Baraff, Witkin & Kass 2003), and the ends of its edges just inside the contour are drawn through what they
pierce; contours without a region shrink along the gradient of their length (`contour_gradient`; Volino &
Magnenat-Thalmann 2006). The sheets take the smallest smooth motion that does so (`motion`).
"""

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points, as_triangles
from clothsim.base.errors import InputError
from clothsim.geometry.untangling.motion import Sheet
from clothsim.geometry.untangling.regions import Flags, make_mesh
from clothsim.geometry.untangling.search import Search, Untangled
from clothsim.mesh.cloth import triangle_planes

ROUNDS = 300
"""Largest number of rounds."""


def untangle(
    positions: Floats,
    triangles: Ints,
    rest_positions: Floats | None = None,
    *,
    material: Floats | None = None,
    body: tuple[Floats, Ints] | None = None,
    fixed: Flags | None = None,
    layers: Ints | None = None,
    gap: float | None = None,
    limits: tuple[float, float] | None = None,
    rounds: int = ROUNDS,
) -> Untangled:
    """Free cloth of intersections with itself and with a body.

    Parameters
    ----------
    positions : (n, 3) array
        Positions of all cloths [m].
    triangles : (m, 3) int array
        Their triangles.
    rest_positions : (n, 3) array, optional
        Rest shape, whose strain is bounded [m]; None: `positions`.
    material : (m, 3, 2) array, optional
        Flat rest shape of each triangle [m], in place of that of the rest positions.
    body : (positions (k, 3), triangles (l, 3)), optional
        Closed body, wound outwards, which does not move.
    fixed : (n,) bool array, optional
        Vertices that do not move.
    layers : (n,) int array, optional
        Layer of each vertex, larger farther out; where two layers intersect, that decides which side each belongs on.
        Triangles are then wound outwards.
    gap : float, optional
        Distance to which what pierces is drawn beyond what it pierced [m]; None: a tenth of the median edge.
    limits : (float, float), optional
        Principal stretches to which triangles are brought back, also where nothing intersects; None: .6 to 1.3, wider
        where the start is.
    rounds : int
        Largest number of rounds.

    Returns
    -------
    Untangled

    Examples
    --------
    >>> from clothsim.mesh.generators.sheets import rectangle
    >>> points, triangles = rectangle(size=(1.0, 1.0), cells=(8, 8))
    >>> points[40, 2] = 0.01
    >>> both = np.concatenate([points, points * [0.9, 0.9, 0] + [0, 0, 0.005]])
    >>> result = untangle(both, np.concatenate([triangles, triangles + 81]))
    >>> result.pairs_before > 0, result.end, result.pairs
    (True, 'free', 0)
    """
    x, faces, fixed, obstacle, solid = _checked(positions, triangles, fixed, layers, body)
    rest = x if rest_positions is None else as_points("rest_positions", rest_positions)
    shape = triangle_planes(rest, faces) if material is None else np.asarray(material, np.float64)
    sheet = Sheet(x, faces, shape, fixed, limits)
    mesh = make_mesh(faces, sheet.areas, len(x))
    step = float(np.median(np.linalg.norm(shape - np.roll(shape, 1, axis=1), axis=2)))
    apart = 0.1 * step if gap is None else float(gap)
    search = Search(x, sheet, mesh, obstacle, solid, layers, apart, limits is not None)
    return search.run(step, rounds)


def _checked(
    positions: Floats, triangles: Ints, fixed: Flags | None, layers: Ints | None, body: tuple[Floats, Ints] | None
) -> tuple[Floats, Ints, Flags, Floats, Ints]:
    """Positions, triangles, fixed vertices, the body's positions, and its triangles numbered behind the cloth."""
    x = as_points("positions", positions)
    faces = as_triangles("triangles", triangles, len(x))
    fixed = np.zeros(len(x), bool) if fixed is None else np.asarray(fixed, bool)
    for name, values in (("fixed", fixed), ("layers", layers)):
        if values is not None and np.shape(values) != (len(x),):
            raise InputError(f"{name} must have shape ({len(x)},), not {np.shape(values)}.")
    if body is None:
        return x, faces, fixed, np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    obstacle = as_points("body positions", body[0])
    return x, faces, fixed, obstacle, as_triangles("body triangles", body[1], len(obstacle)) + len(x)
