"""Losses: a number that rates a run, with its derivative with respect to the positions of the cloth in one frame."""

import abc
from collections.abc import Callable
from dataclasses import dataclass, field
from numbers import Real
from pathlib import Path

import igl
import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points, as_vector
from clothsim.base.errors import InputError
from clothsim.base.inputs import called
from clothsim.base.triangles import area_vectors, barycentric, connected
from clothsim.files.meshes.mesh_file import POINTS, read_cloud, read_mesh
from clothsim.mesh.topology import border_edges
from clothsim.mesh.world import World
from clothsim.run.results import open_run

Function = Callable[[Floats], tuple[float, Floats]]
"""Maps the positions (n, 3) [m] of all cloths to the loss and its derivative (n, 3)."""


class Loss(abc.ABC):
    """A function of the positions of all cloth vertices in one frame."""

    frame: int = -1
    """The frame, counted as in `run[frame]`."""

    @abc.abstractmethod
    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return the loss and its derivative (n, 3) at positions (n, 3) [m] of a cloth with triangles (m, 3)."""


@dataclass(frozen=True)
class Custom(Loss):
    """A custom loss: a function of the positions."""

    function: Function
    frame: int = -1

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return what the function returns. InputError if that is not a number with an array (n, 3)."""
        try:
            value, derivative = called("The loss", self.function, positions)
        except (TypeError, ValueError) as error:
            raise InputError(f"The loss cannot be called with positions: {error}.", "Return (value, dL/dx).") from error
        rows = as_points("The derivative of the loss", derivative)
        if rows.shape != positions.shape:
            raise InputError(f"The derivative of the loss has the shape {rows.shape}, the positions {positions.shape}.")
        return float(value), rows


@dataclass(frozen=True)
class OfMotion(Loss):
    """A custom loss of positions and velocities.

    Parameters
    ----------
    function : callable
        Maps the positions [m] and velocities [m/s] (n, 3) of all cloths to the loss and its derivatives with respect to
        both, (n, 3) each.
    frame : int
        Number of the frame, counted from the last if negative.
    """

    function: Callable[[Floats, Floats], tuple[float, Floats, Floats]]
    frame: int = -1

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return the loss of the cloth at rest."""
        value, by_x, _ = self.of_motion(positions, np.zeros_like(positions))
        return value, by_x

    def of_motion(self, positions: Floats, velocities: Floats) -> tuple[float, Floats, Floats]:
        """Return what the function returns. InputError if that is not a number with two arrays (n, 3)."""
        try:
            value, *given = called("The loss", self.function, positions, velocities)
            by_x, by_v = (as_points("The derivative of the loss", each) for each in given)
        except (TypeError, ValueError) as error:
            raise InputError(f"The loss cannot be called: {error}.", "Return (value, dL/dx, dL/dv).") from error
        if by_x.shape != positions.shape or by_v.shape != positions.shape:
            raise InputError(f"The loss has derivatives of {len(by_x)} and {len(by_v)} rows, not {len(positions)}.")
        return float(value), by_x, by_v


@dataclass(frozen=True)
class Distance(Loss):
    """Mean squared distance of the vertices to a target with the same numbering [m2].

    Parameters
    ----------
    target : (n, 3) array
        Positions [m].
    frame : int
        Number of the frame, counted from the last if negative.
    """

    target: Floats
    frame: int = -1

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return mean |x - t|^2 and 2 (x - t)/n."""
        target = as_points("target", self.target)
        if target.shape != positions.shape:
            raise InputError(f"The target has {len(target)} vertices, the cloth {len(positions)}.")
        away = positions - target
        return float((away**2).sum() / len(away)), 2 * away / len(away)


