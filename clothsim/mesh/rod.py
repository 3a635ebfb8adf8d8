"""Rod: a round wire, cord or thread on its own, as a line of vertices without triangles."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points
from clothsim.base.errors import InputError
from clothsim.keys.fabric import Fabric
from clothsim.mesh.cloth import Cloth


@dataclass(frozen=True, kw_only=True)
class Rod(Cloth):
    """A cloth without triangles, whose vertices are the centre line of a rod in order.

    Parameters
    ----------
    radius : float
        Of the round section [m].
    is_loop : bool
        True where the last vertex is joined to the first.
    lengths : (e,) float64
        Of the edges at rest [m].
    mass_per_length : float
        [kg/m].
    stretch_stiffness, bending_stiffness : float
        EA [N], EI [N m2].
    """

    radius: float
    is_loop: bool
    lengths: Floats
    mass_per_length: float
    stretch_stiffness: float
    bending_stiffness: float

    @cached_property
    def line(self) -> Ints:
        """Vertices in order, (e + 1,); a loop ends at the vertex at which it begins."""
        rows = np.arange(len(self.positions))
        return np.append(rows, 0) if self.is_loop else rows

    @cached_property
    def edges(self) -> Ints:
        """Sorted ends of each edge, (e, 2)."""
        return np.sort(np.column_stack([self.line[:-1], self.line[1:]]), axis=1)

    @cached_property
    def vertex_lengths(self) -> Floats:
        """Half of the edges beside each vertex, (n,) [m]."""
        halves = np.repeat(0.5 * self.lengths, 2)
        return np.bincount(self.edges.ravel(), weights=halves, minlength=len(self.positions)).astype(np.float64)


def make_rod(
    name: str,
    points: Floats,
    radius: float,
    density: float,
    youngs_modulus: float,
    *,
    is_loop: bool = False,
    lengths: Floats | None = None,
    velocity: Floats | tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Rod:
    """Make a rod of an isotropic material, straight at rest: EA = E pi r^2, EI = E pi r^4 / 4.

    Parameters
    ----------
    name : str
        Name in the scene.
    points : (n, 3) array_like
        Start positions of its vertices in order [m]; n >= 2, of a loop n >= 3.
    radius, density, youngs_modulus : float
        [m], [kg/m3], [Pa].
    is_loop : bool
        Join the last vertex to the first.
    lengths : (e,) array_like, optional
        Of its edges at rest [m]; default: as they are at the start.
    velocity : (3,) array_like
        At the start [m/s].

    Raises
    ------
    InputError
        Where there are too few points, an edge has no length, or the line doubles back: it names the edge.

    Examples
    --------
    >>> rod = make_rod("wire", [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]], 0.001, 7800.0, 2e11)
    >>> round(rod.bending_stiffness, 4), rod.edges.tolist()
    (0.1571, [[0, 1], [1, 2]])
    """
    start = as_points(f"{name} points", points)
    if len(start) < (3 if is_loop else 2):
        have = f"{len(start)} point{'' if len(start) == 1 else 's'}"
        raise InputError(f"{name} has {have}.", "A rod has two or more, a loop three or more.")
    closed = np.concatenate([start, start[:1]]) if is_loop else start
    with np.errstate(over="ignore"):  # named below
        sizes = np.linalg.norm(np.diff(closed, axis=0), axis=1) if lengths is None else np.asarray(lengths, np.float64)
    short = np.flatnonzero(~(sizes > 0))
    if short.size:
        raise InputError(f"{name}: its edge {short[0]} has no length.", "Remove the repeated point.")
    if not np.isfinite(sizes).all():
        raise InputError(f"{name}: its edge {sizes.argmax()} is infinite.", "Give points in metres.")
    _refuse_folded(name, closed, radius, is_loop)
    area = np.pi * radius**2
    fabric = Fabric(density * area / (2 * radius), 2 * radius, youngs_modulus, 0.0, 0.0)
    no_triangles = np.zeros((0, 3), np.int64), np.zeros((0, 3, 2))
    return Rod(
        name, start, *no_triangles, start, False, fabric, np.asarray(velocity, np.float64),
        radius=radius, is_loop=is_loop, lengths=sizes, mass_per_length=density * area,
        stretch_stiffness=youngs_modulus * area, bending_stiffness=youngs_modulus * area * radius**2 / 4,
    )  # fmt: skip


def _refuse_folded(name: str, line: Floats, radius: float, is_loop: bool) -> None:
    """InputError where two neighbouring edges lie in one another: contact and its check leave out what shares a vertex.

    They turn by more than a right angle, and the end of one is nearer to the other than the rod is thick.
    """
    edges = np.diff(line, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    before = edges / lengths[:, None]
    following = np.roll(before, -1, axis=0)[: None if is_loop else -1]
    cosines = np.einsum("ij,ij->i", before[: len(following)], following)
    shorter = np.minimum(lengths, np.roll(lengths, -1))[: len(following)]
    apart = shorter * np.linalg.norm(np.cross(before[: len(following)], following), axis=1)
    folded = np.flatnonzero((cosines < 0) & (apart < 2 * radius) & (shorter > 2 * radius))
    if folded.size:
        raise InputError(
            f"{name} doubles back at its point {(folded[0] + 1) % len(edges) if is_loop else folded[0] + 1}: its edges "
            "there lie in one another.",
            "Lead it round a bend that is wider than the rod is thick.",
        )
