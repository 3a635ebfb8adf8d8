"""All hard cases, in the order of VALIDATION part B."""

from clothsim.study.stability import bad_meshes, columns, distorted, slivers, twist
from clothsim.study.stability.case import Case


def place(case: Case) -> tuple[int, str]:
    """Its row, then its letter."""
    return int("".join(filter(str.isdigit, case.name))), case.name


CASES: tuple[Case, ...] = tuple(
    sorted((*bad_meshes.CASES, *columns.CASES, *distorted.CASES, *slivers.CASES, *twist.CASES), key=place)
)
