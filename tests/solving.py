"""The package's own Newton on a world and some energies, for tests that need an equilibrium or a step."""

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
