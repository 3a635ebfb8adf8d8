"""Derivative of a force by the start of its step, by central differences: the default of every energy.

An energy binds itself to the start of a step (`Energy.begin`): positions, velocities, and both of the difference
formula. The derivative of a.g(x; start) by each entry takes two bindings; rows whose stencils do not meet are varied
together. That is checked against a difference along a random direction, and where an energy reaches further than its
stencils (the mean of a border, for the pressure of an open cloth), each row is varied alone.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import ByElement, explicit
from clothsim.physics.energies.protocols import PastSensitivity
from clothsim.physics.energies.step import Past, Step

SLOTS = ("positions", "velocities", "past_positions", "past_velocities")
STEP = 1e-6
"""Displacement of an entry as a fraction of the largest coordinate or speed."""
AGREEMENT = 1e-5
"""Relative difference to the derivative along a random direction above which rows are varied one by one."""

Bind = Callable[[Step], Energy]


def past_by_differences(bind: Bind, step: Step, x: Floats, adjoint: Floats) -> PastSensitivity:
    """Return d(adjoint . gradient(x)) by the start of a step.

    Parameters
    ----------
    bind : callable
        Binds the energy to a step.
    step : Step
        The step that is varied.
    x, adjoint : (N, 3) array
        Positions at the end of the step [m], and the adjoint of the forces [m].

    Returns
    -------
    PastSensitivity
        A part that the energy does not depend on is None.
    """
    bound = bind(step)
    reference, groups = bound.gradient(x), None
    parts: dict[str, Floats] = {}
    for slot in SLOTS:
        values = _values(step, slot)
        size = STEP * max(float(np.abs(values).max(initial=0.0)), 1e-3)
        direction = np.random.default_rng(1).standard_normal(values.shape)

        def force(values: Floats, slot: str = slot) -> Floats:
            return bind(_with(step, slot, values)).gradient(x)

        if np.array_equal(force(values + size * direction), reference):
            continue
        groups = _independent_rows(bound, x) if groups is None else groups
        wanted = float(np.vdot(adjoint, force(values + size * direction) - force(values - size * direction)))
        found = _grouped(force, values, size, adjoint, *groups)
        scale = float(np.linalg.norm(found)) * float(np.linalg.norm(direction))
        if abs(np.vdot(found, direction) - wanted / (2 * size)) > AGREEMENT * scale + 1e-300:
            found = _grouped(force, values, size, adjoint, *_single_rows(len(x)))
        parts[slot] = found
    return PastSensitivity(**parts)


def _grouped(
    force: Callable[[Floats], Floats], values: Floats, size: float, adjoint: Floats, groups: list[Ints], near: Floats
) -> Floats:
    """Derivatives by each entry of `values`, those of a group at a time; near (N, N): rows that act on one another."""
    out = np.zeros_like(values)
    for rows in groups:
        for k in range(3):
            offset = np.zeros_like(values)
            offset[rows, k] = size
            change = (adjoint * (force(values + offset) - force(values - offset))).sum(axis=1) / (2 * size)
            out[rows, k] = near[rows] @ change
    return out


def _independent_rows(bound: Energy, x: Floats) -> tuple[list[Ints], Floats]:
    """Groups of rows whose stencils have no row in common, and the stencils as a matrix (N, N) of zeros and ones."""
    near = np.eye(len(x))
    for hessian in explicit([bound.hessian(x, False)]):
        if not isinstance(hessian, ByElement):
            return _single_rows(len(x))
        for a in range(hessian.elements.shape[1]):
            for b in range(hessian.elements.shape[1]):
                near[hessian.elements[:, a], hessian.elements[:, b]] = 1.0
    meets = (near @ near) > 0
    colours = np.full(len(x), -1)
    for row in range(len(x)):
        taken = set(colours[meets[row]].tolist())
        colours[row] = next(c for c in range(len(x) + 1) if c not in taken)
    return [np.flatnonzero(colours == c) for c in range(int(colours.max(initial=-1)) + 1)], near


def _single_rows(n: int) -> tuple[list[Ints], Floats]:
    return [np.array([row]) for row in range(n)], np.ones((n, n))


def _values(step: Step, slot: str) -> Floats:
    past, name = step.past, slot.removeprefix("past_")
    return np.asarray(getattr(step if name == slot else past, name), np.float64)


def _with(step: Step, slot: str, values: Floats) -> Step:
    past = step.past
    held = replace(step, weighed=Past(past.positions, past.velocities, past.dt))
    name = slot.removeprefix("past_")
    changed: dict[str, Any] = {name: values}
    return replace(held, **changed) if name == slot else replace(held, weighed=replace(past, **changed))
