"""Models of a garment on a moving body: from the motion to canonical positions.

A garment in the rest pose of a reference body (`transfer.canonical`) is mean + B c with coefficients c in a subspace.
A model gives c in each frame from inputs: the joints of the body now and a little before, their velocities and
accelerations, the shape of the body, the fabric. Kinds of models:

* skinned: c = 0, the mean garment;
* nearest: the coefficients of the frame of a training clip whose inputs are nearest;
* ridge: a linear map of the standardised inputs;
* recurrent: a linear map and a gated recurrent unit over the frames give a code, and the decoder of an auto-encoder the
  coefficients (`transfer.motion_regressor`; Santesteban et al. 2021, section 5).

All have one form of arrays, for one kind of file. Canonical garments have the body in one shape and pose, so that one
grid of signed distances keeps the vertices of every prediction out of it: those nearer than CLEARANCE are moved along
the gradient. After posing, a vertex may be inside where the body's own vertices do not follow the garment's averages.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from transfer.drape_autoencoder import DistanceGrid
from transfer.errors import TransferError
from transfer.networks import network, read_layers
from transfer.subspace import Subspace, nearest
from transfer.triangle_surface import Floats

NUMBERS = ("centre", "scale", "low", "high", "reference")
GRID = ("origin", "spacing", "values")
CLEARANCE = 4e-3
"""Distance from the body to which vertices are moved [m]: a chord of 4 cm leaves an arm by 2 to 4 mm."""
PUSHES = 3
"""Steps in which they are moved: the distance is interpolated."""
TEXTS = ("kind", "family", "free", "same", "same_as")


@dataclass(frozen=True, eq=False)
class MotionModel:
    """Model of a garment on a moving body.

    Attributes
    ----------
    kind : str
        One of KINDS.
    family : str
        sha256 of the garment and the body, without the keys that may differ.
    free, same, same_as : tuple of str
        Keys that may differ, keys that have the value of another one, and that other.
    rate : float
        Frames a second of the inputs, from time 0 on [1/s].
    space : Subspace
        Of canonical garments, all coordinates one after the other.
    centre, scale, low, high : (p,) ndarray
        Of the training inputs: mean, standard deviation, box to which inputs are clipped.
    reference : (n, 3) ndarray
        Body in its rest pose, beside which garments are canonical [m].
    grid : DistanceGrid
        Of the reference body.
    parts : mapping of str to ndarray
        Arrays of the kind.
    """

    kind: str
    family: str
    free: tuple[str, ...]
    same: tuple[str, ...]
    same_as: tuple[str, ...]
    rate: float
    space: Subspace
    centre: Floats
    scale: Floats
    low: Floats
    high: Floats
    reference: Floats
    grid: DistanceGrid
    parts: Mapping[str, Floats]

    def canonical(self, inputs: ArrayLike) -> Floats:
        """Canonical garments (f, k, 3) [m] of inputs (f, p), the frames of a motion in their order from time 0 on."""
        given = np.asarray(inputs, np.float64)
        if given.ndim != 2 or given.shape[1] != len(self.centre):
            raise TransferError(f"inputs are {given.shape}, not (f, {len(self.centre)}).", "Use the same skeleton.")
        points = self.space.drapes(KINDS[self.kind](self.parts, self.standard(given))).reshape(-1, 3)
        return pushed_out(self.grid, points, CLEARANCE).reshape(len(given), -1, 3)

    def standard(self, inputs: Floats) -> Floats:
        """Inputs (f, p) clipped to the box and standardised."""
        return np.asarray((np.clip(inputs, self.low, self.high) - self.centre) / self.scale)

    def arrays(self) -> dict[str, Any]:
        """All content by name, for `numpy.savez`; see `motion_model`."""
        made: dict[str, Any] = {name: np.array(getattr(self, name), np.str_) for name in TEXTS}
        made |= {name: getattr(self, name) for name in (*NUMBERS, "rate")}
        made |= {f"space.{each.name}": getattr(self.space, each.name) for each in fields(Subspace)}
        made |= {f"grid.{name}": getattr(self.grid, name) for name in GRID}
        return made | {f"part.{name}": value for name, value in self.parts.items()}


def motion_model(arrays: Mapping[str, Any]) -> MotionModel:
    """The model of the arrays of `MotionModel.arrays`.

    Raises
    ------
    TransferError
        An array is missing, is not finite, or does not fit the others.
    """
    try:
        texts = {name: arrays[name] for name in TEXTS}
        numbers = {name: _finite(name, arrays[name]) for name in (*NUMBERS, "rate")}
        space = Subspace(*(_finite(each.name, arrays[f"space.{each.name}"]) for each in fields(Subspace)))
        origin, spacing, values = (_finite(name, arrays[f"grid.{name}"]) for name in GRID)
    except KeyError as error:
        raise TransferError(f"The model has no {error.args[0]!r}.", "Learn it again.") from error
    kind, family = str(texts["kind"]), str(texts["family"])
    lists = {name: tuple(np.atleast_1d(texts[name]).tolist()) for name in TEXTS[2:]}
    parts = {name[5:]: _finite(name, arrays[name]) for name in arrays if name.startswith("part.")}
    count, size = len(np.atleast_1d(numbers["centre"])), space.mean.size
    fits = (
        kind in KINDS
        and all(numbers[name].shape == (count,) for name in NUMBERS[:4])
        and numbers["scale"].all()
        and numbers["reference"].shape[1:] == (3,)
        and numbers["rate"].shape == ()
        and numbers["rate"] > 0
        and size % 3 == 0
        and (origin.shape, spacing.shape, values.ndim) == ((3,), (), 3)
        and spacing > 0
        and space.basis.shape == space.dual.shape == (size, len(space.variances))
        and len(lists["same"]) == len(lists["same_as"])
    )
    if not fits:
        raise TransferError("The arrays of the model do not fit together.", "Learn it again.")
    rate = float(numbers.pop("rate"))
    rest: dict[str, Any] = {**lists, **numbers, "grid": DistanceGrid(origin, float(spacing), values)}
    made = MotionModel(kind=kind, family=family, rate=rate, space=space, parts=parts, **rest)
    try:
        KINDS[kind](parts, np.zeros((1, count)))  # a part that is missing or of another shape
        made.canonical(np.zeros((1, count)))
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise TransferError(f"The parts of the model do not fit its kind, {kind}.", "Learn it again.") from error
    return made


def _finite(name: str, array: Any) -> Floats:
    given = np.asarray(array, np.float64)
    if not np.isfinite(given).all():
        raise TransferError(f"{name} of the model is not finite.", "Learn it again.")
    return given


def pushed_out(grid: DistanceGrid, points: Floats, clearance: float) -> Floats:
    """Points (n, 3) [m] of which those nearer to the body than a clearance [m] were moved along the gradient.

    Examples
    --------
    >>> x, y, z = np.meshgrid(*3 * [np.arange(-2.0, 3.0)], indexing="ij")
    >>> wall = DistanceGrid(np.full(3, -2.0), 1.0, x)  # the body is x < 0
    >>> pushed_out(wall, np.array([[-0.5, 0.0, 0.0], [1.5, 0.0, 0.0]]), 0.25).round(12).tolist()
    [[0.25, 0.0, 0.0], [1.5, 0.0, 0.0]]
    """
    made = points.copy()
    for _ in range(PUSHES):
        near = np.flatnonzero(grid.signed_distance(made) < clearance)
        if not len(near):
            break
        at, half = made[near], 0.5 * grid.spacing * np.eye(3)
        slope = np.stack([grid.signed_distance(at + step) - grid.signed_distance(at - step) for step in half], axis=1)
        slope /= grid.spacing
        length = np.maximum((slope**2).sum(axis=1, keepdims=True), 0.25)  # far inside, two sides are as near
        made[near] = at + (clearance - grid.signed_distance(at))[:, None] * slope / length
    return made


def _skinned(parts: Mapping[str, Floats], inputs: Floats) -> Floats:
    return np.zeros((len(inputs), int(parts["components"])))


def _nearest(parts: Mapping[str, Floats], inputs: Floats) -> Floats:
    return nearest(parts["inputs"], parts["coefficients"], inputs @ parts["projection"])


def _ridge(parts: Mapping[str, Floats], inputs: Floats) -> Floats:
    return np.asarray(parts["offset"] + inputs @ parts["weights"])


def _recurrent(parts: Mapping[str, Floats], inputs: Floats) -> Floats:
    states = gated_unit({name: parts[name] for name in UNIT}, inputs)
    codes = parts["shift"] + inputs @ parts["linear"] + states @ parts["out"]
    return np.asarray(parts["unit"] * network(read_layers(parts, "decoder"), codes))


KINDS: dict[str, Callable[[Mapping[str, Floats], Floats], Floats]] = {
    "skinned": _skinned,
    "nearest": _nearest,
    "ridge": _ridge,
    "recurrent": _recurrent,
}
"""Coefficients (f, c) of the parts of a model and standardised inputs (f, p), by the kind."""

UNIT = ("into", "again", "bias")
"""Arrays of a gated recurrent unit of h numbers: (p, 3 h), (h, 3 h), (3 h,)."""


def gated_unit(parts: Mapping[str, Any], inputs: Any) -> Floats:
    """States (f, h) of a gated recurrent unit (Cho et al. 2014) over inputs (f, p), from 0."""
    driven = np.asarray(inputs, np.float64) @ parts["into"] + parts["bias"]
    state, states = np.zeros(parts["again"].shape[0]), []
    for row in driven:
        state = unit_step(parts["again"], state, row, np)
        states.append(state)
    return np.array(states).reshape(len(states), parts["again"].shape[0])


def unit_step(again: Any, state: Any, driven: Any, of: Any) -> Any:
    """The next state (..., h) of a gated recurrent unit; driven (..., 3 h): what its input adds; of: NumPy or JAX's."""
    h = again.shape[0]
    gates = driven[..., : 2 * h] + state @ again[:, : 2 * h]
    update, reset = (0.5 * (1.0 + of.tanh(0.5 * part)) for part in (gates[..., :h], gates[..., h:]))
    fresh = of.tanh(driven[..., 2 * h :] + (reset * state) @ again[:, 2 * h :])
    return update * state + (1.0 - update) * fresh
