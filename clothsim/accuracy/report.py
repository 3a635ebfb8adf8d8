"""Reports of a study: study.json and study.md."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from clothsim.accuracy.analysis import Findings, Recommendation, findings, half, recommendations
from clothsim.accuracy.evaluation import Gatherer
from clothsim.accuracy.points import BASE, CONVERGENT, Bench, Point, written
from clothsim.accuracy.reference_solution import Norm
from clothsim.accuracy.worker import SHORT, TIMES
from clothsim.arrays import Floats

MM = 1e-3
"""Millimetre [m], the unit of reported errors."""


@dataclass(frozen=True)
class StudyData:
    """Data of a study to report: name of the scene, runs, compared fields, reasons for missing knobs.

    twins: how far apart runs end that start a hair apart [m]; noise: the same in what is compared [m].
    """

    name: str
    bench: Bench
    gatherer: Gatherer
    fields: Mapping[Point, Floats]
    norm: Norm
    twins: float
    noise: float
    chaotic: bool
    missing: Mapping[str, str]

    def seconds(self) -> dict[Point, float]:
        """Seconds of each point of `fields`; the median of its seeds."""
        done = self.gatherer.field_seconds()
        alike = {
            where: [s for p, s in done.items() if (p.levels, p.variant) == (where.levels, where.variant)]
            for where in self.fields
        }
        return {where: float(np.median(each)) if self.chaotic else done[where] for where, each in alike.items()}

    def findings(self) -> Findings:
        """Analysis of the runs."""
        return findings(self.fields, self.seconds(), self.bench.knobs, self.bench.base, self.norm, self.noise)

    @property
    def size(self) -> float:
        """Diagonal of the cloths at rest [m]."""
        return float(np.linalg.norm(np.ptp(np.concatenate(self.gatherer.material.rest), axis=0)))


def document(
    study_data: StudyData, findings: Findings, spent: Mapping[str, float], invariants: Mapping[str, Any]
) -> dict[str, Any]:
    """The content of study.json; errors in millimetres."""
    gatherer, bench = study_data.gatherer, study_data.bench
    keys = {bench.key(where): where for where in study_data.fields}
    points, others = [], []
    for entry in gatherer.stored.values():
        if entry.get("failed"):
            points.append(entry)  # listed apart when it is written
        elif entry["key"] in keys:
            where = keys[entry["key"]]
            points.append({**entry, "settings": bench.settings(where), **_errors(study_data, findings, where)})
        else:
            others.append(entry)
    better = half(findings, study_data.fields, bench.knobs, study_data.norm)
    return {
        "points": points,
        "front": [_row(study_data, where, findings.errors[where], findings.seconds[where]) for where in findings.front],
        "recommended": [_advice(study_data, each) for each in recommendations(findings, MM)],
        "half_the_error": None if better is None else _advice(study_data, better),
        "base": _row(study_data, BASE, findings.errors[BASE], findings.seconds[BASE]),
        "unit": "mm",
        "measure": measure(study_data.chaotic),
        "size": study_data.size,
        "reference": {
            "own_error": findings.reference.error / MM,
            "valid": findings.valid,
            "smallest_error": min(findings.errors.values()) / MM,
            "cross": findings.reference.cross / MM,
        },
        "knobs": {name: _knob(study_data, findings, name) for name in bench.knobs},
        "remainder": findings.remainder / MM,
        "bending_model": _model(study_data),
        "missing_knobs": dict(study_data.missing),
        "left_out": {where.label(): reason for where, reason in gatherer.left_out.items()},
        "chaotic": study_data.chaotic,
        "twins_differ": study_data.twins / MM,
        "invariants": dict(invariants),
        "reused": gatherer.reused,
        "others": others,
        "date": datetime.now().astimezone().isoformat(timespec="minutes"),
        **spent,
    }


def _model(study_data: StudyData) -> dict[str, Any] | None:
    """Difference and cost of the convergent bending model; None where that was not run."""
    done = study_data.gatherer.outcomes.get(Point(variant=CONVERGENT))
    if done is None or done.failed or study_data.chaotic:
        return None
    moved = study_data.norm(done.positions - study_data.fields[BASE])
    return {"model": CONVERGENT, "moves": moved / MM, "unit": "mm", "seconds": done.seconds}


def measure(chaotic: bool) -> str:
    """Definition of the error measure."""
    if chaotic:
        return "RMS difference of the histograms of heights at the last frame (2-Wasserstein), mean over seeds"
    return "RMS distance of the same material points at the last frame to the reference"


def _errors(study_data: StudyData, findings: Findings, where: Point) -> dict[str, Any]:
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


def _knob(study_data: StudyData, findings: Findings, name: str) -> dict[str, Any]:
    each = findings.reference.limits.get(name)
    expected = study_data.bench.knobs[name].order(study_data.bench.base)
    return {
        "base": study_data.bench.knobs[name].value(study_data.bench.base, 0),
        "expected_slope": expected,
        "observed_slope": None if each is None else each.order,
        "extrapolated": each is not None and each.extrapolated,
        "adds": None if each is None else findings.bars[name] / MM,
        "own_uncertainty": None if each is None else each.error / MM,
    }


def markdown(study_data: StudyData, findings: Findings, result: Mapping[str, Any]) -> str:
    """The report for people: the answer first."""
    parts = [
        f"# What accuracy costs: {study_data.name}",
        "\n".join(answer(result)),
        "![Error against processor seconds](study.png)",
        "## What to take",
        _table(("error at most", "settings", "measured error", "processor time"), _advice_rows(result)),
        "## Where the error comes from",
        _table(("knob", "at the base", "adds", "expected slope", "observed slope"), _knob_rows(result)),
        f"The remainder, which the knobs add only together: {_remainder(result['remainder'])}.",
        "## Every point",
        _table(("settings", "error (RMS)", "largest", "of the size", "processor time", "front"), _point_rows(result)),
        "## How this was measured",
        "\n".join(f"* {line}" for line in _method(result)),
    ]
    if result["left_out"] or result["failed"]:
        lines = [f"* {name}: {reason}." for name, reason in result["left_out"].items()]
        lines += [f"* {entry['label']} is no data point: {entry['failed']}" for entry in result["failed"]]
        parts += ["## Left out", "\n".join(lines)]
    return "\n\n".join(parts) + "\n"


def answer(result: Mapping[str, Any]) -> list[str]:
    """The error of the scene as it is, and the cost of half of it, as sentences."""
    base, reference, better = result["base"], result["reference"], result["half_the_error"]
    fraction = f"{100 * base['error'] * MM / result['size']:.2g} % of its size"
    lines = [f"As it is, this scene is {_mm(base['error'])} wrong ({fraction}) and takes {_s(base['seconds'])}."]
    if better is None:
        lines.append("What half of that error would cost is not known: the runs inside the budget do not resolve it.")
    else:
        times = better["seconds"] / max(base["seconds"], 1e-9)
        source = "" if better["measured_error"] is not None else ", predicted, not run"
        lines.append(
            f"Half of that error: {settings_text(better['settings'])}, {_s(better['seconds'])} ({times:.2g} times"
            f"{source})."
        )
    largest = [name for name in result["knobs"] if result["knobs"][name]["adds"] is not None]
    if largest:
        worst = max(largest, key=lambda name: result["knobs"][name]["adds"])
        lines.append(f"Most of it comes from {worst}: {_mm(result['knobs'][worst]['adds'])}.")
    unknown = [name for name in result["knobs"] if result["knobs"][name]["adds"] is None]
    if unknown:
        lines.append(f"What {' and '.join(unknown)} add is not in that: no finer run of them fitted into the budget.")
    model = result["bending_model"]
    if model is not None:
        lines.append(
            f"What its bending model adds is not in that: {model['model']}, which tends to the fabric's own stiffness, "
            f"moves the result by {_mm(model['moves'])} and takes {_s(model['seconds'])}."
        )
    if result["chaotic"]:
        lines.append(
            f"The folds of this scene are chaotic: twins that differ by a millionth of the size at the start end "
            f"{_mm(result['twins_differ'])} apart. So histograms of heights are compared, over seeds, not places."
        )
    if not reference["valid"]:
        lines.append(
            f"The reference itself is uncertain by {_mm(reference['own_error'])}, more than a tenth of the smallest "
            f"error ({_mm(reference['smallest_error'])}): errors below {_mm(10 * reference['own_error'])} are known "
            "only to that."
        )
    return lines


def settings_text(settings: Mapping[str, Any]) -> str:
    """Settings as text, "dt 1/60 s, cells 40x40"."""
    return ", ".join(written(name, value) for name, value in settings.items())


def _remainder(millimetres: float | None) -> str:
    known = millimetres is not None and math.isfinite(millimetres)
    return _mm(millimetres) if known and millimetres is not None else "not measured, for want of a run with two of them"


def _advice_rows(result: Mapping[str, Any]) -> list[list[str]]:
    return [
        [f"<= {each['error']:g} mm", settings_text(each["settings"]), _mm(each["measured_error"]), _s(each["seconds"])]
        for each in result["recommended"]
    ]


def _knob_rows(result: Mapping[str, Any]) -> list[list[str]]:
    rows = []
    for name, knob in result["knobs"].items():
        observed = knob["observed_slope"]
        known = observed is not None and math.isfinite(observed)
        expected = "" if knob["expected_slope"] is None else f"{knob['expected_slope']:.2g}"
        slope = (f"{observed:.2f}" if known else "") + ("" if knob["extrapolated"] or not known else " (not used)")
        adds = "not known" if knob["adds"] is None else _mm(knob["adds"])
        rows.append([name, written(name, knob["base"]).removeprefix(f"{name} "), adds, expected, slope])
    return rows


def _point_rows(result: Mapping[str, Any]) -> list[list[str]]:
    front = {each["label"] for each in result["front"]}
    return [
        [
            settings_text(each["settings"]) + ("" if each["resolved"] else " *"),
            _mm(each["error"]),
            _mm(each["max_error"]),
            f"{100 * each['relative']:.2g} %",
            _s(each["seconds"]),
            "yes" if each["label"] in front else "",
        ]
        for each in sorted(result["points"], key=lambda each: each["seconds"])
    ]


def _method(result: Mapping[str, Any]) -> list[str]:
    reference = result["reference"]
    own = _mm(reference["own_error"])
    warm = max((entry.get("warmup_seconds", 0.0) for entry in result["points"]), default=0.0)
    return [
        f"Error: {result['measure']}; size: the diagonal of the cloth at rest, {result['size']:.3g} m.",
        f"Reference: the one-knob runs extrapolated by Richardson at their observed order; its own error is {own}. "
        "A point marked * is closer to it than ten times that.",
        f"Twins, one with a start jittered by a millionth of the size, end {_mm(result['twins_differ'])} apart.",
        f"Time: seconds of the processor, one thread, warm-up (up to {warm:.1f} s of loading and compiling) apart; "
        f"{result['workers']:g} processes at a time; runs below {SHORT:g} s: the median of {TIMES}.",
        f"{result['date']}: {result['seconds']:.0f} s of a budget of {result['budget']:.0f} s, "
        f"{result['reused']} runs taken from an earlier study.",
        *(f"{text}." for text in _invariants(result["invariants"])),
        *(f"No knob {name}: {reason}." for name, reason in result["missing_knobs"].items()),
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


def _mm(millimetres: float) -> str:
    return f"{millimetres:.2g} mm" if millimetres < 99.5 else f"{millimetres:.0f} mm"


def _s(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds < 99.5 else f"{seconds:.0f} s"
