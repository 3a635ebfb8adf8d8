"""Fields of a deformed cloth: deformation gradient, stretch, thickness, frames, stress and contact pressure.

One table, FIELDS, from the name of a field to its location (triangle or vertex), unit and formula. All of them are
functions of the world and of the positions x; contact pressure needs the energies bound to the step too. Tensors of a
triangle are in its material axes: the first is the warp, the second the weft. Of a membrane on pairs of triangles,
stress and energy are the means over a pair.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.inputs import did_you_mean
from clothsim.base.triangles import thirds_at_vertices, triangle_areas
from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients, thread_axes
from clothsim.geometry.kinematics.kabsch_frames import vertex_frames as kabsch_frames
from clothsim.geometry.kinematics.stretch import (
    PolarDecomposition,
    deformed_thickness,
    polar_decomposition,
    principal_stretches,
)
from clothsim.mesh.topology import vertex_rings
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.protocols import is_idle, restricted


@runtime_checkable
class PairMembrane(Protocol):
    """A membrane that is a sum over pairs of triangles; a single triangle has its last corner twice.

    elements (p, 4): shared edge and both opposite corners; rates (p, 3, 4, 2): gradients of the shape functions of the
    pair and of both triangles, in the frame of the first; per_element: names of all arrays with one row an element.
    """

    elements: Ints
    rates: Floats
    per_element: tuple[str, ...]


def pair_stress(membrane: PairMembrane, world: World, x: Floats) -> Floats:
    """First Piola-Kirchhoff stress [N/m] in the frame of each triangle, (m, 3, 2), the mean over its pair.

    The mean of P over an element is sum of f_v X_v' / A, f_v = dE/dx_v of the element alone and X_v its rest positions,
    of any energy (mean stress theorem); here with the pair unfolded about its common edge.
    """
    from clothsim.physics.energies.triangle_pairs import turns

    separate, y, first, second = _separate_pairs(membrane, world, x)
    forces = separate.gradient(y).reshape(-1, 4, 3)
    single = second < 0
    X = np.zeros((len(first), 4, 2))
    # rest positions of the last three vertices relative to the first, (p, 3, 2) [m], from their gradients
    edges = np.zeros((len(membrane.rates), 3, 2))
    edges[:, :2] = np.linalg.inv(membrane.rates[:, 1, 1:3]).transpose(0, 2, 1)
    edges[~single, 2] = np.linalg.inv(membrane.rates[~single][:, 2, [1, 3]])[:, :, 1]
    X[:, 1:] = edges
    areas = world.rest_areas[first] + np.where(single, 0.0, world.rest_areas[second])
    P = np.einsum("pvk,pvi->pki", forces, X) / areas[:, None, None]
    values = np.zeros((len(world.triangles), 3, 2))
    values[first] = P
    pairs = np.flatnonzero(~single)
    turned = turns(world, membrane.elements[pairs], np.stack([first[pairs], second[pairs]], axis=1))
    values[second[pairs]] = P[pairs] @ turned
    return values


def pair_energy_density(membrane: PairMembrane, world: World, x: Floats) -> Floats:
    """Energy of each pair over its reference area [J/m2], for each triangle, (m,)."""
    separate, y, first, second = _separate_pairs(membrane, world, x)
    arrays = {name: getattr(separate, name) for name in membrane.per_element}
    parts = ({name: array[k : k + 1] for name, array in arrays.items()} for k in range(len(first)))
    energies = np.array([replace(cast("Any", separate), **part).value(y) for part in parts])
    pairs = np.flatnonzero(second >= 0)
    areas = world.rest_areas[first].copy()
    areas[pairs] += world.rest_areas[second[pairs]]
    values = np.zeros(len(world.triangles))
    values[first] = energies / areas
    values[second[pairs]] = values[first[pairs]]
    return values


def _separate_pairs(membrane: PairMembrane, world: World, x: Floats) -> tuple[Energy, Floats, Ints, Ints]:
    """The membrane on pairs that share no vertex, their corners (4 p, 3), and the numbers of their triangles.

    The number of the second triangle is -1 where there is none.
    """
    elements = membrane.elements
    of_world = {tuple(row): k for k, row in enumerate(np.sort(world.triangles, axis=1).tolist())}
    first, second = (
        np.array([of_world.get(tuple(row), -1) for row in np.sort(elements[:, corners], axis=1).tolist()], np.int64)
        for corners in ([0, 1, 2], [0, 1, 3])
    )
    second[elements[:, 2] == elements[:, 3]] = -1
    separate = replace(cast("Any", membrane), elements=np.arange(elements.size).reshape(-1, 4))
    return separate, np.ascontiguousarray(x[elements.ravel()]), first, second


CONTACTS, FRICTION = ("body_contact", "self_contact"), "friction"

BLOCK = 64
"""Triangles whose energies are taken from one restriction of the membrane."""


@runtime_checkable
class TriangleMembrane(Protocol):
    """A membrane that is a sum over single triangles."""

    triangles: Ints

    def with_triangles(self, triangles: Ints) -> Energy:
        """The same elements between other vertices."""


@dataclass(frozen=True)
class Configuration:
    """A world at the positions x (N, 3) [m], relative to `world.origin`, and its energies by name.

    bound: whether the energies are those of a step, so that contact has its stiffness.
    """

    world: World
    x: Floats
    energies: Mapping[str, Energy]
    bound: bool = False

    @cached_property
    def F(self) -> Floats:  # noqa: N802 - the field's letter
        """Deformation gradients (m, 3, 2): the images of the first (warp) and of the second (weft) material axis."""
        own = deformation_gradients(self.x, self.world.triangles, self.world.rest_shape_inverses)
        return own @ self.axes

    @cached_property
    def axes(self) -> Floats:
        """The material axes in the plane of each triangle, (m, 2, 2): comparable from triangle to triangle."""
        return thread_axes(self.world, np.zeros(len(self.world.triangles)))

    @cached_property
    def stretch(self) -> PolarDecomposition:
        """F = R U of each triangle."""
        return polar_decomposition(self.F)


@dataclass(frozen=True)
class Scalar:
    """One number per row of a field, for a colour map.

    Parameters
    ----------
    compute : function of the values
        (k, ...) to (k,).
    name : str
        "norm", "angle"; "" where it is the field itself.
    unit : str, optional
        None where it is that of the field.
    stretch : bool
        True for positive numbers about 1, which a picture shows by their logarithm.
    """

    compute: Callable[[Floats], Floats]
    name: str = ""
    unit: str | None = None
    stretch: bool = False

    def __call__(self, values: Floats) -> Floats:
        """The numbers of the rows `values`."""
        return self.compute(values)


@dataclass(frozen=True)
class Field:
    """A named field of the cloth.

    Parameters
    ----------
    location : "triangle", "vertex" or "body"
        Where its values lie: one per triangle (m, ...), per cloth vertex (n, ...) or per vertex of the bodies (b, ...).
    unit : str
        SI unit, "" for a pure number.
    meaning : str
        The quantity, in a few words.
    compute : function of a Configuration
        The values, `(m, ...)` or `(n, ...)`.
    scalar : Scalar
        One number per triangle or vertex, for a colour map.
    components : tuple of int
        Shape of a row of a field of contact, () for a number.
    in_step : bool
        True where it needs the contact stiffness of a step.
    """

    location: Literal["triangle", "vertex", "body"]
    unit: str
    meaning: str
    compute: Callable[[Configuration], NDArray[np.floating]]
    scalar: Scalar
    components: tuple[int, ...] = ()
    in_step: bool = False


def at_start(name: str, world: World) -> Floats:
    """Values of a field of contact before the first step: zero, as contact has its stiffness from a step."""
    own = FIELDS[name]
    rows = world.n_cloth if own.location == "vertex" else sum(len(body.positions) for body in world.bodies)
    return np.zeros((rows, *own.components))


def field(name: str, configuration: Configuration) -> NDArray[np.floating]:
    """Values of the field `name`.

    name: a key of `FIELDS`. Returns (m, ...) for a field of the triangles, (n, ...) for one of the vertices. InputError
    for a name that is not in the table, or a field that needs an effect that is off.
    """
    return known_field(name).compute(configuration)


def known_field(name: str) -> Field:
    """The entry `name` of the table; InputError lists those that there are."""
    if name not in FIELDS:
        question = did_you_mean(name, FIELDS, 0.7)
        raise InputError(f"There is no field {name!r}.", f"{question} Known: {', '.join(FIELDS)}.".strip())
    return FIELDS[name]


def world_stretches(world: World, x: Floats) -> Floats:
    """Return the principal stretches of all cloth triangles, (m, 2), the larger first."""
    F = deformation_gradients(x[: world.n_cloth], world.triangles, world.rest_shape_inverses)
    return np.asarray(principal_stretches(F), np.float64)


def compression(at: Configuration) -> Floats:
    """max(0, 1 - l2), (m,): the wrinkle field of Rohmer et al. 2010 (Animation wrinkling, section 4)."""
    return np.maximum(0.0, 1.0 - at.stretch.principal_stretches[:, 1])


def thickness(at: Configuration) -> Floats:
    """l3 times the fabric's thickness [m], (m,): l3 of the compressible Neo-Hookean sheet in plane stress."""
    rest, nu = at.world.per_triangle("thickness"), at.world.per_triangle("poisson_ratio")
    return deformed_thickness(np.asarray(at.stretch.principal_stretches, np.float64), rest, nu)


