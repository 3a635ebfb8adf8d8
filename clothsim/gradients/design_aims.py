"""Aims of a design: losses that are 1 where a quantity is off by its tolerance, and less where it is met."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol, runtime_checkable

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.gradients.losses import Girth, Loss, Silhouette
from clothsim.gradients.scene_of_pattern import shaped_scene
from clothsim.patterns.pattern_mesh import PatternMesh
from clothsim.scene.scene import Scene


@runtime_checkable
class SeesMaterial(Protocol):
    """An aim that looks at the rest shape of the cloth as well."""

    def cut_to(self, material: Floats) -> Loss:
        """Return the aim for a cloth with these corners of its triangles at rest, (m, 3, 2) [m]."""
        ...


def aims(
    scene: Scene,
    pattern: PatternMesh | None = None,
    *,
    hem: tuple[Sequence[tuple[str, int]], float] | None = None,
    girth: tuple[float, float] | None = None,
    silhouette: float | None = None,
    stretch: float | None = None,
    tolerance: float = 1e-3,
) -> dict[str, Loss]:
    """Return the aims of `clothsim.design` that are given, by name.

    Parameters
    ----------
    scene, pattern
        As of `clothsim.design`.
    hem : (sequence of (panel, edge), height), optional
        Edges of panels, and their height [m].
    girth : (height, length), optional
        Length of the cut at a height [m].
    silhouette : float, optional
        Area of the shadow on the ground [m2], to 1 %.
    stretch : float, optional
        Largest stretch.
    tolerance : float
        Of hem and girth [m].

    Raises
    ------
    InputError
        For a scene without a pattern, or an edge that it has not.
    """
    shaped, made = shaped_scene(scene, pattern), dict[str, Loss]()
    if hem is not None:
        edges, height = hem
        made["hem"] = HemAt(np.unique(np.concatenate([shaped.edge_rows(*edge) for edge in edges])), height, tolerance)
    if girth is not None:
        height, length = girth
        made["girth"] = Measured(Girth(height), length, tolerance)
    if silhouette is not None:
        made["silhouette"] = Measured(Silhouette(), silhouette, 0.01 * silhouette)
    if stretch is not None:
        made["stretch"] = StretchBelow(stretch)
    return made


@dataclass(frozen=True)
class HemAt(Loss):
    """A hem at a height all around: mean ((z - height)/tolerance)^2 of its vertices.

    Parameters
    ----------
    vertices : sequence of int
        Vertices of the hem.
    height : float
        Where it is to be [m].
    tolerance : float
        Root mean square distance that is allowed [m].
    """

    vertices: Ints | Sequence[int]
    height: float
    tolerance: float = 1e-3
    frame: int = -1

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return mean ((z - h)/tolerance)^2 and its derivative."""
        rows = np.asarray(self.vertices, np.int64)
        if not len(rows) or rows.min() < 0 or rows.max() >= len(positions):
            raise InputError(f"The hem has {len(rows)} vertices, and not all of them belong to the cloth.")
        away = (positions[rows, 2] - self.height) / self.tolerance
        out = np.zeros_like(positions)
        np.add.at(out[:, 2], rows, 2 * away / (len(rows) * self.tolerance))
        return float((away**2).mean()), out


@dataclass(frozen=True)
class Measured(Loss):
    """A measure at a value: ((loss - value)/tolerance)^2, with `Girth`, `Silhouette` or `Height` for the loss.

    Parameters
    ----------
    measure : Loss
        What is measured.
    value : float
        What it is to be, in its unit.
    tolerance : float
        Distance that is allowed.
    """

    measure: Loss
    value: float
    tolerance: float

    @property
    def frame(self) -> int:  # type: ignore[override]
        """The frame of the measure."""
        return self.measure.frame

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return ((L - v)/tolerance)^2 and its derivative."""
        value, derivative = self.measure.evaluate(positions, triangles)
        away = (value - self.value) / self.tolerance
        return away**2, 2 * away / self.tolerance * derivative


@dataclass(frozen=True)
class StretchBelow(Loss):
    """A stretch below a bound: mean over the area of (max(0, s - bound)/tolerance)^2, s the larger principal stretch.

    Parameters
    ----------
    bound : float
        Stretch, 1 at rest.
    tolerance : float
        Root mean square stretch beyond the bound that is allowed.
    material : (m, 3, 2) array
        Corners of the triangles at rest [m]; the design gives it.
    """

    bound: float
    tolerance: float = 2e-3
    material: Floats = field(default_factory=lambda: np.zeros((0, 3, 2)), repr=False)
    frame: int = -1

    def cut_to(self, material: Floats) -> "StretchBelow":
        """Return the aim for another rest shape."""
        return replace(self, material=material)

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return the mean and its derivative: d s/dF = u v' of the larger singular value of F = Ds Dm^-1."""
        left, stretch, right, inverse, area = _largest_stretch(positions, triangles, self.material)
        beyond = np.maximum(stretch - self.bound, 0.0) / self.tolerance
        weight = area / area.sum()
        by_f = (2 * weight * beyond / self.tolerance)[:, None, None] * left[:, :, None] * right[:, None, :]
        by_edges = by_f @ np.swapaxes(inverse, 1, 2)
        out = np.zeros_like(positions)
        for k in (1, 2):
            np.add.at(out, triangles[:, k], by_edges[:, :, k - 1])
            np.add.at(out, triangles[:, 0], -by_edges[:, :, k - 1])
        return float(weight @ beyond**2), out


def largest_stretch(positions: Floats, triangles: Ints, material: Floats) -> float:
    """Return the largest principal stretch of all triangles; material: corners at rest, (m, 3, 2) [m]."""
    return float(_largest_stretch(positions, triangles, material)[1].max())


def _largest_stretch(
    positions: Floats, triangles: Ints, material: Floats
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Left vectors, values and right vectors of the larger singular values of F, Dm^-1 and areas."""
    if material.shape != (len(triangles), 3, 2):
        raise InputError(f"The rest shape has {len(material)} triangles, the cloth {len(triangles)}.")
    rest = np.swapaxes(material[:, 1:] - material[:, :1], 1, 2)
    edges = np.swapaxes(positions[triangles[:, 1:]] - positions[triangles[:, :1]], 1, 2)
    inverse = np.linalg.inv(rest)
    u, s, v = np.linalg.svd(edges @ inverse, full_matrices=False)
    area = np.asarray(0.5 * np.abs(np.linalg.det(rest)), np.float64)
    return u[:, :, 0], s[:, 0], v[:, 0], np.asarray(inverse, np.float64), area
