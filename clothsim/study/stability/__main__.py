"""`python -m clothsim.study.stability [--small] [--seeds N] [--only B1,B5] [--readme FILE]`: the hard cases' table."""

import argparse
import sys
from collections.abc import Iterable, Sequence
from datetime import date
from pathlib import Path

from clothsim.study.stability.case import Result, run_case
from clothsim.study.stability.cases import CASES
from clothsim.study.text_table import text_table

BEGIN, END = "<!-- stability -->", "<!-- /stability -->"
HEADER = ("case", "what", "seeds passed", "smallest gap", "Newton", "CPU s")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the cases, print a line for each as it ends, then the table; exit code 1 where one did not pass."""
    parser = argparse.ArgumentParser(prog="python -m clothsim.study.stability", description="The table of hard cases.")
    parser.add_argument("--small", action="store_true", help="the small form that the tests run")
    parser.add_argument("--seeds", type=int, default=1, metavar="N", help="jitter seeds of each case (20: full table)")
    parser.add_argument("--only", default="", metavar="B1,B5", help="these cases only")
    parser.add_argument("--readme", type=Path, metavar="FILE", help="write the table between its marks in FILE")
    arguments = parser.parse_args(argv)
    wanted = [name for name in arguments.only.split(",") if name]
    unknown = [name for name in wanted if not any(_is(case.name, name) for case in CASES)]
    if unknown:
        parser.error(f"no case is called {unknown[0]}; there are {', '.join(case.name for case in CASES)}")
    rows, passed = [], True
    for case in CASES:
        if wanted and not any(_is(case.name, name) for name in wanted):
            continue
        results = [run_case(case, seed, arguments.small) for seed in range(arguments.seeds)]
        for result in results:
            if not result.passed:
                print(f"{case.name} seed {result.seed}: {result.wrong}", flush=True)
        rows.append(row(case.name, case.title, results))
        print(", ".join(rows[-1]), flush=True)
        passed = passed and all(result.passed for result in results)
    print()
    print(text_table(HEADER, rows))
    if arguments.readme:
        write_between(arguments.readme, markdown(rows, "small forms" if arguments.small else "full forms"))
    return 0 if passed else 1


def _is(case: str, wanted: str) -> bool:
    """True for the case itself, and for B7a where B7 is wanted."""
    return case == wanted or case.rstrip("abcdefghijklmnopqrstuvwxyz") == wanted


def row(name: str, title: str, results: Sequence[Result]) -> tuple[str, ...]:
    """A line of the table: seeds passed, the smallest gap of all, the mean of the Newton iterations and CPU seconds."""
    count, gap = len(results), min(result.gap for result in results)
    return (
        name,
        title,
        f"{sum(result.passed for result in results)} of {count}",
        f"{gap:.1e} m" if gap < float("inf") else "-",
        f"{sum(result.newton_iterations for result in results) / count:,.0f}",
        f"{sum(result.seconds for result in results) / count:.1f}",
    )


def markdown(rows: Iterable[Sequence[str]], forms: str) -> str:
    """The table in Markdown, dated."""
    lines = [f"{date.today().isoformat()}, {forms}; made by `python -m clothsim.study.stability`.", ""]
    lines += ["| " + " | ".join(HEADER) + " |", "| " + " | ".join("---" for _ in HEADER) + " |"]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines)


def write_between(file: Path, text: str) -> None:
    """Replace what stands between the two marks of a file."""
    old = file.read_text(encoding="utf-8")
    if BEGIN not in old or END not in old:
        raise SystemExit(f"{file} has no {BEGIN} and {END}: add both lines where the table shall stand.")
    head, tail = old.split(BEGIN)[0], old.split(END)[1]
    file.write_text(f"{head}{BEGIN}\n{text}\n{END}{tail}", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