@dataclass(frozen=True)
class Scan(Loss):
    """Mean squared distance of points without correspondence to the cloth's surface [m2].

    Parameters
    ----------
    points : (k, 3) array
        Measured points [m].
    frame : int
        Number of the frame, counted from the last if negative.
    normals : (k, 3) array
        Normals of the points, on the same side as those of the cloth (counter-clockwise triangles). A point is left out
        if its normal and that of the closest triangle differ by more than 60 degrees: it lies on another layer, or on
        none. Empty: all points count.
    """

    points: Floats
    frame: int = -1
    normals: Floats = field(default_factory=lambda: np.zeros((0, 3)), repr=False)

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return mean |q - p(q)|^2, p(q) the closest point; its barycentric weights need no derivative (envelope)."""
        points, normals = as_points("points", self.points), as_points("normals", self.normals)
        face, closest = igl.point_mesh_squared_distance(points, positions, triangles)[1:3]
        if len(normals):
            if normals.shape != points.shape:
                raise InputError(
                    f"There are {len(points)} points and {len(normals)} normals.", "Give one for each point."
                )
            own = area_vectors(positions[triangles[face]])
            lengths = np.linalg.norm(own, axis=1) * np.linalg.norm(normals, axis=1)
            alike = np.asarray((own * normals).sum(axis=1) > 0.5 * lengths)  # to 60 degrees
            if not alike.any():
                raise InputError(
                    "No normal of the points agrees with that of the cloth there.",
                    "Turn them round, or leave them out.",
                )
            points, face, closest = points[alike], face[alike], np.asarray(closest)[alike]
        corners = triangles[face]
        weights = barycentric(positions[corners], np.asarray(closest))
        out = np.zeros_like(positions)
        away = np.einsum("kp,kpc->kc", weights, positions[corners]) - points
        np.add.at(out, corners.ravel(), (weights[:, :, None] * away[:, None, :]).reshape(-1, 3) * (2 / len(points)))
        return float((away**2).sum() / len(points)), out


@dataclass(frozen=True)
class Height(Loss):
    """Mean position of some vertices along a direction [m], such as the height of a hem.

    Parameters
    ----------
    vertices : sequence of int
        Rows of the positions; empty: all.
    direction : (3,) array
        Unit vector.
    frame : int
        Number of the frame, counted from the last if negative.
    """

    vertices: Ints | tuple[int, ...] = ()
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)
    frame: int = -1

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return mean d.x and d/k in the rows."""
        rows = np.asarray(self.vertices, np.int64) if len(self.vertices) else np.arange(len(positions))
        if len(rows) and (rows.min() < 0 or rows.max() >= len(positions)):
            raise InputError(f"The loss names vertex {rows.max()}, and the cloth has {len(positions)}.")
        along = as_vector("direction", self.direction)
        out = np.zeros_like(positions)
        np.add.at(out, rows, along / len(rows))
        return float((positions[rows] @ along).mean()), out


@dataclass(frozen=True)
class Girth(Loss):
    """Length of the curve in which the cloth meets a horizontal plane [m].

    Parameters
    ----------
    height : float
        Height of the plane [m].
    frame : int
        Number of the frame, counted from the last if negative.
    """

    height: float
    frame: int = -1

    def __post_init__(self) -> None:
        if not isinstance(self.height, Real):
            raise InputError(f"The height of a girth is {self.height!r}.", "Give the height of the plane in metres.")

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return the sum of |p - q| over the cut triangles, p and q on their edges."""
        above = positions[:, 2] > self.height
        cut = triangles[above[triangles].any(axis=1) & ~above[triangles].all(axis=1)]
        lonely = np.where(above[cut].sum(axis=1) == 1, above[cut].argmax(axis=1), (~above[cut]).argmax(axis=1))
        rows = np.arange(len(cut))
        tip, others = cut[rows, lonely], [cut[rows, (lonely + k) % 3] for k in (1, 2)]
        ends = [_crossing(positions, tip, other, self.height) for other in others]
        chord = ends[0][0] - ends[1][0]
        lengths = np.linalg.norm(chord, axis=1)
        if not len(cut):
            raise InputError(f"No triangle of the cloth is cut at the height {self.height:g} m.")
        units = chord / np.maximum(lengths, np.finfo(float).tiny)[:, None]
        out = np.zeros_like(positions)
        for sign, other, (_, t, slope) in zip((1.0, -1.0), others, ends, strict=True):
            # p = (1 - t) x_tip + t x_other, t = (h - z_tip)/(z_other - z_tip)
            by_t = sign * (units * slope).sum(axis=1)
            rise = positions[other, 2] - positions[tip, 2]
            for row, weight, by_z in ((tip, 1 - t, (t - 1) / rise), (other, t, -t / rise)):
                part = sign * weight[:, None] * units
                part[:, 2] += by_t * by_z
                np.add.at(out, row, part)
        return float(lengths.sum()), out


def _crossing(positions: Floats, first: Ints, second: Ints, height: float) -> tuple[Floats, Floats, Floats]:
    """Points at a height on edges, their parameters, and the edges."""
    edge = positions[second] - positions[first]
    t = (height - positions[first, 2]) / edge[:, 2]
    return positions[first] + t[:, None] * edge, t, edge


@dataclass(frozen=True)
class Silhouette(Loss):
    """Area within the projection of the cloth's border [m2], such as the shadow of a Cusick drape.

    Parameters
    ----------
    direction : (3,) array
        Unit vector along which it is seen.
    frame : int
        Number of the frame, counted from the last if negative.
    """

    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)
    frame: int = -1

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return d . sum of the triangles' vector areas, which only the border determines, as a positive number."""
        along = as_vector("direction", self.direction)
        a, b, c = (positions[triangles[:, k]] for k in range(3))
        area = float(0.5 * np.cross(b - a, c - a).sum(axis=0) @ along)
        out, sign = np.zeros_like(positions), np.sign(area)
        for corner, (p, q) in zip(range(3), ((b, c), (c, a), (a, b)), strict=True):
            np.add.at(out, triangles[:, corner], sign * 0.5 * np.cross(p - q, along))
        return abs(area), out


def as_loss(loss: Loss | Function) -> Loss:
    """Return a loss, also from a function of the positions of the last frame."""
    if isinstance(loss, Loss):
        return loss
    if isinstance(loss, type):
        raise InputError(f"The loss is the class {loss.__name__}.", f"Write {loss.__name__}().")
    if callable(loss):
        return Custom(loss)
    raise InputError(
        f"A loss is needed, not a value of the type {type(loss).__name__}.",
        "Give one of clothsim.gradients, such as Height(), or a function of the positions.",
    )


