"""Report of a study for people: the error in sentences, what is missing, what half of it would cost, and study.md."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from clothsim.study.goal_report import PICTURE_NAME, goal_lines
from clothsim.study.parameters import written
from clothsim.study.result import KNOWN, MM, PARTIAL, RANGE, UNFINISHED
from clothsim.study.workers import SHORT, TIMES

SAME = 0.5
"""Interaction term over the error, from which the report says that the parameters do not add up."""


def answer_lines(result: Mapping[str, Any]) -> list[str]:
    """What is known of the error of the scene as it is, and the cost of half of it, as sentences."""
    headline = result["headline"]
    if headline["status"] == UNFINISHED:
        parts = [f"{name} adds {in_mm(adds)}" for name, adds in headline["so_far"].items()]
        if headline["certificate"] is not None:
            parts.append(f"the certificate of the run estimates {in_mm(headline['certificate'])} for its time steps")
        so_far = [f"So far: {', '.join(parts)}."] if parts else []
        return [_missing(result), *_more(result), *so_far, *_chaos(result), *_searched(result)]
    better = result["half_the_error"]
    half = "The cost of half that error is not known: the runs within the budget do not resolve it."
    if better is not None:
        times = better["seconds"] / max(result["base"]["seconds"], 1e-9)
        source = "" if better["measured_error"] is not None else ", predicted, not run"
        cost = f"{in_seconds(better['seconds'])} ({times:.2g} times{source})"
        half = f"Half of that error: {settings_text(better['settings'])}, {cost}."
    lines = [_statement(result), half, *_sources(result), *_chaos(result), *_searched(result)]
    if headline["status"] == RANGE:
        lines += _more(result)
    reference = result["reference"]
    if not reference["valid"]:
        own, smallest = reference["own_error"], reference["smallest_error"]
        lines.append(
            f"The reference itself is uncertain by {in_mm(own)}, more than a tenth of the smallest error "
            f"({in_mm(smallest)}): smaller errors than {in_mm(10 * own)} are known to {in_mm(own)} only."
        )
    return lines


def _statement(result: Mapping[str, Any]) -> str:
    headline, seconds = result["headline"], in_seconds(result["base"]["seconds"])
    between = f"between {in_mm(headline['low'])} and {in_mm(headline['high'])}"
    if not headline["low"]:
        between = f"at most {in_mm(headline['high'])}"
    if headline["status"] == KNOWN:
        fraction = f"{100 * headline['error'] * MM / result['size']:.2g} % of its size"
        return (
            f"The error of this scene is {in_mm(headline['error'])} ({fraction}; {between}). The scene takes {seconds}."
        )
    if headline["status"] == PARTIAL:
        missing = " and ".join(headline["missing"])
        reasons = "; ".join(result["missing_parameters"].get(name, "not asked for") for name in headline["missing"])
        return (
            f"The error of this scene is not known: {missing} cannot be refined ({reasons}). Without the part of "
            f"{missing} it is {between}. The scene takes {seconds}."
        )
    return (
        f"The error of this scene is not known to a factor of two. It is {between}; the certificate of the run "
        f"estimates {in_mm(headline['certificate'])} for its time steps. The scene takes {seconds}."
    )


def _missing(result: Mapping[str, Any]) -> str:
    """What is missing, and the seconds that it needs."""
    headline = result["headline"]
    words = {
        "base": "the scene itself did not come to its end",
        "integrator": "the other difference formula did not bound the error of the time steps",
        "twins": "whether its folds are chaotic was not tested",
        "seeds": "its folds are chaotic, and there are too few runs with other starts to compare",
    }
    failed = [name for name in headline["missing"] if f"{name} +1" in {entry["label"] for entry in result["failed"]}]
    parameters = [name for name in headline["missing"] if name not in (*words, *failed)]
    was = "was" if len(parameters) == 1 else "were"
    missing = [f"{' and '.join(parameters)} {was} not refined"] if parameters else []
    missing += [f"the finer run of {name} is not a data point" for name in failed]
    missing += [words[name] for name in headline["missing"] if name in words]
    why = "before the study was stopped" if result["stopped"] else f"within {_budget(result['budget'])}"
    return f"The error of this scene could not be found {why}: {'; '.join(missing)}."


def _searched(result: Mapping[str, Any]) -> list[str]:
    """What the search of solver.error stated, whose settings are the scene of the study."""
    searched = result.get("searched")
    if searched is None:
        return []
    estimate = in_mm(searched["total"] / MM) if searched["known"] else "an unknown error"
    asked, seconds = in_mm(searched["asked"] / MM), in_seconds(searched["seconds"])
    return [f"Its settings are those that solver.error chose for {asked}, with {estimate} estimated, in {seconds}."]


def _more(result: Mapping[str, Any]) -> list[str]:
    headline = result["headline"]
    if headline["missing"] == ["base"]:
        seconds = _budget(2 * result["budget"])
        return [f"How much is needed is not known: try {seconds}, --budget {seconds.replace(' ', '')}."]
    if headline["needed_seconds"] is None:
        return []
    seconds = _budget(headline["needed_seconds"])
    return [f"At least {seconds} more are needed: --budget {seconds.replace(' ', '')} continues from the runs so far."]


def _sources(result: Mapping[str, Any]) -> list[str]:
    """The largest source, what is not in the error, and what the parameters show together."""
    parameters = result["parameters"]
    adds = {name: each["adds"] for name, each in parameters.items() if each["adds"] is not None}
    lines = []
    if adds:
        worst = max(adds, key=lambda name: adds[name])
        lines.append(f"Most of the error comes from {worst}: {in_mm(adds[worst])}.")
    unknown = [name for name in parameters if name not in adds]
    if unknown:
        lines.append(f"The part of {' and '.join(unknown)} is not included: no finer run of them is a data point.")
    names, distance = result["together"], result["reference"]["distance_of_base"]
    if names and result["remainder"] > SAME * distance:
        lines.append(
            f"The errors of {', '.join(names[:-1])} and {names[-1]} do not add up: refined together they show "
            f"{in_mm(distance)}, and what several of them show alone is counted once."
        )
    model = result["bending_model"]
    if model is not None:
        lines.append(
            f"The error of the bending model is not included: {model['model']}, which converges to the fabric's "
            f"stiffness, moves the result by {in_mm(model['moves'])} and takes {in_seconds(model['seconds'])}."
        )
    return lines


def _chaos(result: Mapping[str, Any]) -> list[str]:
    if not result["chaotic"]:
        return []
    return [
        f"The folds of this scene are chaotic: twins that differ by a millionth of the size at the start end "
        f"{in_mm(result['twins_differ'])} apart, so its positions are known to that at best. Histograms of heights are "
        "compared, over seeds."
    ]


def settings_text(settings: Mapping[str, Any]) -> str:
    """Settings as text, "dt 1/60 s, cells 40x40"."""
    return ", ".join(written(name, value) for name, value in settings.items())


def _budget(seconds: float) -> str:
    """Seconds of a budget with two digits, rounded up."""
    unit = 10.0 ** max(0, math.floor(math.log10(max(seconds, 1.0))) - 1)
    return f"{math.ceil(seconds / unit - 1e-9) * unit:.0f} s"


def in_mm(value: float | None) -> str:
    """A length in millimetres with two digits."""
    if value is None or not math.isfinite(value):
        return "an unknown length"
    return f"{value:.2g} mm" if value < 99.5 else f"{value:.0f} mm"


def in_seconds(seconds: float) -> str:
    """Seconds with two digits."""
    return f"{seconds:.2g} s" if seconds < 99.5 else f"{seconds:.0f} s"


def markdown(name: str, result: Mapping[str, Any]) -> str:
    """The report: the answer first."""
    parts = [f"# What accuracy costs: {name}", "\n".join(answer_lines(result))]
    if result["front"]:
        parts += [
            "![Error against processor seconds](study.png)",
            "## What to take",
            _table(
                ("error at most", "settings", "measured error", "processor time"),
                [
                    [
                        f"<= {each['error']:g} mm",
                        settings_text(each["settings"]),
                        in_mm(each["measured_error"]),
                        in_seconds(each["seconds"]),
                    ]
                    for each in result["recommended"]
                ],
            ),
        ]
    rows = []
    for parameter, each in result["parameters"].items():
        observed = each["observed_slope"]
        known = observed is not None and math.isfinite(observed)
        expected = "" if each["expected_slope"] is None else f"{each['expected_slope']:.2g}"
        slope = (f"{observed:.2f}" if known else "") + ("" if each["extrapolated"] or not known else " (not used)")
        adds = "not known" if each["adds"] is None else in_mm(each["adds"])
        value = written(parameter, each["base"]).removeprefix(f"{parameter} ")
        rows.append([parameter, value, adds, expected, slope])
    remainder = "not measured, for want of a run with several of them"
    if result["remainder"] is not None and math.isfinite(result["remainder"]):
        remainder = in_mm(result["remainder"])
    front = {each["label"] for each in result["front"]}
    parts += [
        "## Where the error comes from",
        _table(("parameter", "at the base", "adds", "expected slope", "observed slope"), rows),
        f"The remainder, which the parameters add only together: {remainder}.",
        "## Every point",
        _table(
            ("settings", "error (RMS)", "largest", "of the size", "processor time", "front"),
            [
                [
                    settings_text(each["settings"]) + ("" if each["resolved"] or each["error"] is None else " *"),
                    *(
                        ["", "", ""]
                        if each["error"] is None
                        else [in_mm(each["error"]), in_mm(each["max_error"]), f"{100 * each['relative']:.2g} %"]
                    ),
                    in_seconds(each["seconds"]),
                    "yes" if each["label"] in front else "",
                ]
                for each in sorted(result["points"], key=lambda each: each["seconds"])
            ],
        ),
        "## How this was measured",
        "\n".join(f"* {line}" for line in _method(result)),
    ]
    if "goal" in result:
        goal = result["goal"]
        picture = [] if goal["failed"] else [f"![Error of {goal['name']} on the cloth]({PICTURE_NAME})"]
        parts[-2:-2] = [f"## Which triangles make the error of {goal['name']}", "\n".join(goal_lines(goal)), *picture]
    if result["left_out"] or result["failed"]:
        lines = [f"* {name}: {reason}." for name, reason in result["left_out"].items()]
        lines += [f"* {entry['label']} is not a data point: {entry['failed']}" for entry in result["failed"]]
        parts += ["## Left out", "\n".join(lines)]
    return "\n\n".join(parts) + "\n"


def _method(result: Mapping[str, Any]) -> list[str]:
    reference = result["reference"]
    own = "not known" if reference is None else in_mm(reference["own_error"])
    names = result["together"]
    combined = f" and runs of {', '.join(names)} together" if names else ""
    warm = max((entry.get("warmup_seconds", 0.0) for entry in result["points"]), default=0.0)
    units = {"drape_coefficient": ("Drape coefficient", ""), "energy": ("Energy", " J")}
    return [
        f"Error: {result['measure']}; size: the diagonal of the cloth at rest, {result['size']:.3g} m.",
        f"Reference: the one-parameter runs{combined}, extrapolated by Richardson at their observed order; its own "
        f"error is {own}. A point marked * is closer to it than ten times that.",
        f"Twins, one with a start jittered by a millionth of the size, end {in_mm(result['twins_differ'])} apart.",
        f"Time: seconds of the processor, one thread, warm-up (up to {warm:.1f} s of loading and compiling) apart; "
        f"{result['workers']:g} processes at a time; runs below {SHORT:g} s: the median of {TIMES}.",
        f"{result['date']}: {result['seconds']:.0f} CPU s of a budget of {result['budget']:.0f} s, "
        f"{result['reused']} runs taken from an earlier study.",
        *(
            f"{text}."
            for text in [
                f"{units[name][0]} as given, over {each['seeds']} seeds: {each['mean']:.4g}{units[name][1]}, spread "
                f"{each['spread']:.2g}{units[name][1]}"
                for name, each in result["invariants"].items()
            ]
        ),
        *(f"No parameter {name}: {reason}." for name, reason in result["missing_parameters"].items()),
    ]


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
