"""`python -m tests.known_answers [--rows A1,A3] [--record FILE] [--page FILE]`: the table of known answers."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from clothsim.base.text import text_table
from tests.benchmarks.stored_tables import Record, read_record, write_between, write_record
from tests.known_answers.row import Row, seen
from tests.known_answers.table import HEADER, ROWS, cells, chosen, entry, markdown

MARK = "validation"


def main(argv: Sequence[str] | None = None, rows: Sequence[Row] = ROWS) -> int:
    """Run the rows, print a line for each as it ends, then the table; exit code 1 where one did not pass."""
    parser = argparse.ArgumentParser(prog="python -m tests.known_answers", description=__doc__.split(": ")[1])
    parser.add_argument("--rows", default="", metavar="A1,A3b", help="these rows only")
    parser.add_argument("--record", type=Path, metavar="FILE", help="keep what was seen in FILE (JSON), row by row")
    parser.add_argument("--page", type=Path, metavar="FILE", help="write the table between FILE's marks")
    arguments = parser.parse_args(argv)
    wanted = [name for name in arguments.rows.split(",") if name]
    unknown = [name for name in wanted if not chosen([name], rows)]
    if unknown:
        parser.error(f"no row is called {unknown[0]}; there are {', '.join(row.name for row in rows)}")
    record: Record = read_record(arguments.record) if arguments.record else {}
    lines, passed = [], True
    for row in chosen(wanted, rows):
        result = seen(row)
        record[row.name] = entry(result)
        lines.append(cells(row, record[row.name]))
        print(", ".join(cell for cell in lines[-1] if cell), flush=True)
        passed = passed and result.passed
        if arguments.record:
            write_record(arguments.record, record)
    print(f"\n{text_table(HEADER, lines)}")
    if arguments.page:
        write_between(arguments.page, MARK, markdown(rows, record))
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
