"""Newton solves and steps of a world with given energies."""

from tests.known_answers.unit_solver import (
    NOTHING,
    equilibrium,
    held,
    integrator_of,
    newton_of,
    pattern_of,
    run_of,
    solve,
    step_at,
    those_on,
)

__all__ = [
    "NOTHING",
    "equilibrium",
    "held",
    "integrator_of",
    "newton_of",
    "pattern_of",
    "run_of",
    "solve",
    "step_at",
    "those_on",
]
