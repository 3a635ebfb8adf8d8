"""All hard cases, in the order of VALIDATION part B."""

from clothsim.study.stability import twist
from clothsim.study.stability.case import Case

CASES: tuple[Case, ...] = tuple(
    sorted((*twist.CASES,), key=lambda case: (int("".join(filter(str.isdigit, case.name))), case.name))
)
