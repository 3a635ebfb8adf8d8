"""Tables of docs/results/performance.md: time of a step by part, target times, contact against ipctk."""

from collections.abc import Mapping
from pathlib import Path

from tests.benchmarks.bench.bench_cases import WINDOWS
from tests.benchmarks.bench.measure import PHASES, SEARCHES, Measured, each, ratio
from tests.benchmarks.bench.oracle import Compared
from tests.benchmarks.bench.sides import PARTS
from tests.benchmarks.stored_tables import markdown_table, write_between

PROFILED = "sphere 100"
CONTACT = ("body_contact", "self_contact", "friction")
GROUPS = ("linear solve", "contact and friction", "assembly", "cloth", "line search and step control")
REST = "unattributed"
AIMS = {
    "aim draft of 40x40": "below 8",
    "aim draft on 40x40 cells": "below 8",
    "aim standard 40x40": "below 25",
    "aim standard 100x100, impact": "below 100",
}
"""Processor seconds per simulated second to reach (docs/results/performance.md)."""


def grouped(row: Measured) -> Mapping[str, float]:
    """Processor seconds of a case in groups that add up to what its accounts hold."""
    found = dict.fromkeys(GROUPS, 0.0)
    for part, seconds in row["parts"].items():
        found[_group(part)] += seconds
    return found


def _group(part: str) -> str:
    if part in ("linear solve", "assembly"):
        return part
    if part in SEARCHES or part in CONTACT:
        return "contact and friction"
    return "line search and step control" if part in PHASES else "cloth"


def profile(row: Measured) -> str:
    """A line a phase and effect: processor seconds of the measured step, per Newton iteration, and their fraction."""
    parts = sorted(row["parts"].items(), key=lambda part: -part[1])
    parts.append((REST, max(0.0, row["cpu"] - sum(row["parts"].values()))))
    lines = [
        (
            name,
            "" if name == REST else "phase" if name in PHASES else "effect",
            f"{seconds:.2f}",
            f"{1e3 * seconds / row['iterations']:.1f}",
            f"{100 * seconds / row['cpu']:.1f} %",
        )
        for name, seconds in parts
    ]
    whole = f"**{row['cpu']:.2f}**", f"**{1e3 * row['cpu'] / row['iterations']:.1f}**", "**100 %**"
    lines.append(("**all**", "", *whole))
    own, times = row["own_solve"], ratio(row)
    solve_note = (
        ""
        if own is None
        else f" This is {times:.2f} times one factorisation and solve of the same matrix ({1e3 * own:.0f} ms)."
    )
    regional = (
        f" In addition, {row['regional']:.0f} iterations on patches take {row['regional_cpu']:.2f} s; "
        f"without these an iteration takes {1e3 * each(row):.0f} ms."
        if row.get("regional")
        else ""
    )
    step = f"{row['simulated'] / row['steps']:g} s"
    foot = f"A step of {step} takes {row['iterations']:.0f} Newton iterations of the whole cloth.{regional}{solve_note}"
    header = ("part", "kind", "CPU s", "ms per iteration, including patches", "fraction of the time")
    return f"{markdown_table(header, lines)}\n\n{foot}"


def aimed(cases: Mapping[str, Measured]) -> str:
    """A line an aim: processor seconds per simulated second."""
    lines = []
    for name, aim in AIMS.items():
        row = cases[name]
        if "skipped" in row:
            lines.append((name.removeprefix("aim "), "", "", row["skipped"], "", "", aim))
            continue
        steps, simulated = row["steps"], row["simulated"]
        each = f"{row['cpu'] / simulated:.0f}", f"{row['cpu'] / steps:.2f}", f"{row['iterations'] / steps:.1f}"
        lines.append((name.removeprefix("aim "), f"{simulated:g}", f"{simulated / steps:g}", *each, aim))
    header = (
        "settings and cells",
        "simulated s",
        "dt [s]",
        "CPU s per simulated s",
        "CPU s per step",
        "Newton iterations per step",
        "aim [CPU s per simulated s]",
    )
    return markdown_table(header, lines)


