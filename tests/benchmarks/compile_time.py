"""Compilation time of a cold start: `python -m tests.benchmarks.compile_time [SCENE] [--rows N]`.

The scene is run with an empty cache of compiled kernels, as the first run after an installation does. The seconds are
the processor's; what a kernel calls is compiled within it: `own` is without that. Numba's and NumPy's own functions
that a kernel draws in are listed too: assigning one slice to another costs 1.5 s, for its error message.
"""

import argparse
import os
import re
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

from clothsim.base.text import text_table

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "sphere.toml"
OURS = ("clothsim.", "transfer.")


@dataclass(frozen=True)
class Compiled:
    """A function and the types that it was compiled for; seconds of the processor, own: without what it calls."""

    name: str
    types: str
    seconds: float
    own: float

    @property
    def for_a_literal(self) -> bool:
        """True where the types hold a number: another number, and all is compiled again."""
        return "Literal[int]" in self.types and self.name.startswith(OURS)


def compiled(job: Callable[[], object]) -> list[Compiled]:
    """Compilations by numba while the job runs, the longest first."""
    from numba.core import event

    done: list[Compiled] = []
    open_: list[list[float]] = []  # start, and the seconds of what was compiled within

    class Clock(event.Listener):
        def on_start(self, event: event.Event) -> None:
            open_.append([process_time(), 0.0])

        def on_end(self, event: event.Event) -> None:
            start, within = open_.pop()
            seconds = process_time() - start
            if open_:
                open_[-1][1] += seconds
            function = event.data["dispatcher"].py_func
            types = _short(str(event.data["args"]))
            done.append(Compiled(f"{function.__module__}.{function.__qualname__}", types, seconds, seconds - within))

    with event.install_listener("numba:compile", Clock()):
        job()
    return sorted(done, key=lambda function: -function.own)


def loaded() -> dict[str, list[str]]:
    """Of each kernel of this package that is in memory, the sets of types that it is compiled for."""
    from numba.core.dispatcher import Dispatcher

    modules = [module for name, module in sorted(sys.modules.items()) if name.startswith(OURS)]
    kernels = {
        f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}": kernel
        for module in modules
        for kernel in vars(module).values()
        if isinstance(kernel, Dispatcher)
    }
    return {name: [_short(str(types)) for types in kernel.signatures] for name, kernel in kernels.items()}


def compilation_report(functions: Sequence[Compiled], seconds: float, cpu: float, rows: int) -> str:
    """The table of the longest, and sums: by module, and what should not be."""
    table = [[f"{f.own:.2f}", f"{f.seconds:.2f}", f.name, f.types] for f in functions[:rows]]
    modules: Counter[str] = Counter()
    for function in functions:
        modules[function.name.rpartition(".")[0]] += function.own  # type: ignore[assignment]
    sums = [[f"{own:.2f}", name] for name, own in modules.most_common(rows)]
    literal = [f.name for f in functions if f.for_a_literal]
    total = sum(function.own for function in functions)
    return "\n\n".join(
        [
            text_table(["own [s]", "all [s]", "function", "types"], table),
            text_table(["own [s]", "module"], sums),
            f"{len(functions)} functions compiled in {total:.1f} s of the processor; the run took {cpu:.1f} s of it "
            f"and {seconds:.1f} s by the clock. Compiled for a literal number: {', '.join(literal) or 'none'}.",
        ]
    )


def _run(scene: Path, directory: Path) -> None:
    """Work of `clothsim run`: a run and its picture."""
    from clothsim.render.picture import draw
    from clothsim.run.pictures import frame_surfaces
    from clothsim.run.simulate import simulate
    from clothsim.scene.toml_file import load_scene

    run = simulate(load_scene(scene), directory)
    draw(directory / "picture.png", frame_surfaces(run.trajectory, -1))


def _short(types: str) -> str:
    """float64[2] for a C array of two axes, float64 x 3 for a tuple."""
    short = re.sub(r"Array\((\w+), (\d), 'C'[^)]*\)", r"\1[\2]", types)
    for _ in range(2):  # tuples of tuples
        short = re.sub(r"UniTuple\(([^(),]+), (\d)\)", r"\1 x \2", short)
    return short


def main(argv: Sequence[str] | None = None) -> int:
    """Run a scene with an empty cache in this process, which must not have loaded numba yet; print what it compiled."""
    description, remark = (__doc__ or "").split("\n\n", 1)
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks.compile_time", description=description, epilog=remark
    )
    parser.add_argument("scene", type=Path, nargs="?", default=SCENE, help="default: scenes/sphere.toml")
    parser.add_argument("--rows", type=int, default=30, help="how many functions to list")
    arguments = parser.parse_args(argv)
    if "numba" in sys.modules:
        raise RuntimeError("numba is loaded already: its cache can no longer be chosen")
    with TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = str(Path(folder, "cache"))
        start = perf_counter()
        functions = compiled(lambda: _run(arguments.scene, Path(folder, "run")))
        print(compilation_report(functions, perf_counter() - start, process_time(), arguments.rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
