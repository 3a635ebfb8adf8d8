"""All hard cases, in the order of VALIDATION part B."""

from clothsim.study.stability import bad_meshes, twist, units
from clothsim.study.stability.case import Case


def _order(case: Case) -> tuple[int, str]:
    """B2 before B10, B7a before B7b."""
    return int("".join(filter(str.isdigit, case.name))), case.name


FAMILIES = (bad_meshes, twist, units)

CASES: tuple[Case, ...] = tuple(sorted((case for family in FAMILIES for case in family.CASES), key=_order))
