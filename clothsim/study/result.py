"""Result of a study, the content of study.json: what is known of the error of its scene, and every run.

A single number is stated only where dt and cells were both refined and where its uncertainty leaves it within a factor
of two; else a range, or what is missing and the seconds that it would take.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import datetime
from functools import cached_property
from typing import Any

import numpy as np

from clothsim.study.analysis import Compared, Findings, Recommendation, half, recommendations
from clothsim.study.evaluation import Gatherer
from clothsim.study.observations import Observations, first_refinements, missing_points, unanswered
from clothsim.study.points import BASE, CONVERGENT, Bench, Point
from clothsim.study.reference_solution import Limit

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

    Where none is missing, for the next finer run of what is least certain; None where that is known too, where a run
    failed without which nothing can be stated, and before the scene itself came to its end: what was spent until then
    is mostly the start of the processes.
    """
    if not seen.gatherer.good(BASE) or any(
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
    seconds = warm + seen.gatherer.missing_seconds(missing)
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


@dataclass(frozen=True)
class StudyData:
    """Data of a study to report: name of the scene, runs and how they are compared, reasons for missing parameters."""

    name: str
    bench: Bench
    gatherer: Gatherer
    seen: Observations
    missing: Mapping[str, str]

    @cached_property
    def compared(self) -> Compared | None:
        """The data to analyse; None without the base."""
        return self.seen.compared() if self.gatherer.good(BASE) else None

    @property
    def chaotic(self) -> bool:
        """True where histograms of heights are compared."""
        return bool(self.seen.chaotic)

    @property
    def complete(self) -> bool:
        """True where there is a reference: dt and cells were refined, or what the study has of them."""
        needed = first_refinements(self.bench)
        refined = self.compared is not None and bool(self.compared.sweeps())
        return refined and all(self.gatherer.good(each) for each in needed)

    @property
    def size(self) -> float:
        """Diagonal of the cloths at rest [m]."""
        return float(np.linalg.norm(np.ptp(np.concatenate(self.gatherer.material.rest), axis=0)))


def document(
    study_data: StudyData, findings: Findings | None, headline: Headline, spent: Mapping[str, float]
) -> dict[str, Any]:
    """The content of study.json; errors in millimetres. Without findings no run has an error."""
    gatherer, chaotic = study_data.gatherer, study_data.chaotic
    points, others = _points(study_data, findings)
    bending_model: dict[str, Any] | None = None
    done = gatherer.outcomes.get(Point(variant=CONVERGENT))
    if done is not None and not done.failed and not chaotic and study_data.compared is not None:
        moved = study_data.compared.norm(done.positions - study_data.compared.fields[BASE])
        bending_model = {"model": CONVERGENT, "moves": moved / MM, "unit": "mm", "seconds": done.seconds}
    return {
        "headline": headline.as_dict(),
        "points": points,
        **_answers(study_data, findings, headline),
        "unit": "mm",
        "measure": measure(chaotic),
        "size": study_data.size,
        "parameters": {name: _parameter(study_data, findings, name) for name in study_data.bench.parameters},
        "bending_model": bending_model,
        "missing_parameters": dict(study_data.missing),
        "left_out": {where.label(): reason for where, reason in gatherer.left_out.items()},
        "chaotic": study_data.seen.chaotic,
        "twins_differ": study_data.seen.twins / MM,
        "invariants": study_data.seen.invariants() if chaotic else {},
        "reused": gatherer.reused,
        "others": others,
        "date": datetime.now().astimezone().isoformat(timespec="minutes"),
        **spent,
    }


def _points(study_data: StudyData, findings: Findings | None) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The runs that are compared and the failed ones, and the others."""
    bench = study_data.bench
    fields = {} if study_data.compared is None else study_data.compared.fields
    keys = {bench.key(where): where for where in fields}
    points, others = [], []
    for entry in study_data.gatherer.stored.values():
        if entry.get("failed"):
            points.append(entry)  # listed apart when it is written
        elif entry["key"] in keys:
            where = keys[entry["key"]]
            own: dict[str, Any] = {"error": None, "max_error": None, "relative": None, "unit": "mm", "resolved": False}
            if findings is not None:
                error, largest = findings.errors[where], findings.largest[where]
                own = {"error": error / MM, "max_error": largest / MM, "relative": error / study_data.size}
                own |= {"unit": "mm", "seconds": findings.seconds[where], "resolved": findings.resolved(where)}
            points.append({**entry, "settings": bench.settings(where), **own})
        else:
            others.append(entry)
    return points, others


def _answers(study_data: StudyData, findings: Findings | None, headline: Headline) -> dict[str, Any]:
    """Front, recommendations, base and reference."""
    gatherer, compared = study_data.gatherer, study_data.compared
    seconds = gatherer.outcomes[BASE].seconds if compared is not None else None
    base = {"label": BASE.label(), "settings": study_data.bench.settings(BASE), "error": headline.error, "unit": "mm"}
    if findings is None or compared is None:
        empty = {"half_the_error": None, "reference": None, "remainder": None, "together": None}
        return {"front": [], "recommended": [], "base": {**base, "seconds": seconds}, **empty}
    better = half(findings, compared)
    return {
        "front": [_row(study_data, where, findings.errors[where], findings.seconds[where]) for where in findings.front],
        "recommended": [_advice(study_data, each) for each in recommendations(findings, MM)],
        "half_the_error": None if better is None else _advice(study_data, better),
        "base": {**base, "seconds": findings.seconds[BASE]},
        "reference": {
            "own_error": findings.reference.error / MM,
            "valid": findings.valid,
            "smallest_error": min(findings.errors.values()) / MM,
            "cross": findings.reference.interaction / MM,
            "distance_of_base": findings.errors[BASE] / MM,
        },
        "remainder": findings.remainder / MM,
        "together": list(findings.reference.names) if findings.reference.combined else None,
    }


def measure(chaotic: bool) -> str:
    """Definition of the error measure."""
    if chaotic:
        return "RMS difference of the histograms of heights at the last frame (2-Wasserstein), mean over seeds"
    return "RMS distance of the same material points at the last frame to the reference"


def _row(study_data: StudyData, where: Point, error: float, seconds: float) -> dict[str, Any]:
    settings = study_data.bench.settings(where)
    return {"label": where.label(), "settings": settings, "error": error / MM, "unit": "mm", "seconds": seconds}


def _advice(study_data: StudyData, each: Recommendation) -> dict[str, Any]:
    row = _row(study_data, each.point, each.error, each.seconds)
    return {**row, "error": each.target / MM, "measured_error": each.error / MM if each.measured else None,
            "predicted_error": None if each.measured else each.error / MM}  # fmt: skip


def _parameter(study_data: StudyData, findings: Findings | None, name: str) -> dict[str, Any]:
    compared, parameter = study_data.compared, study_data.bench.parameters[name]
    limits: Mapping[str, Limit] = {}
    if compared is not None:
        limits = compared.limits() if findings is None else findings.reference.limits
    each = limits.get(name)
    base = study_data.bench.base
    settings = {"base": parameter.value(base, 0), "expected_slope": parameter.order(base)}
    if compared is None or each is None:
        unknown = dict.fromkeys(("observed_slope", "adds", "own_uncertainty"))
        return {**settings, **unknown, "extrapolated": False}
    return {
        **settings,
        "observed_slope": each.order,
        "extrapolated": each.extrapolated,
        "adds": compared.norm(compared.fields[BASE] - each.field) / MM,
        "own_uncertainty": each.error / MM,
    }
