"""`python -m tests.benchmarks.bench`: cost of a Newton iteration by part."""

import argparse
import os
import platform
import sys
from collections.abc import Sequence
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.file_writing import write_atomically
from clothsim.base.record import to_json
from clothsim.base.text import text_table
from tests.benchmarks.bench.alone import ALONE, COPY, without_others
from tests.benchmarks.bench.bench_cases import ORACLE, QUICK, ROOT, Case, aims, benchmark, windows
from tests.benchmarks.bench.measure import Measured, measured
from tests.benchmarks.bench.page import against, oracle_summary, write_oracle, write_page
from tests.benchmarks.bench.revision import name_of, worktree
from tests.benchmarks.bench.tables import comparison, split, summary
from tests.benchmarks.stored_tables import read_record

RESULTS = Path("results/bench")
STATES, COMPARED = "states", "-compared"

_DESCRIPTION = """\
Cost of a Newton iteration by part: short scenes, each measured several times from one state, in a process of its
own. CPU seconds of one thread; each number is the median. No pass or fail: the numbers
belong to the machine that they were measured on.
"""


def chosen(cases: Sequence[Case], names: str | None, quick: bool) -> list[Case]:
    """The cases of the command line. InputError for a name that there is not."""
    known = {case.name: case for case in cases}
    if names is None:
        return [case for case in cases if not quick or case.name in QUICK]
    asked = [name.strip() for name in names.split(",") if name.strip()]
    for name in asked:
        if name not in known:
            raise InputError(f"--only: there is no case {name!r}.", f"Known: {', '.join(known)}.")
    if not asked:
        raise InputError("--only names nothing.", f"Known: {', '.join(known)}.")
    return [known[name] for name in asked]


def run(
    cases: Sequence[Case],
    results: Path,
    repeats: int,
    compare: str | None = None,
    picture: Path | None = None,
    page: Path | None = None,
) -> str:
    """Measure the cases, keep them in the folder `results`, and say what was found."""
    states, where = results / STATES, _where()
    rows: dict[str, Measured] = {}
    then: dict[str, Measured] = {}
    if compare is None:
        for case in cases:
            (rows[case.name],) = measured(case, [ROOT], states, repeats, _say)
    else:
        with worktree(ROOT, compare) as there:
            for case in cases:
                rows[case.name], then[case.name] = measured(case, [ROOT, there], states, repeats, _say)
    last = _last(results)
    kept: dict[str, Any] = {**where, "cases": rows}
    file = results / f"{where['date'][:10]}-{where['revision'] or 'no-git'}{COMPARED if compare else ''}.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    kept = _joined(file, kept) if compare is None else kept | {"compared": {"revision": compare, "cases": then}}
    write_atomically(file, (to_json(kept, indent=1) + "\n").encode())
    if picture is not None:
        from tests.benchmarks.bench.bench_picture import draw

        draw(_last(results), picture)
    if page is not None:
        write_page(page, rows, where["date"], then, compare or "")
    tables = [summary(rows, last), split(rows)]
    if compare is not None:
        tables.append(comparison(then, rows, compare))
    return "\n\n".join([_headline(kept), *filter(None, tables), f"kept in {file}"])


def alone(results: Path, repeats: int) -> str:
    """Measure a membrane with this package and with a copy that has no file of another effect, in turns."""
    with without_others(ROOT) as there:
        here, copy = measured(ALONE, [ROOT, there], results / STATES, repeats, _say)
    return comparison({ALONE.name: copy}, {ALONE.name: here}, COPY)


def oracle(cases: Sequence[Case], results: Path, repeats: int, page: Path | None = None) -> str:
    """Measure contact and ipctk on the steps of the cases, in turns."""
    from tests.benchmarks.bench.oracle import compared

    where = _where()
    rows = {case.name: compared(case, results / STATES, repeats, _say) for case in cases}
    if page is not None:
        write_oracle(page, rows, where["date"])
    return "\n\n".join([_headline(where), text_table(*against(rows)), oracle_summary(rows)])


