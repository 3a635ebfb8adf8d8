"""Data of a study and the content of study.json."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Any

import numpy as np

from clothsim.study.analysis import Compared, Findings, Recommendation, half, recommendations
from clothsim.study.evaluation import Gatherer
from clothsim.study.headline import MM, Headline
from clothsim.study.observations import Observations
from clothsim.study.plan import first_refinements
from clothsim.study.points import BASE, CONVERGENT, Bench, Point
from clothsim.study.reference_solution import Limit


@dataclass(frozen=True)
class StudyData:
    """Data of a study to report: name of the scene, runs and how they are compared, reasons for missing knobs."""

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
    return {
        "headline": headline.as_dict(),
        "points": points,
        **_answers(study_data, findings, headline),
        "unit": "mm",
        "measure": measure(chaotic),
        "size": study_data.size,
        "knobs": {name: _knob(study_data, findings, name) for name in study_data.bench.knobs},
        "bending_model": _model(study_data),
        "missing_knobs": dict(study_data.missing),
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
            points.append({**entry, "settings": bench.settings(where), **_errors(study_data, findings, where)})
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
            "cross": findings.reference.cross / MM,
            "distance_of_base": findings.errors[BASE] / MM,
        },
        "remainder": findings.remainder / MM,
        "together": list(findings.reference.names) if findings.reference.joint else None,
    }


def _model(study_data: StudyData) -> dict[str, Any] | None:
    """Difference and cost of the convergent bending model; None where that was not run."""
    done = study_data.gatherer.outcomes.get(Point(variant=CONVERGENT))
    if done is None or done.failed or study_data.chaotic or study_data.compared is None:
        return None
    moved = study_data.compared.norm(done.positions - study_data.compared.fields[BASE])
    return {"model": CONVERGENT, "moves": moved / MM, "unit": "mm", "seconds": done.seconds}


def measure(chaotic: bool) -> str:
    """Definition of the error measure."""
    if chaotic:
        return "RMS difference of the histograms of heights at the last frame (2-Wasserstein), mean over seeds"
    return "RMS distance of the same material points at the last frame to the reference"


def _errors(study_data: StudyData, findings: Findings | None, where: Point) -> dict[str, Any]:
    if findings is None:
        return {"error": None, "max_error": None, "relative": None, "unit": "mm", "resolved": False}
    error = findings.errors[where]
    numbers = {"error": error / MM, "max_error": findings.largest[where] / MM, "relative": error / study_data.size}
    return {**numbers, "unit": "mm", "seconds": findings.seconds[where], "resolved": findings.resolved(where)}


def _row(study_data: StudyData, where: Point, error: float, seconds: float) -> dict[str, Any]:
    settings = study_data.bench.settings(where)
    return {"label": where.label(), "settings": settings, "error": error / MM, "unit": "mm", "seconds": seconds}


def _advice(study_data: StudyData, each: Recommendation) -> dict[str, Any]:
    row = _row(study_data, each.point, each.error, each.seconds)
    return {**row, "error": each.target / MM, "measured_error": each.error / MM if each.measured else None,
            "predicted_error": None if each.measured else each.error / MM}  # fmt: skip


def _knob(study_data: StudyData, findings: Findings | None, name: str) -> dict[str, Any]:
    compared, knob = study_data.compared, study_data.bench.knobs[name]
    limits: Mapping[str, Limit] = {}
    if compared is not None:
        limits = compared.limits() if findings is None else findings.reference.limits
    each = limits.get(name)
    settings = {"base": knob.value(study_data.bench.base, 0), "expected_slope": knob.order(study_data.bench.base)}
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
