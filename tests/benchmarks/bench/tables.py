"""Text tables of the benchmark."""

from collections.abc import Mapping

from clothsim.base.text import text_table
from tests.benchmarks.bench.measure import PHASES, Measured, each, ratio

Rows = Mapping[str, Measured]
"""{case: what was measured of it}."""


def summary(rows: Rows, last: Rows) -> str:
    """A line a case. last: an earlier bench, for the ratio of processor seconds."""
    header = (
        "case", "vertices", "CPU s", "wall s", "of last", "iterations", "solves", "ms each", "x its own solve",
        "of regions", "ms each", "pairs", "peak MB",
    )  # fmt: skip
    lines = []
    for name, row in rows.items():
        if "skipped" in row:
            continue
        iterations = row.get("iterations")
        lines.append(
            [
                name,
                _count(row.get("vertices")),
                f"{row['cpu']:.3g}",
                f"{row['wall']:.3g}",
                _quotient(row["cpu"], last.get(name, {}).get("cpu")),
                _count(iterations),
                _count(row.get("linear_solves")),
                f"{1e3 * each(row):.3g}" if iterations else "",
                _ratio(row),
                _count(row.get("regional")),
                f"{1e3 * row['regional_cpu'] / row['regional']:.3g}" if row.get("regional") else "",
                _count(row.get("pairs")),
                f"{row['peak_memory'] / 1e6:.0f}",
            ]
        )
    return "\n".join([text_table(header, lines), *_skips(rows)])


def split(rows: Rows) -> str:
    """Processor milliseconds per Newton iteration: a line a part (phases, then effects), a column a case."""
    rows = {name: row for name, row in rows.items() if row.get("parts")}
    named = {part for row in rows.values() for part in row["parts"]}
    order = [*(phase for phase in PHASES if phase in named), *sorted(named.difference(PHASES))]
    lines = []
    for part in order:
        cells = [1e3 * row["parts"].get(part, 0.0) / row["iterations"] for row in rows.values()]
        lines.append([part, *(f"{cell:.3g}" if cell >= 1e-3 else "" for cell in cells)])
    return text_table(("CPU ms / Newton iteration, with patches", *rows), lines) if rows else ""


def comparison(then: Rows, now: Rows, revision: str) -> str:
    """A line a case: this package beside that of a revision, and now / then."""
    header = (
        "case",
        f"CPU s {revision}",
        "now",
        "ratio",
        f"iterations {revision}",
        "now",
        "ratio",
        "ratio of ms each, without regions",
    )
    lines, skips = [], []
    for name, new in now.items():
        old = then[name]
        if "skipped" in old or "skipped" in new:
            lines.append([name, *[""] * (len(header) - 1)])
            skips += [
                f"{name}, {of}: {row['skipped']}" for of, row in ((revision, old), ("now", new)) if "skipped" in row
            ]
            continue
        counts = new.get("iterations"), old.get("iterations")
        seconds = [each(row) for row in (new, old)] if all(counts) else [None, None]
        lines.append(
            [
                name,
                f"{old['cpu']:.3g}",
                f"{new['cpu']:.3g}",
                _quotient(new["cpu"], old["cpu"]),
                _count(counts[1]),
                _count(counts[0]),
                _quotient(*counts),
                _quotient(*seconds),
            ]
        )
    return "\n".join([text_table(header, lines), *(f"  {line}" for line in skips)])


def _skips(rows: Rows) -> list[str]:
    return [f"  {name} was skipped: {row['skipped']}" for name, row in rows.items() if "skipped" in row]


def _ratio(row: Measured) -> str:
    value = ratio(row)
    return "" if value is None else f"{value:.2f}"


def _quotient(one: float | None, other: float | None) -> str:
    return f"{one / other:.2f}" if one is not None and other else ""


def _count(value: float | None) -> str:
    return "" if value is None else f"{value:,.0f}"