def _joined(file: Path, kept: dict[str, Any]) -> dict[str, Any]:
    """With the other cases of the same revision and day, so that a few can be measured again."""
    old = read_record(file)
    return {**kept, "cases": {**old.get("cases", {}), **kept["cases"]}}


def _set(arguments: argparse.Namespace) -> tuple[Case, ...]:
    """The cases that the options ask for."""
    return aims() if arguments.aims else windows() if arguments.windows else benchmark()


def _last(results: Path) -> dict[str, Measured]:
    """The newest number of each case in the folder, of any revision."""
    found: dict[str, Measured] = {}
    files = [file for file in results.glob("*.json") if not file.stem.endswith(COMPARED)]
    for file in sorted(files, key=lambda file: file.stat().st_mtime):
        found.update({name: row for name, row in read_record(file).get("cases", {}).items() if "skipped" not in row})
    return found


def _where() -> dict[str, Any]:
    versions = {"python": platform.python_version()}
    versions.update({name: version(name) for name in ("clothsim", "numpy", "numba", "ipctk")})
    return {
        "date": datetime.now().astimezone().isoformat(timespec="minutes"),
        "revision": name_of(ROOT),
        "cores": os.cpu_count() or 1,
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "versions": versions,
    }


def _headline(kept: dict[str, Any]) -> str:
    software = ", ".join(f"{name} {number}" for name, number in kept["versions"].items())
    busy = "" if kept["load"] is None else f" (load {kept['load']:.1f})"
    return f"{kept['date']}, revision {kept['revision'] or 'unknown'}, {kept['cores']} cores{busy}; {software}"


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def main(argv: Sequence[str] | None = None, cases: Sequence[Case] | None = None) -> int:
    """Measure, keep, print. cases: another set than the benchmark's."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.bench", description=_DESCRIPTION)
    parser.add_argument("--quick", action="store_true", help=f"only {', '.join(QUICK)}")
    parser.add_argument("--only", metavar="NAMES", help="these cases, with commas between")
    parser.add_argument(
        "--aims", action="store_true", help="the target times (seconds per simulated second) in place of the set"
    )
    parser.add_argument(
        "--windows", action="store_true", help="free fall, first touch and crumpling of a sheet in place of the set"
    )
    parser.add_argument("--alone", action="store_true", help="a membrane, and in a copy without other effects' files")
    parser.add_argument("--oracle", action="store_true", help="contact alone, and ipctk on the same Newton steps")
    parser.add_argument("--compare", metavar="REV", help="measure git revision REV beside this package, in turns")
    parser.add_argument("--repeats", type=int, default=3, metavar="N", help="trials of a case (default 3)")
    parser.add_argument("--results", type=Path, default=RESULTS, metavar="DIR", help=f"where to (default {RESULTS})")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw time against vertices as PNG")
    parser.add_argument("--page", type=Path, metavar="FILE", help="write the tables between the marks of FILE")
    arguments = parser.parse_args(argv)
    try:
        if arguments.repeats < 1:
            raise InputError(f"--repeats is {arguments.repeats}.", "Give 1 or more.")
        if arguments.page is not None and not arguments.page.is_file():  # reported before minutes of measurement
            raise InputError(f"--page is {arguments.page}, which is no file.", "Give a page with marks in it.")
        if arguments.alone:
            print(alone(arguments.results, arguments.repeats))
            return 0
        known = cases if cases is not None else _set(arguments)
        if arguments.oracle:
            both = [case for case in known if cases is not None or case.name in ORACLE]
            asked = chosen(both, arguments.only, arguments.quick)
            print(oracle(asked, arguments.results, arguments.repeats, arguments.page))
            return 0
        asked = chosen(known, arguments.only, arguments.quick)
        print(run(asked, arguments.results, arguments.repeats, arguments.compare, arguments.picture, arguments.page))
    except ClothsimError as error:
        print(error.sentence, error.remedy, sep="\n", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
