"""Data of a study, the content of study.json, and the report for people: study.md."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Any

import numpy as np

from clothsim.study.analysis import Compared, Findings, Recommendation, half, recommendations
from clothsim.study.answer import answer, in_mm, in_seconds, settings_text
from clothsim.study.evaluation import Gatherer
from clothsim.study.goal_report import PICTURE_NAME, goal_lines
from clothsim.study.headline import MM, Headline
from clothsim.study.observations import Observations
from clothsim.study.parameters import written
from clothsim.study.plan import first_refinements
from clothsim.study.points import BASE, CONVERGENT, Bench, Point
from clothsim.study.reference_solution import Limit
from clothsim.study.worker import SHORT, TIMES


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
    return {
        "headline": headline.as_dict(),
        "points": points,
        **_answers(study_data, findings, headline),
        "unit": "mm",
        "measure": measure(chaotic),
        "size": study_data.size,
        "knobs": {name: _parameter(study_data, findings, name) for name in study_data.bench.parameters},
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
            "cross": findings.reference.interaction / MM,
            "distance_of_base": findings.errors[BASE] / MM,
        },
        "remainder": findings.remainder / MM,
        "together": list(findings.reference.names) if findings.reference.combined else None,
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


def markdown(name: str, result: Mapping[str, Any]) -> str:
    """The report: the answer first."""
    parts = [f"# What accuracy costs: {name}", "\n".join(answer(result))]
    if result["front"]:
        parts += [
            "![Error against processor seconds](study.png)",
            "## What to take",
            _table(("error at most", "settings", "measured error", "processor time"), _advice_rows(result)),
        ]
    parts += [
        "## Where the error comes from",
        _table(("parameter", "at the base", "adds", "expected slope", "observed slope"), _parameter_rows(result)),
        f"The remainder, which the parameters add only together: {_remainder(result['remainder'])}.",
        "## Every point",
        _table(("settings", "error (RMS)", "largest", "of the size", "processor time", "front"), _point_rows(result)),
        "## How this was measured",
        "\n".join(f"* {line}" for line in _method(result)),
    ]
    if "goal" in result:
        parts[-2:-2] = _goal(result["goal"])
    if result["left_out"] or result["failed"]:
        lines = [f"* {name}: {reason}." for name, reason in result["left_out"].items()]
        lines += [f"* {entry['label']} is no data point: {entry['failed']}" for entry in result["failed"]]
        parts += ["## Left out", "\n".join(lines)]
    return "\n\n".join(parts) + "\n"


def _goal(goal: dict[str, Any]) -> list[str]:
    picture = [] if goal["failed"] else [f"![Error of {goal['name']} on the cloth]({PICTURE_NAME})"]
    return [f"## Which triangles make the error of {goal['name']}", "\n".join(goal_lines(goal)), *picture]


def _remainder(length: float | None) -> str:
    known = length is not None and math.isfinite(length)
    return in_mm(length) if known else "not measured, for want of a run with several of them"


def _advice_rows(result: Mapping[str, Any]) -> list[list[str]]:
    return [
        [
            f"<= {each['error']:g} mm",
            settings_text(each["settings"]),
            in_mm(each["measured_error"]),
            in_seconds(each["seconds"]),
        ]
        for each in result["recommended"]
    ]


def _parameter_rows(result: Mapping[str, Any]) -> list[list[str]]:
    rows = []
    for name, parameter in result["knobs"].items():
        observed = parameter["observed_slope"]
        known = observed is not None and math.isfinite(observed)
        expected = "" if parameter["expected_slope"] is None else f"{parameter['expected_slope']:.2g}"
        slope = (f"{observed:.2f}" if known else "") + ("" if parameter["extrapolated"] or not known else " (not used)")
        adds = "not known" if parameter["adds"] is None else in_mm(parameter["adds"])
        rows.append([name, written(name, parameter["base"]).removeprefix(f"{name} "), adds, expected, slope])
    return rows


def _point_rows(result: Mapping[str, Any]) -> list[list[str]]:
    front = {each["label"] for each in result["front"]}
    return [
        [
            settings_text(each["settings"]) + ("" if each["resolved"] or each["error"] is None else " *"),
            *(_error_cells(each)),
            in_seconds(each["seconds"]),
            "yes" if each["label"] in front else "",
        ]
        for each in sorted(result["points"], key=lambda each: each["seconds"])
    ]


def _error_cells(point: Mapping[str, Any]) -> list[str]:
    if point["error"] is None:
        return ["", "", ""]
    return [in_mm(point["error"]), in_mm(point["max_error"]), f"{100 * point['relative']:.2g} %"]


def _method(result: Mapping[str, Any]) -> list[str]:
    reference = result["reference"]
    own = "not known" if reference is None else in_mm(reference["own_error"])
    names = result["together"]
    combined = f" and runs of {', '.join(names)} together" if names else ""
    warm = max((entry.get("warmup_seconds", 0.0) for entry in result["points"]), default=0.0)
    return [
        f"Error: {result['measure']}; size: the diagonal of the cloth at rest, {result['size']:.3g} m.",
        f"Reference: the one-parameter runs{combined}, extrapolated by Richardson at their observed order; its own "
        f"error is {own}. A point marked * is closer to it than ten times that.",
        f"Twins, one with a start jittered by a millionth of the size, end {in_mm(result['twins_differ'])} apart.",
        f"Time: seconds of the processor, one thread, warm-up (up to {warm:.1f} s of loading and compiling) apart; "
        f"{result['workers']:g} processes at a time; runs below {SHORT:g} s: the median of {TIMES}.",
        f"{result['date']}: {result['seconds']:.0f} s of a budget of {result['budget']:.0f} s, "
        f"{result['reused']} runs taken from an earlier study.",
        *(f"{text}." for text in _invariants(result["invariants"])),
        *(f"No parameter {name}: {reason}." for name, reason in result["missing_knobs"].items()),
    ]


def _invariants(invariants: Mapping[str, Any]) -> list[str]:
    """Invariants of chaotic folds at the base settings: mean and spread over the seeds."""
    units = {"drape_coefficient": ("Drape coefficient", ""), "energy": ("Energy", " J")}
    return [
        f"{units[name][0]} as given, over {each['seeds']} seeds: {each['mean']:.4g}{units[name][1]}, spread "
        f"{each['spread']:.2g}{units[name][1]}"
        for name, each in invariants.items()
    ]


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
