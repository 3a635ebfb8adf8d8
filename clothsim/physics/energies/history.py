"""Past values of strains and angles in the difference formula of a step."""

from collections.abc import Callable

from clothsim.base.arrays import Floats
from clothsim.physics.energies.step import Step


def past_of(step: Step, quantity: Callable[[Floats], Floats]) -> Floats:
    """The past value q^ with which (q(x) - q^) / past.dt is the rate of q at the end of the step.

    docs/theory.md#time-integration.

    Backward Euler: q(x_n). BDF2: ((1+r)^2 q(x_n) - r^2 q(x_(n-1))) / (1+2r), with the weights that `step.past` has for
    the positions. q of the weighed positions would be wrong: they are no state of the cloth, and a rotating cloth would
    seem to stretch.
    """
    past = step.past
    ratio = past.dt / step.dt  # b = (1+r) / (1+2r)
    if ratio == 1.0:
        return quantity(step.positions)
    r = (1 - ratio) / (2 * ratio - 1)
    new, old = (1 + r) ** 2 / (1 + 2 * r), r**2 / (1 + 2 * r)
    before = (new * step.positions - past.positions) / old
    return new * quantity(step.positions) - old * quantity(before)
