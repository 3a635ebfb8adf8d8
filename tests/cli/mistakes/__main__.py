"""Table of the typical mistakes with what was answered to each that is not good, and the counts."""

import sys
import tempfile
from collections import Counter
from pathlib import Path

from tests.cli.mistakes import checked, mistakes, prepare


def main() -> int:
    """Make all mistakes; 1 where an answer is bad."""
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix="clothsim-mistakes-") as name:
        folder = Path(name)
        prepare(folder)
        for mistake in mistakes():
            answer = checked(mistake, folder)
            counts[answer.kind] += 1
            print(f"{answer.kind:5} {mistake.label}", flush=True)
            if answer.kind != "good" or "--all" in sys.argv:
                lines = answer.text.strip().splitlines()[-3:]
                print(f"      {answer.code}, without {', '.join(answer.missing) or 'nothing'}")
                print("\n".join(f"      | {line}" for line in lines))
    print(
        f"{sum(counts.values())} mistakes: " + ", ".join(f"{counts[kind]} {kind}" for kind in ("good", "fair", "bad"))
    )
    return int(counts["bad"] > 0)


if __name__ == "__main__":
    sys.exit(main())