AT_LEAST = 10.0
"""Least ratio of processor times, ipctk over this package (docs/results/performance.md)."""


def against(cases: Mapping[str, Compared]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and lines of a table: a line a part, milliseconds an iteration of both sides and how many times ours."""
    header = ["part"]
    for name in cases:
        header += [f"{name}: clothsim [ms]", "ipctk [ms]", "ratio"]
    lines = []
    for part in (*PARTS, None):
        line = [part or "all"]
        for row in cases.values():
            times = (sum(side.values()) if part is None else side[part] for side in (row.ours, row.ipctk))
            line += [*(f"{1e3 * seconds:.2f}" for seconds in times), f"{row.ratio(part):.1f}"]
        lines.append(tuple(line))
    return tuple(header), lines


def oracle_summary(cases: Mapping[str, Compared]) -> str:
    """Summary of the table of `against`."""
    ratios = [
        f"* {name}: {row.ratio():.1f} ({row.vertices:,} vertices, {row.newton_steps} iterations, "
        f"up to {row.pairs:,} pairs, of which {row.own_pairs:,} in self contact)"
        for name, row in cases.items()
    ]
    met = "met" if all(row.ratio() >= AT_LEAST for row in cases.values()) else "not met"
    listed = "\n".join(ratios)
    aim = f"The aim, a ratio of at least {AT_LEAST:g}, is {met}."
    return f"Time of ipctk divided by that of clothsim:\n\n{listed}\n\n{aim}"


def write_oracle(file: Path, cases: Mapping[str, Compared], date: str) -> None:
    """Replace the table of the page that compares with ipctk."""
    text = f"{markdown_table(*against(cases))}\n\n{oracle_summary(cases)}"
    write_between(file, "oracle", f"Measured on {date[:10]}.\n\n{text}")


def windowed(cases: Mapping[str, Measured], then: Mapping[str, Measured], revision: str) -> str:
    """A line a window: processor seconds and iterations a step, beside those of a revision where it was measured."""
    lines = []
    for name, row in cases.items():
        if "skipped" in row or name.partition(": ")[2] not in WINDOWS:
            continue
        settings, _, window = name.partition(": ")
        cells = [settings, window, f"{row['cpu'] / row['steps']:.2f}", _counts(row)]
        old = then.get(name, {"skipped": ""})
        if "skipped" in old:
            cells += ["", "", ""]
        else:
            cells += [f"{old['cpu'] / old['steps']:.2f}", _counts(old), f"{row['cpu'] / old['cpu']:.2f}"]
        lines.append(tuple(cells))
    header = (
        "settings",
        "phase of the fall",
        "CPU s per step",
        "iterations + on patches",
        f"{revision}: CPU s per step",
        f"{revision}: iterations + on patches",
        "ratio of the times",
    )
    return markdown_table(header, lines)


def _counts(row: Measured) -> str:
    return f"{row['iterations']:.0f} + {row.get('regional', 0):.0f}"


def write_page(
    file: Path, cases: Mapping[str, Measured], date: str, then: Mapping[str, Measured] | None = None, revision: str = ""
) -> None:
    """Replace the tables of the page for which the cases were measured.

    then: the same cases of a `revision`, where that was measured beside them.
    """
    if any(name.partition(": ")[2] in WINDOWS for name in cases):
        write_between(file, "windows", f"Measured on {date[:10]}.\n\n{windowed(cases, then or {}, revision)}")
    if PROFILED in cases and "skipped" not in cases[PROFILED]:
        write_between(file, "profile", f"Measured on {date[:10]}.\n\n{profile(cases[PROFILED])}")
    if all(name in cases for name in AIMS):
        write_between(file, "aims", f"Measured on {date[:10]}.\n\n{aimed(cases)}")
