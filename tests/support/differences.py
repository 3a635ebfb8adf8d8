"""Finite-difference checker of all derivatives of the package.

Errors are relative to the largest entry. A gradient or Hessian that is empty or all zero is refused: a test over
nothing must fail.
"""

import numpy as np

from clothsim.physics.energies.hessians import ByElement, SumHessian


def dense_hessian(energy, x, project=False):
    """The (3 N, 3 N) Hessian as a dense array."""
    hessian = energy.hessian(x, project)
    matrix = hessian.to_sparse(len(x)) if isinstance(hessian, ByElement | SumHessian) else hessian
    return matrix.toarray()


def numeric_gradient(energy, x, step=1e-6):
    """Central differences of the value, (N, 3)."""
    gradient = np.zeros_like(x)
    for index in np.ndindex(x.shape):
        ahead, behind = x.copy(), x.copy()
        ahead[index] += step
        behind[index] -= step
        gradient[index] = (energy.value(ahead) - energy.value(behind)) / (2 * step)
    return gradient


def numeric_hessian(energy, x, step=1e-6):
    """Central differences of the gradient, (3 N, 3 N)."""
    columns = []
    for index in np.ndindex(x.shape):
        ahead, behind = x.copy(), x.copy()
        ahead[index] += step
        behind[index] -= step
        columns.append((energy.gradient(ahead) - energy.gradient(behind)).ravel() / (2 * step))
    return np.array(columns).T


def gradient_error(energy, x, step=1e-6):
    """Largest difference of gradient and central differences, relative to the largest entry."""
    return _relative("gradient", energy.gradient(x), numeric_gradient(energy, x, step))


def hessian_error(energy, x, step=1e-6):
    """Largest difference of the exact Hessian and central differences of the gradient, relative."""
    return _relative("hessian", dense_hessian(energy, x), numeric_hessian(energy, x, step))


def taylor_slopes(energy, x, seed=0, sizes=(1e-2, 5e-3, 2.5e-3)):
    """Observed orders of |E(x+sd) - E - s g.d| (2 where g is right) and of the same less s^2 d.H.d/2 (3 where H is).

    An exactly quadratic energy has a zero second remainder: its order is reported as inf; a linear one's first too.
    """
    direction = np.random.default_rng(seed).standard_normal(x.shape)
    direction /= np.linalg.norm(direction)
    gradient = energy.gradient(x)
    slope = np.vdot(gradient, direction)
    curvature = direction.ravel() @ dense_hessian(energy, x) @ direction.ravel()
    first, second = [], []
    for size in sizes:
        change = energy.value(x + size * direction) - energy.value(x)
        first.append(abs(change - size * slope))
        second.append(abs(change - size * slope - size**2 * curvature / 2))
    floor = 1e-13 * max(abs(energy.value(x)), np.abs(gradient).max() * sizes[0])
    return _order(first, sizes, floor), _order(second, sizes, floor)


def _order(errors, sizes, floor):
    if max(errors) <= floor:
        return np.inf
    return np.log(errors[0] / errors[-1]) / np.log(sizes[0] / sizes[-1])


def _relative(what, analytic, numeric):
    if analytic.size == 0 or not np.abs(analytic).max() > 0:
        raise AssertionError(f"the {what} is empty or zero: the test would be over nothing")
    return np.abs(analytic - numeric).max() / np.abs(analytic).max()
