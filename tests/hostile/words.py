"""Hostile command lines: unknown words, values, options that do not go together, empty ones."""

from collections.abc import Iterator

from tests.hostile.case import Case
from tests.hostile.stock import SHEET

REFUSED = """\
nothing
rnu a.toml
run
run nothing.toml
run a.toml extra
run a.toml --nothing
run a.toml --set
run a.toml --set x
run a.toml --set cloth.cells
run a.toml --set cloth.cells=[
run a.toml --set cloth.cells=[[[[
run a.toml --set cloth.cells[99]=3
run a.toml --set cloth.cells[-1]=3
run a.toml --set =3
run a.toml --set ....=3
run a.toml --set cloth..cells=3
run a.toml --set solver.dt=1e-300
run a.toml --set seed.from=file
run a.toml --frames-per-second 0
run a.toml --frames-per-second nan
run a.toml --frames-per-second 1e9
run a.toml --error 0
run a.toml --error -1mm
run a.toml --error 1parsec
run a.toml --preset best
run a.toml --dump-iterates 0
run a.toml --dump-iterates x
run a.toml -o a.toml
run a.toml -o a.toml/x
run a.toml -o /proc/x
run a.toml -o /dev/null
run .
run a.zip
check
check nothing
check a.toml --scale 2
check a.toml --on a.toml
explain a.toml --steps 0
explain a.toml --budget 0s
explain a.toml --budget 9
fit
fit a.toml
fit nothing.obj --to shirt
fit a.toml --to nothing.obj
dress nothing --on shirt
dress tunic --on nothing.obj
dress tunic --on shirt --size 0
dress tunic --on shirt --grade waist=0
dress tunic --on shirt --grade nothing=1.1
dress tunic --on shirt --fabric paper
study a.toml --budget 0
study a.toml --parameters nothing
study a.toml --workers 0
study a.toml --goal nothing
gradient a.toml --loss nothing --wrt start
gradient a.toml --loss height --wrt nothing
gradient a.toml --loss girth=x --wrt start
gradient a.toml --loss target=nothing.obj --wrt start
recover a.toml --target nothing --free density
recover a.toml --target a.toml --free nothing
design a.toml --free x
design a.toml --free x --girth 1
design a.toml --free x --hem x=1
keys nothing
fabrics paper
test paper
test cotton --method magic
test cotton --set density
test cotton --lays 0
completion dos
scenes extra
view
view . --port 0
view . --port 99999
learn
preview
farm
farm nothing
garment nothing
mcp nothing"""
COMPLETED = """\
keys
keys solver
keys --json
fabrics
fabrics denim --json
scenes
explain a.toml --steps 1
check a.toml
check a.toml --json
run a.toml -o out --no-picture --json
run a.toml -o out --no-picture --set cloth.density=0.2
completion bash"""


def cases() -> Iterator[Case]:
    """All of them."""
    for line in REFUSED.splitlines():
        yield Case(
            f"words: {line}", line, "refused", {"a.toml": SHEET}, small=line in ("nothing", "run", "run a.toml --set x")
        )
    for line in COMPLETED.splitlines():
        yield Case(f"words: {line}", line, "completed", {"a.toml": SHEET}, small=line == "keys solver")
    for words in (
        ["run", "a.toml", "-o", ""],
        ["run", ""],
        ["check", ""],
        ["", ""],
        ["run", "a.toml", "--set", "cloth.name='\x1b[2J'"],
        ["keys", "\x1b[2J"],
        ["run", "a" * 100_000],
        ["run", "a.toml", "--set", "a=" + "[" * 100_000],
    ):
        yield Case(f"words: {[word[:20] for word in words]}", words, "refused", {"a.toml": SHEET})
