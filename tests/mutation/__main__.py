"""`python -m tests.mutation [--count N] [--again] [--record FILE] [--page FILE]`: broken formulas that no test sees."""

import argparse
import hashlib
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.benchmarks.stored_tables import Record, markdown_table, read_record, write_between, write_record
from tests.mutation.mutants import Mutant, drawn, mutants_of
from tests.mutation.own_tests import ROOMS, own_tests
from tests.mutation.trial import CAUGHT, NOT_RUN, SURVIVED, TIME_OUT, Bench

ROOT = Path(__file__).parents[2]
SHARES = dict(zip(ROOMS, (0.35, 0.35, 0.15, 0.15), strict=True))
"""Of the mutants, by room."""
EQUIVALENT = Path(__file__).with_name("equivalent.toml")
"""Survivors that change no result, with the reason."""
KNOWN = "clothsim/physics/contact/barrier_kernels.py"
"""File of the mutant that every run begins with: were it not caught, the machine code of before would have run."""
MARK = "mutation"


def main(argv: Sequence[str] | None = None) -> int:
    """Run mutants, print each that survives; exit code 1 where one does that `equivalent.toml` does not explain."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__.split(": ")[1])
    parser.add_argument("--count", type=int, default=200, help="mutants of all rooms together (200)")
    parser.add_argument("--seed", type=int, default=1, help="of the draw (1)")
    parser.add_argument("--only", default="", metavar="TEXT", help="files whose path contains TEXT")
    parser.add_argument("--since", default="", metavar="COMMIT", help="lines that their file lacked then; rooms alike")
    parser.add_argument("--again", action="store_true", help="only those that the record has as survivors")
    parser.add_argument("--trust", action="store_true", help="do not run the tests as they are before")
    parser.add_argument("--bound", type=int, default=90, help="seconds of the processor for each (90)")
    parser.add_argument("--record", type=Path, metavar="FILE", help="JSON; mutants that it has are not run again")
    parser.add_argument("--page", type=Path, metavar="FILE", help="write the tables between FILE's marks")
    parser.add_argument("--folder", type=Path, help="keep compiled kernels here (a temporary folder)")
    arguments = parser.parse_args(argv)
    record: Record = read_record(arguments.record) if arguments.record else {}
    chosen = [each for each in _chosen(arguments) if arguments.only in each.file]
    if arguments.again:
        chosen = [each for each in _all() if is_open(record.get(identity(each), {}))]
    else:
        chosen = [each for each in chosen if identity(each) not in record]
    with TemporaryDirectory() as temporary:
        folder = (arguments.folder or Path(temporary)).absolute()
        _run(chosen, Bench(ROOT, folder) if chosen else None, record, arguments)
    print(f"\n{summary(record)}")
    if arguments.page:
        write_between(arguments.page, MARK, page(record))
    return 1 if any(is_open(entry) for entry in record.values()) else 0


def _all() -> list[Mutant]:
    """Every mutant of the rooms."""
    files = [str(file.relative_to(ROOT)) for room in ROOMS for file in sorted((ROOT / "clothsim" / room).rglob("*.py"))]
    return [mutant for file in files for mutant in mutants_of(ROOT, file)]


def _chosen(arguments: argparse.Namespace) -> list[Mutant]:
    """The draw: a share for each room, of files that have tests; of new lines alone with --since."""
    mutants = [mutant for mutant in _all() if own_tests(ROOT, mutant.file)]
    shares = SHARES
    if arguments.since:
        earlier = {file: _text_at(arguments.since, file) for file in {mutant.file for mutant in mutants}}
        mutants = [mutant for mutant in mutants if mutant.before not in earlier[mutant.file]]
        shares = dict.fromkeys(ROOMS, 1 / len(ROOMS))
    by_room = {room: [each for each in mutants if each.file.startswith(f"clothsim/{room}/")] for room in ROOMS}
    counts = {room: round(shares[room] * arguments.count) for room in ROOMS}
    return [each for room in ROOMS for each in drawn(by_room[room], counts[room], arguments.seed)]


def _text_at(commit: str, file: str) -> str:
    """A file's text at a commit; empty where it was not there."""
    shown = subprocess.run(["git", "show", f"{commit}:{file}"], check=False, cwd=ROOT, capture_output=True, text=True)
    return shown.stdout if shown.returncode == 0 else ""


