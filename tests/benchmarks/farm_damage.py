"""Random damage to a farm: `python -m tests.benchmarks.farm_damage --count 150`.

Each time one random file of a verified farm is flipped in a bit, cut, emptied, overwritten, removed or made a folder.
`verify` must see it or the arrays must be as before, `pack` must write nothing of a farm that is not what was verified,
no command may end in a fault, and `repair`, `plan` with the same recipe and `work` must bring all back.
"""

import argparse
import contextlib
import io
import json
import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from clothsim.cli import main as command
from clothsim.study.farm.plan import FARM_NAME, open_farm, plan
from clothsim.study.farm.verification import verify
from clothsim.study.farm.work import work
from tests.benchmarks.farm_chaos import sheet_recipe

KINDS = ("flip", "cut", "empty", "overwrite", "remove", "folder")
MATTERS = ("drapes", "meshes", "jobs.jsonl", FARM_NAME)
"""What is published; claims, attempts and manifest.jsonl are of the work, verified.json is written again."""


def damage(file: Path, kind: str, chance: random.Random) -> None:
    """Damage a file."""
    content = bytearray(file.read_bytes())
    if kind == "flip" and content:
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    file.unlink()
    if kind == "folder":
        file.mkdir()
    elif kind != "remove":
        lengths = {"cut": chance.randrange(len(content) + 1), "empty": 0}
        file.write_bytes(chance.randbytes(200) if kind == "overwrite" else content[: lengths.get(kind, len(content))])


def tried(sound: Path, folder: Path, count: int, chance: random.Random) -> str:
    """Damage a copy of a farm; "seen", "harmless", or what is wrong."""
    farm = Path(shutil.copytree(sound, folder / "farm"))
    file = chance.choice(sorted(path.relative_to(farm) for path in farm.rglob("*") if path.is_file()))
    kind = chance.choice(KINDS)
    damage(farm / file, kind, chance)
    said = io.StringIO()

    def code(*words: str) -> int:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            return command(["farm", words[0], str(farm), *words[1:]])

    seen = code("verify", "--fraction", "0") != 0
    packed = code("pack", "-o", str(folder / "a.h5")) == 0
    for words in (("status",), ("work",), ("repair",)):
        code(*words)
    where = f"{kind} of {file}"
    if seen and packed and file.parts[0] in MATTERS:
        return f"packed: {where}"
    if not seen and file.parts[0] in MATTERS and file.parts[0] != "meshes":  # of which the arrays count, not the bytes
        return f"not seen: {where}"
    if file.parts[0] in (FARM_NAME, "jobs.jsonl", "verified.json"):
        shutil.rmtree(farm / file, ignore_errors=True) if (farm / file).is_dir() else (farm / file).unlink(True)
        (farm / FARM_NAME).unlink(missing_ok=True)
        plan(sheet_recipe(count), farm)
    back = [code(*words) for words in (("work",), ("verify", "--fraction", "0"), ("pack", "-o", str(folder / "b.h5")))]
    if any(back):
        return f"not brought back {back}: {where}"
    if "fault of clothsim" in said.getvalue():
        return f"fault: {where}"
    return "seen" if seen else "harmless"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print what became of the damages as JSON; exit code 1 where one is neither seen nor harmless."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=150)
    parser.add_argument("--drapes", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    chance, found = random.Random(given.seed), Counter[str]()
    with tempfile.TemporaryDirectory(prefix="clothsim-damage-") as scratch:
        sound = plan(sheet_recipe(given.drapes), Path(scratch) / "sound")
        work(sound)
        verify(open_farm(sound.directory), fraction=0)
        for number in range(given.count):
            folder = Path(scratch) / str(number)
            found[tried(sound.directory, folder, given.drapes, chance)] += 1
            shutil.rmtree(folder)
    print(json.dumps(found, indent=1))
    return 0 if set(found) <= {"seen", "harmless"} else 1


if __name__ == "__main__":
    sys.exit(main())
