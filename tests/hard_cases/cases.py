"""All hard cases, in the order of docs/results/hard_cases.md."""

from tests.hard_cases import (
    bad_meshes,
    between,
    columns,
    degenerate,
    distorted,
    edges,
    funnel,
    impact,
    infeasible,
    knots,
    long_steps,
    pinch,
    ratios,
    resting,
    rigid,
    rods,
    rubbing,
    slivers,
    stack,
    sticking,
    touching,
    tubes,
    twist,
    units,
)
from tests.hard_cases.case import Case

FAMILIES = (
    bad_meshes,
    between,
    columns,
    degenerate,
    distorted,
    edges,
    funnel,
    impact,
    infeasible,
    knots,
    long_steps,
    pinch,
    ratios,
    resting,
    rigid,
    rods,
    rubbing,
    slivers,
    stack,
    sticking,
    touching,
    tubes,
    twist,
    units,
)


def place(case: Case) -> tuple[int, str]:
    """Its row, then its letter."""
    return int("".join(filter(str.isdigit, case.name))), case.name


CASES: tuple[Case, ...] = tuple(sorted((case for family in FAMILIES for case in family.CASES), key=place))
