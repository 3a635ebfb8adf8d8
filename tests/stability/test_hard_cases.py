"""The small form of every hard case, from its exact start and from one jittered one."""

import pytest

from clothsim.study.stability.case import run_case
from clothsim.study.stability.cases import CASES


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_it_stays_stable(case, seed):
    if seed and not case.jitters:
        pytest.skip("the case has no jitter: its start is exact by meaning")
    assert run_case(case, seed).wrong == ""