def ring_rotations(at: Configuration) -> Floats:
    """Kabsch rotation of each vertex ring from the rest positions, (n, 3, 3)."""
    world = at.world
    rest = np.concatenate([cloth.rest_positions for cloth in world.cloths])
    return kabsch_frames(rest, at.x[: world.n_cloth], *vertex_rings(world.triangles, world.n_cloth)).rotations


def stress(at: Configuration) -> Floats:
    """First Piola-Kirchhoff membrane stress P = dpsi/dF per reference length [N/m], (m, 3, 2), of any material.

    On a triangle of its own the corner forces f1, f2 are A P Dm^-T, so P = [f1 f2] Dm' / A. On pairs it is the mean.
    """
    if isinstance(pairs := at.energies.get("membrane"), PairMembrane):
        return pair_stress(pairs, at.world, at.x) @ at.axes
    membrane, rows, x = _separate_triangles(at)
    forces = membrane.gradient(x).reshape(-1, 3, 3)
    edges = np.stack([forces[:, 1], forces[:, 2]], axis=2)
    values = np.zeros_like(at.F)
    P = edges @ np.swapaxes(at.world.rest_shapes[rows], 1, 2) / at.world.rest_areas[rows, None, None]
    values[rows] = P @ at.axes[rows]
    return values


