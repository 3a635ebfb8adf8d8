"""`python -m tests.hostile [--small] [--only WORD] [--random N --seed S]`: the counted list of hostile inputs.

Prints a line for each case that is wrong, then a table by room: how many got the class that they must get, the largest
processor time, the longest time without a line, the largest memory. Exit code 1 where one is wrong.
"""

import argparse
import contextlib
import io
import os
import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from clothsim.base.text import text_table
from tests.hostile.case import Case, Outcome
from tests.hostile.cases import all_cases
from tests.hostile.drawn import drawn_cases
from tests.hostile.harness import preload, run_case

COLUMNS = ("room", "cases", "right", "refused", "found", "warned", "completed", "stopped", "CPU s", "silent s", "MB")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chosen cases; exit code 1 where one is wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.hostile", description="The counted list of hostile inputs.")
    parser.add_argument("--small", action="store_true", help="the cases of the small form alone")
    parser.add_argument("--only", default="", metavar="WORD", help="cases whose name holds it")
    parser.add_argument("--random", type=int, default=0, metavar="N", help="N scenes drawn from the keys, no list")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of the drawn scenes (default 0)")
    parser.add_argument("--show", action="store_true", help="print every case, and what a wrong one printed")
    arguments = parser.parse_args(argv)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):  # meshio's warnings
        cases = drawn_cases(arguments.random, arguments.seed) if arguments.random else all_cases()
    chosen = [case for case in cases if arguments.only in case.name and (case.small or not arguments.small)]
    if not chosen:
        parser.error(f"no case has {arguments.only!r} in its name")
    preload()
    done = [(case, _shown(case, arguments.show)) for case in chosen]
    print(_table(done))
    return 0 if all(not outcome.wrong for _, outcome in done) else 1


def _shown(case: Case, everything: bool) -> Outcome:
    with tempfile.TemporaryDirectory(prefix="hostile-") as place:
        outcome = run_case(case, Path(place))
    if everything or outcome.wrong:
        cost = f"{outcome.seconds:.1f} s, silent {outcome.silence:.1f} s, {outcome.memory / 1e6:.0f} MB"
        print(f"{case.name}: {outcome.got} ({cost}){'; WRONG: ' if outcome.wrong else ''}{outcome.wrong}", flush=True)
    if everything and outcome.wrong:
        print("    " + outcome.text.strip()[-2000:].replace("\n", "\n    "), flush=True)
    return outcome


def _table(done: Sequence[tuple[Case, Outcome]]) -> str:
    rooms: dict[str, list[Outcome]] = defaultdict(list)
    for case, outcome in done:
        rooms[case.name.partition(":")[0]].append(outcome)
    rooms["all"] = [outcome for _, outcome in done]
    rows = []
    for room, outcomes in rooms.items():
        got = [outcome.got for outcome in outcomes]
        counts = [
            len(outcomes),
            sum(not outcome.wrong for outcome in outcomes),
            *(got.count(name) for name in COLUMNS[3:8]),
        ]
        largest = [max(getattr(outcome, name) for outcome in outcomes) for name in ("seconds", "silence", "memory")]
        rows.append((room, *map(str, counts), f"{largest[0]:.1f}", f"{largest[1]:.1f}", f"{largest[2] / 1e6:.0f}"))
    return text_table(COLUMNS, rows)


if __name__ == "__main__":
    os.environ.setdefault("PYTHONHASHSEED", "0")
    sys.exit(main())
