"""The small form of every hard case, from a jittered start where it has one.

The exact starts are those of `python -m tests.hard_cases --small`, which a change must pass too; the slow cases are
left to it.
"""

from dataclasses import replace

import pytest

from tests.hard_cases.case import run_case
from tests.hard_cases.cases import CASES

KNOWN: dict[tuple[str, int], str] = {}
"""What fails, and why: (case, seed). An entry that passes is an error, so that none stays longer than its fault."""


QUICK = [case for case in CASES if not case.slow]


@pytest.mark.parametrize("case", QUICK, ids=[case.name for case in QUICK])
def test_it_stays_stable(case, request):
    seed = int(case.jitters)
    if (case.name, seed) in KNOWN:
        request.applymarker(pytest.mark.xfail(strict=True, reason=KNOWN[case.name, seed]))
    assert run_case(case, seed).wrong == ""


def test_newton_gets_through_a_curved_valley():
    """B17b from this start, with a membrane that softens in compression.

    267 iterations; 549 with the trust radius held at 3.
    """
    case = next(case for case in CASES if case.name == "B17b")
    usual = case.scene(True)
    effects = usual.effects | {"membrane": {"material": "neo_hookean"}}
    solver = {**usual.solver, "integrator": "backward_euler", "tolerance": 1e-3}
    result = run_case(replace(case, scene=lambda small: replace(usual, effects=effects, solver=solver)), 12)
    assert result.wrong == ""
    assert result.newton_iterations < 400
