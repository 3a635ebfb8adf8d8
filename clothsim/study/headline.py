"""Statement of a study on the error of its scene, and the conditions under which one is made.

A single number is stated only where dt and cells were both refined and where its uncertainty leaves it within a factor
of two; else a range, or what is missing and the seconds that it would take.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from clothsim.study.analysis import Findings
from clothsim.study.observations import Observations
from clothsim.study.plan import first_refinements, missing_points, unanswered
from clothsim.study.points import BASE

MM = 1e-3
"""Millimetre [m], the unit of reported errors."""
TRUSTED = 0.5
"""Largest uncertainty of an error, relative to it: an error is then known to a factor of two."""
KNOWN, RANGE, PARTIAL, UNFINISHED = "known", "range", "partial", "unfinished"


@dataclass(frozen=True)
class Headline:
    """What is known of a scene's error; lengths in millimetres.

    Parameters
    ----------
    status : str
        "known": `error` is within a factor of two; "range": from `low` to `high`; "partial": the same of what can be
        refined, as `missing` cannot; "unfinished": runs are missing, of which `missing` names the parameters.
    error, low, high : float or None
        The error and its range.
    missing : tuple of str
        What was not run: finer runs of parameters, or "base", "integrator", "twins", "seeds".
    needed_seconds : float or None
        Budget with which the study can go on to a statement; at least so much.
    so_far : dict
        What each refined parameter adds by itself {parameter: mm}.
    certificate : float or None
        Error of the time steps and of Newton's end by the certificate of the run as it is.
    """

    status: str
    error: float | None = None
    low: float | None = None
    high: float | None = None
    missing: tuple[str, ...] = ()
    needed_seconds: float | None = None
    so_far: Mapping[str, float] = field(default_factory=dict)
    certificate: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """The entry of study.json."""
        return {"known": self.status == KNOWN, **asdict(self), "missing": list(self.missing)}


def needed_seconds(seen: Observations, reserve: tuple[float, float]) -> float | None:
    """Budget for the missing runs [s]: warm-up, runs, and the reserve (fraction of the budget, most seconds).

    Where none is missing, for the next finer run of what is least certain; None where that is known too, and where a
    run failed without which nothing can be stated.
    """
    if any(
        where in seen.gatherer.outcomes and not seen.gatherer.good(where)
        for where in first_refinements(seen.gatherer.bench)
    ):
        return None
    missing = missing_points(seen) or [
        where for where in seen.compared().least_certain() if where not in seen.gatherer.outcomes
    ]
    if not missing:
        return None
    outcomes = seen.gatherer.outcomes.values()
    warm = max((each.counts.get("warmup_seconds", 0.0) for each in outcomes), default=0.0)
    seconds = warm * seen.gatherer.slowness + seen.gatherer.missing_seconds(missing)
    return float(min(seconds / (1 - reserve[0]), seconds + reserve[1]))


def headline(seen: Observations, findings: Findings | None, seconds: float | None) -> Headline:
    """The statement. findings: None where runs are missing; seconds: `needed_seconds`."""
    gatherer = seen.gatherer
    if not gatherer.good(BASE):
        return Headline(UNFINISHED, missing=("base",), needed_seconds=seconds)
    certificate = gatherer.outcomes[BASE].estimate / MM
    limits = seen.compared().limits() if findings is None else findings.reference.limits
    start, norm = seen.fields()[BASE], seen.norm
    so_far = {name: norm(start - each.field) / MM for name, each in limits.items()}
    missing = unanswered(seen)
    if findings is None or missing:
        return Headline(UNFINISHED, None, None, None, tuple(missing), seconds, so_far, certificate)
    error, doubt = findings.errors[BASE] / MM, findings.reference.error / MM
    bounds = max(0.0, error - doubt), error + doubt
    absent = tuple(name for name in ("dt", "cells") if name not in limits)
    if absent:
        return Headline(PARTIAL, None, *bounds, absent, None, so_far, certificate)
    if doubt <= TRUSTED * error:
        return Headline(KNOWN, error, *bounds, (), None, so_far, certificate)
    return Headline(RANGE, None, *bounds, (), seconds, so_far, certificate)