def _run(mutants: list[Mutant], bench: Bench | None, record: Record, arguments: argparse.Namespace) -> None:
    """The tests as they are, which must pass, then each mutant; the record is kept after each."""
    if bench is None:
        return
    tests = list(dict.fromkeys(test for mutant in mutants for test in own_tests(ROOT, mutant.file)))
    if not arguments.trust and (sound := bench.verdict(tests, 3600)).word != SURVIVED:
        raise SystemExit(f"the tests do not pass as they are: {sound.by}")
    known = known_mutant()
    changed = known.applied((bench.root / KNOWN).read_text())
    if bench.verdict(own_tests(ROOT, KNOWN), arguments.bound, KNOWN, changed).word != CAUGHT:
        raise SystemExit(f"a mutant that must be caught was not: {known.after}")
    print(f"{len(mutants)} mutants, {len(tests)} files of tests", flush=True)
    for number, mutant in enumerate(mutants, 1):
        changed = mutant.applied((bench.root / mutant.file).read_text())
        verdict = bench.verdict(own_tests(ROOT, mutant.file), arguments.bound, mutant.file, changed)
        key = identity(mutant)
        entry = record.setdefault(key, {"file": mutant.file, "inside": mutant.inside, "first": asdict(verdict)})
        entry |= {"line": mutant.line, "before": mutant.before, "after": mutant.after, "last": asdict(verdict)}
        where = f"{mutant.file}:{mutant.line}"
        print(f"{number:4d} {verdict.word:9s} {verdict.seconds:5.1f} s {where}  {mutant.before}  ->  {mutant.after}")
        sys.stdout.flush()
        if arguments.record:
            write_record(arguments.record, record)


def known_mutant() -> Mutant:
    """Offset of the barrier times 0.98."""
    broken = "0.98 * offset * offset"
    return next(each for each in mutants_of(ROOT, KNOWN) if each.inside == "evaluate" and broken in each.after)


def identity(mutant: Mutant) -> str:
    """Eight digits that name a mutant, wherever its line stands."""
    return hashlib.blake2b(repr(mutant.key).encode(), digest_size=4).hexdigest()


@cache
def reasons() -> dict[tuple[str, str, str], str]:
    """{(file, before, after): why no test can see it}."""
    listed = tomllib.loads(EQUIVALENT.read_text())["equivalent"]
    return {(each["file"], each["before"], each["after"]): each["reason"] for each in listed}


def reason(entry: dict) -> str:
    """Why a survivor changes no result; empty where nobody said."""
    return reasons().get((entry["file"], entry["before"], entry["after"]), "")


def is_open(entry: dict) -> bool:
    """True for a survivor without a reason, whose line is still there."""
    return bool(entry) and entry["last"]["word"] in (SURVIVED, NOT_RUN) and not (reason(entry) or is_gone(entry))


def is_gone(entry: dict) -> bool:
    """True where the line that was broken has been rewritten since."""
    file = ROOT / entry["file"]
    return not file.is_file() or entry["before"] not in file.read_text()


def summary(record: Record) -> str:
    """Counts by room: before tests were added, and now."""
    rows = []
    for room in ROOMS:
        entries = [each for each in record.values() if each["file"].startswith(f"clothsim/{room}/")]
        first = [each["first"]["word"] for each in entries]
        open_now, equivalent = sum(map(is_open, entries)), sum(bool(reason(each)) for each in entries)
        of_first = (first.count(word) for word in (CAUGHT, TIME_OUT, SURVIVED))
        rows.append((room, *map(str, (len(entries), *of_first, equivalent, open_now))))
    totals = [str(sum(int(row[k]) for row in rows)) for k in range(1, 7)]
    header = (
        "package",
        "mutants",
        "caught in the first run",
        "timed out",
        "survived the first run",
        "of these equivalent",
        "still surviving",
    )
    return markdown_table(header, [*rows, ("all", *totals)])


def page(record: Record) -> str:
    """The counts, and the mutants that no test detects, with the reason."""
    survivors = [each for each in record.values() if reason(each) or is_open(each)]
    rows = [
        (
            f"`{each['file'].removeprefix('clothsim/')}`",
            f"`{each['before']}`".replace("|", "\\|"),
            f"`{each['after']}`".replace("|", "\\|"),
            reason(each) or "it has no test",
        )
        for each in sorted(survivors, key=lambda each: (each["file"], each["line"]))
    ]
    return f"{summary(record)}\n\n{markdown_table(('file', 'line', 'mutant', 'why no test detects it'), rows)}"


if __name__ == "__main__":
    sys.exit(main())
