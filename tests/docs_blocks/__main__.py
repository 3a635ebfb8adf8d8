"""Run the blocks of the documentation: `python -m tests.docs_blocks [--all] [PAGE ...]`; PAGE is the end of a path."""

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from time import process_time
from traceback import format_exception_only

from tests.docs_blocks import RUN, blocks_of
from tests.docs_blocks.execution import PageRun, parsed


def main(argv: Sequence[str]) -> int:
    """Run the blocks of the named pages, or of all, and count what was run, parsed and left out; 1 where one failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--all", action="store_true", help="also blocks that take long, or need an extra")
    parser.add_argument("pages", nargs="*", metavar="PAGE", help="ends of paths, as howto/rest.md")
    arguments = parser.parse_args(argv)
    total, failed = Counter[str](), 0
    for page in RUN:
        if arguments.pages and not any(page.as_posix().endswith(name) for name in arguments.pages):
            continue
        counts, started = Counter[str](), process_time()
        with tempfile.TemporaryDirectory() as folder:
            running = PageRun(Path(folder))
            for block in blocks_of(page):
                try:
                    parsed(block)
                    counts["run" if running.run(block, arguments.all) else block.reason or block.language] += 1
                except (Exception, SystemExit) as error:
                    if isinstance(error, ModuleNotFoundError) and block.reason == "extra":
                        counts["extra"] += 1
                        continue
                    failed += 1
                    print(f"{block} FAILED: {''.join(format_exception_only(error)).strip()}")
        total += counts
        print(f"{page.name}: {dict(counts)}, {process_time() - started:.1f} CPU s", flush=True)
    print(f"all: {dict(total)}, {failed} failed")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