def energy_density(at: Configuration) -> Floats:
    """Membrane energy per reference area [J/m2], (m,); of pairs the mean."""
    if isinstance(pairs := at.energies.get("membrane"), PairMembrane):
        return pair_energy_density(pairs, at.world, at.x)
    membrane, rows, x = _separate_triangles(at)
    values = np.zeros(len(at.world.triangles))
    # In two levels, as each restriction looks at all triangles of what it restricts.
    for block in np.array_split(np.arange(len(rows)), max(1, len(rows) // BLOCK)):
        part = restricted(membrane, _corners_of(block, len(x)), x)
        for k in block:
            values[rows[k]] = restricted(part, _corners_of(k, len(x)), x).value(x)
    return values / at.world.rest_areas


def contact_pressure(at: Configuration) -> Floats:
    """Force of the barriers on a vertex over its reference area [Pa], (n,)."""
    forces = _forces_of_step("contact_pressure", CONTACTS, at)[: at.world.n_cloth]
    return np.linalg.norm(forces, axis=1) / at.world.vertex_areas


def contact_force(at: Configuration) -> Floats:
    """Force of contact and friction on each cloth vertex [N], (n, 3)."""
    return _forces_of_step("contact_force", (*CONTACTS, FRICTION), at)[: at.world.n_cloth]


def body_force(at: Configuration) -> Floats:
    """Force of contact and friction on each vertex of the bodies [N], (b, 3)."""
    return _forces_of_step("body_force", (*CONTACTS, FRICTION), at)[rows_of_bodies(at.world)]


def body_pressure(at: Configuration) -> Floats:
    """Force of the barriers on a vertex of the bodies over its area there [Pa], (b,)."""
    rows = rows_of_bodies(at.world)
    forces = np.linalg.norm(_forces_of_step("body_pressure", CONTACTS, at)[rows], axis=1)
    triangles = at.world.body_triangles
    areas = thirds_at_vertices(triangle_areas(at.x[triangles]), triangles - rows.start, rows.stop - rows.start)
    return np.divide(forces, areas, out=np.zeros_like(forces), where=areas > 0)


def rows_of_bodies(world: World) -> slice:
    """Rows of x of all bodies."""
    return slice(world.n_unknowns, world.n_unknowns + sum(len(body.positions) for body in world.bodies))


def _forces_of_step(name: str, effects: Sequence[str], at: Configuration) -> Floats:
    """Minus the gradient of the energies of some effects, (N, 3) [N]. InputError where they are bound to no step."""
    if not at.bound:
        raise InputError(
            f"{name} needs the contact stiffness of the step.", f'Ask for it before the run: run.fields = ["{name}"].'
        )
    return acting_forces(at.energies, effects, at.x)


def acting_forces(energies: Mapping[str, Energy], effects: Sequence[str], x: Floats) -> Floats:
    """Minus the gradient of the energies of some effects that are not idle, (N, 3) [N]; zero where there are none."""
    acting = [energies[effect] for effect in effects if effect in energies and not is_idle(energies[effect])]
    return -sum((energy.gradient(x) for energy in acting), np.zeros_like(x))


def _separate_triangles(at: Configuration) -> tuple[Energy, Ints, Floats]:
    """The membrane on triangles that share no vertex, their numbers in the world, their corners (3 k, 3) [m]."""
    membrane = at.energies.get("membrane")
    if membrane is None:
        raise InputError("The scene has no membrane, so there is no membrane stress.", "Name [effects.membrane].")
    if not isinstance(membrane, TriangleMembrane):
        raise InputError(
            f"A {type(membrane).__name__} has no stress of a triangle.",
            'Use [effects.membrane] material = "neo_hookean".',
        )
    triangles = membrane.triangles
    of_world = {tuple(row): k for k, row in enumerate(at.world.triangles.tolist())}
    rows = np.array([of_world[tuple(row)] for row in triangles.tolist()], np.int64)
    separate = membrane.with_triangles(np.arange(triangles.size).reshape(-1, 3))
    return separate, rows, np.ascontiguousarray(at.x[triangles.ravel()])


def _corners_of(triangles: Ints, count: int) -> NDArray[np.bool_]:
    """True at the corners of some of the separate triangles, (count,)."""
    corners = np.zeros((count // 3, 3), bool)
    corners[triangles] = True
    return corners.ravel()


def _norm(values: Floats) -> Floats:
    return np.sqrt((values.reshape(len(values), -1) ** 2).sum(axis=1))


def _angle(rotations: Floats) -> Floats:
    """Angle of each rotation [rad]; a half turn has the trace -1."""
    return np.arccos(np.clip((np.trace(rotations, axis1=1, axis2=2) - 1) / 2, -1.0, 1.0))


def _largest(values: Floats) -> Floats:
    """The stretch furthest from 1 in |log l|."""
    logs = np.abs(np.log(np.maximum(values, 1e-6)))
    return np.take_along_axis(values, logs.argmax(axis=1)[:, None], axis=1)[:, 0]


NORM, ANGLE, ITSELF = Scalar(_norm, "norm"), Scalar(_angle, "angle", "rad"), Scalar(lambda values: values)
FARTHEST = Scalar(_largest, "farthest from 1", stretch=True)
MEAN_STRETCH = Scalar(lambda values: _norm(values) / np.sqrt(2), "mean stretch", stretch=True)
"""Root mean square of the two principal stretches: |F| / sqrt 2, 1 at rest."""


FIELDS: Mapping[str, Field] = {
    "deformation_gradient": Field("triangle", "", "F (3x2), material plane to space", lambda at: at.F, MEAN_STRETCH),
    "rotation": Field("triangle", "", "R3 (3x3) of F = R U", lambda at: at.stretch.R3, ANGLE),
    "right_stretch": Field("triangle", "", "U (2x2) of F = R U", lambda at: at.stretch.U, MEAN_STRETCH),
    "principal_stretches": Field("triangle", "", "l1 >= l2", lambda at: at.stretch.principal_stretches, FARTHEST),
    "principal_directions": Field(
        "triangle", "", "unit columns w1, w2 (3x2) in space", lambda at: at.stretch.spatial_directions, NORM
    ),
    "compression": Field("triangle", "", "max(0, 1 - l2), the wrinkle field", compression, ITSELF),
    "thickness": Field("triangle", "m", "thickness of the stretched sheet", thickness, ITSELF),
    "vertex_frames": Field("vertex", "", "Kabsch rotations (3x3) of the vertex rings", ring_rotations, ANGLE),
    "stress": Field("triangle", "N/m", "first Piola-Kirchhoff membrane stress (3x2)", stress, NORM),
    "energy_density": Field("triangle", "J/m2", "membrane energy per reference area", energy_density, ITSELF),
    "contact_pressure": Field(
        "vertex", "Pa", "contact force over reference area", contact_pressure, ITSELF, in_step=True
    ),
    "contact_force": Field(
        "vertex", "N", "force of contact and friction", contact_force, NORM, components=(3,), in_step=True
    ),
    "body_force": Field(
        "body", "N", "force of contact and friction on bodies", body_force, NORM, components=(3,), in_step=True
    ),
    "body_pressure": Field("body", "Pa", "contact force over area of bodies", body_pressure, ITSELF, in_step=True),
}
"""THE table of fields."""