CORNER = np.pi / 4
"""Smallest turn of the border, within the cloth, at a vertex that is a corner [rad]."""


@dataclass(frozen=True)
class Hem(Loss):
    """Mean height of the lowest side of the border [m].

    The border is cut into sides at its corners, where the angles of the triangles at a vertex sum to half a turn less
    or more than CORNER, whatever the shape of the cloth in space.

    Parameters
    ----------
    sides : tuple of (k,) int arrays
        Vertices of the sides, as in `border_sides`.
    frame : int
        Number of the frame, counted from the last if negative.
    """

    sides: tuple[Ints, ...]
    frame: int = -1

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return the least mean z of a side and 1/k in its rows. InputError without a border."""
        if not self.sides:
            raise InputError("The cloth has no border, and so no hem.", "Use another loss, such as height.")
        lowest = min(self.sides, key=lambda side: float(positions[side, 2].mean()))
        return Height(lowest).evaluate(positions, triangles)


def hem_loss(world: World) -> Hem:
    """Return the loss of a scene's cloths: the lowest side of all their borders."""
    rest = np.concatenate([cloth.rest_positions for cloth in world.cloths])
    return Hem(border_sides(rest, world.triangles))


def border_sides(rest: Floats, triangles: Ints) -> tuple[Ints, ...]:
    """Return the vertices of each side of a border.

    Parameters
    ----------
    rest : (n, 3) float64
        Rest positions [m].
    triangles : (m, 3) int64
        Triangles.

    Returns
    -------
    tuple of (k,) int64 arrays
        Corners belong to both of their sides; a loop without corners is one side.

    Examples
    --------
    >>> from clothsim.mesh.generators.shapes import rectangle
    >>> [len(side) for side in border_sides(*rectangle(cells=(4, 2)))]
    [5, 3, 5, 3]
    """
    edges = border_edges(triangles)[0]
    corners = rest[triangles]
    u, v = (np.roll(corners, -k, axis=1) - corners for k in (1, 2))
    angles = np.arctan2(np.linalg.norm(np.cross(u, v), axis=2), (u * v).sum(axis=2))
    turns = np.abs(np.pi - np.bincount(triangles.ravel(), angles.ravel(), len(rest)).astype(np.float64))
    at, ends = np.nonzero(turns[edges] <= CORNER)
    n = len(edges)
    labels = connected(at, n + edges[at, ends], n + len(rest))[:n]
    return tuple(np.unique(edges[labels == label]) for label in np.unique(labels))


# Losses by name, and those of files: a drape to come to, or points measured on one.


def named_loss(name: str, world: World, value: float | Path | None = None, scale: float = 1.0) -> Loss:
    """Return the loss with a given name.

    Parameters
    ----------
    name : {"height", "hem", "silhouette", "girth", "target"}
        Mean height of the cloth, or of the side of its border that hangs lowest; area of its shadow on the ground;
        length of its cut with a level plane; squared distance to a drape.
    world : World
        Of the scene.
    value : float or Path, optional
        Height of the girth [m]; file of the target, as of `target_loss`.
    scale : float
        Metres per unit of that file.

    Raises
    ------
    InputError
        For another name, and a target that cannot be read.
    """
    if name == "target" and isinstance(value, Path):
        return target_loss(value, world, scale)
    if name not in ("height", "hem", "silhouette", "girth", "target"):
        raise InputError(f"There is no loss {name!r}.", "There are height, hem, silhouette, girth and target.")
    if name == "girth" and isinstance(value, int | float):
        return Girth(value)
    if name == "hem":
        return hem_loss(world)
    return Height() if name == "height" else Silhouette()


def target_loss(path: Path, world: World, scale: float = 1.0) -> Loss:
    """Return the loss of a target.

    Parameters
    ----------
    path : Path
        A mesh file, an .xyz file of points, or the directory of a run, whose last frame is the target.
    world : World
        Of the scene that is compared with it.
    scale : float
        Metres per unit of the file.

    Returns
    -------
    Loss
        `Distance` where the target has the triangles of the cloths in their order, `Scan` of its vertices else.

    Raises
    ------
    InputError
        For a target that cannot be read.
    """
    n = world.n_cloth
    if path.is_dir():
        frame = open_run(path)[-1]
        names = [cloth.name for cloth in world.cloths]
        if any(len(frame.positions.get(c.name, ())) != len(c.rest_positions) for c in world.cloths):
            raise InputError(f"The run in {path} has other cloths than {', '.join(names)}.", "Give a run of the scene.")
        return Distance(np.concatenate([frame.positions[name] for name in names]).astype(np.float64))
    if path.suffix.lower() == POINTS:
        points, normals = read_cloud(path, scale)
        return Scan(points, normals=normals)
    mesh = read_mesh(path, scale=scale)
    same = len(mesh.positions) == n and np.array_equal(mesh.triangles, world.triangles)
    return Distance(mesh.positions) if same else Scan(mesh.positions)
