"""`python -m tests.hard_cases [--small] [--seeds N] [--only B1,B5] [--record FILE]`: the hard cases' table."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from clothsim.base.text import text_table
from tests.benchmarks.stored_tables import read_record, write_between
from tests.hard_cases.case import Case, run_case
from tests.hard_cases.cases import CASES
from tests.hard_cases.results_file import COLUMNS, cells, keep, markdown, summary


def main(argv: Sequence[str] | None = None) -> int:
    """Run the cases, print a line for each as it ends, then the table; exit code 1 where one did not pass."""
    arguments, parser = _arguments(argv)
    wanted = [name for name in arguments.only.split(",") if name]
    unknown = [name for name in wanted if not any(_is(case.name, name) for case in CASES)]
    if unknown:
        parser.error(f"no case is called {unknown[0]}; there are {', '.join(case.name for case in CASES)}")
    if arguments.page and not arguments.record:
        parser.error("--page writes what a record holds: name it with --record FILE")
    chosen = [case for case in CASES if not wanted or any(_is(case.name, name) for name in wanted)]
    rows, passed = [], True
    for case in chosen if arguments.seeds else ():
        line, right = _row(case, arguments)
        rows.append(line)
        passed = passed and right
    if rows:
        print()
        print(text_table(("case", "scene", *COLUMNS), rows))
    if arguments.page:
        write_between(arguments.page, "stability", markdown(CASES, read_record(arguments.record)))
    return 0 if passed else 1


def _row(case: Case, arguments: argparse.Namespace) -> tuple[tuple[str, ...], bool]:
    """Run a case from all its starts, printing; its line of the table, and whether all passed."""
    seeds = range(arguments.seeds if case.jitters else 1)
    results = []
    for seed in seeds:
        results.append(run_case(case, seed, arguments.small))
        if not results[-1].passed:
            print(f"{case.name} seed {seed}: {results[-1].wrong}", flush=True)
    if arguments.record:
        keep(arguments.record, case.name, "small" if arguments.small else "full", results)
    line = (case.name, case.title, *cells(summary(results)))
    print(", ".join(line), flush=True)
    return line, all(result.passed for result in results)


def _is(case: str, wanted: str) -> bool:
    """True for the case itself, and for B7a where B7 is wanted."""
    return case == wanted or case.rstrip("abcdefghijklmnopqrstuvwxyz") == wanted


def _arguments(argv: Sequence[str] | None) -> tuple[argparse.Namespace, argparse.ArgumentParser]:
    parser = argparse.ArgumentParser(prog="python -m tests.hard_cases", description="The table of hard cases.")
    parser.add_argument("--small", action="store_true", help="the small form that the tests run")
    parser.add_argument(
        "--seeds",
        type=int,
        default=1,
        metavar="N",
        help="starts of each case: the exact one, N - 1 jittered",
    )
    parser.add_argument("--only", default="", metavar="B1,B5", help="these cases only")
    parser.add_argument("--record", type=Path, metavar="FILE", help="keep what was seen in FILE (JSON), row by row")
    parser.add_argument("--page", type=Path, metavar="FILE", help="write the record as a table between FILE's marks")
    return parser.parse_args(argv), parser


if __name__ == "__main__":
    sys.exit(main())
