"""Report of a study for people: study.md."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from clothsim.study.answer import answer, in_mm, in_seconds, settings_text
from clothsim.study.goal_report import PICTURE_NAME, goal_lines
from clothsim.study.points import written
from clothsim.study.worker import SHORT, TIMES


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
        _table(("knob", "at the base", "adds", "expected slope", "observed slope"), _knob_rows(result)),
        f"The remainder, which the knobs add only together: {_remainder(result['remainder'])}.",
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


def _knob_rows(result: Mapping[str, Any]) -> list[list[str]]:
    rows = []
    for name, knob in result["knobs"].items():
        observed = knob["observed_slope"]
        known = observed is not None and math.isfinite(observed)
        expected = "" if knob["expected_slope"] is None else f"{knob['expected_slope']:.2g}"
        slope = (f"{observed:.2f}" if known else "") + ("" if knob["extrapolated"] or not known else " (not used)")
        adds = "not known" if knob["adds"] is None else in_mm(knob["adds"])
        rows.append([name, written(name, knob["base"]).removeprefix(f"{name} "), adds, expected, slope])
    return rows


def _point_rows(result: Mapping[str, Any]) -> list[list[str]]:
    front = {each["label"] for each in result["front"]}
    return [
        [
            settings_text(each["settings"]) + ("" if each["resolved"] or each["error"] is None else " *"),
            *(_errors(each)),
            in_seconds(each["seconds"]),
            "yes" if each["label"] in front else "",
        ]
        for each in sorted(result["points"], key=lambda each: each["seconds"])
    ]


def _errors(point: Mapping[str, Any]) -> list[str]:
    if point["error"] is None:
        return ["", "", ""]
    return [in_mm(point["error"]), in_mm(point["max_error"]), f"{100 * point['relative']:.2g} %"]


def _method(result: Mapping[str, Any]) -> list[str]:
    reference = result["reference"]
    own = "not known" if reference is None else in_mm(reference["own_error"])
    names = result["together"]
    joint = f" and runs of {', '.join(names)} together" if names else ""
    warm = max((entry.get("warmup_seconds", 0.0) for entry in result["points"]), default=0.0)
    return [
        f"Error: {result['measure']}; size: the diagonal of the cloth at rest, {result['size']:.3g} m.",
        f"Reference: the one-knob runs{joint}, extrapolated by Richardson at their observed order; its own error is "
        f"{own}. A point marked * is closer to it than ten times that.",
        f"Twins, one with a start jittered by a millionth of the size, end {in_mm(result['twins_differ'])} apart.",
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
