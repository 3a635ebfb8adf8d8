"""Simulators at equal error: `python -m tests.benchmarks.peers.equal_error [--peer NAME=PYTHON ...] [--cells 40 100]`.

A sheet falls on a ball without friction, at four time steps. The error is the RMS distance over the vertices to a
reference of the simulator's own model: the same simulator at a far shorter step. The doubt of a reference is its
distance to a run with twice its step. clothsim always runs; `--peer mujoco=/path/to/python` adds a simulator with the
Python that has its package. Runs are stored in the folder `--output`, and a run that is there is not repeated; `--docs`
writes the table and the picture of the page.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from tests.benchmarks.peers.__main__ import pairs, simulated
from tests.benchmarks.peers.peer_scene import PeerScene
from tests.benchmarks.peers.shared_sheet import shared_sheet
from tests.benchmarks.stepping import ratios_at_equal_cost
from tests.benchmarks.stored_tables import markdown_table, when, write_between

DOCS = Path(__file__).parents[3] / "docs"
TIMES: Mapping[int, tuple[float, ...]] = {40: (0.14,), 100: (0.14, 0.2)}
"""Times at which errors are compared [s], by cells along an edge."""
DTS = (0.02, 0.01, 0.005, 0.0025)
FINE: Mapping[str, Any] = {"solver": {"tolerance": 1e-3}}


@dataclass(frozen=True)
class Program:
    """A simulator and its settings, fixed before the first results.

    Parameters
    ----------
    name : str
        Of its row.
    peer : str
        Its entry of `__main__.PEERS`.
    options : mapping
        Of the peer's `build`.
    finest : float
        dt of its reference [s].
    fine : mapping or None
        Options of the reference; None: those of the runs.
    model : str
        Program whose reference it shares; "" for one of its own.
    """

    name: str
    peer: str
    options: Mapping[str, Any] = field(default_factory=dict)
    finest: float = DTS[-1] / 4
    fine: Mapping[str, Any] | None = None
    model: str = ""


BASE = "clothsim"
PROGRAMS = (
    Program(BASE, "clothsim", {"solver": {}}, fine=FINE),
    Program("clothsim, backward Euler", "clothsim", {"solver": {"integrator": "backward_euler"}}, model=BASE),
    Program("MuJoCo", "mujoco", finest=DTS[-1] / 8),
    Program("Newton, Style3D", "newton-style3d"),
    Program("Blender, quality 5", "blender"),
    Program("SuperDex", "superdex"),
)
"""Rows of the table. clothsim has an isotropic sheet with hinges, as the peers have, and its default solver."""
HEADER = (
    *("cells, time", "simulator", "doubt of its reference"),
    *(f"dt {dt:g} s" for dt in DTS),
    *("CPU s at equal error, over clothsim", "reference to clothsim's", "energy, and of the reference [mJ]"),
    "frames with an intersection",
)


@dataclass(frozen=True)
class Run:
    """What was seen at each step of a run.

    times [s], cpu since the start [s], energies [J], frames (k, n, 3) [m], intersecting (k,) or empty where the frames
    were not checked; settings, notes, version and date in words.
    """

    times: Floats
    cpu: Floats
    energies: Floats
    frames: Floats
    intersecting: Floats
    words: tuple[str, ...]

    def at(self, time: float) -> int:
        """Number of the step that ends at `time` [s]."""
        return int(np.argmin(np.abs(self.times - time)))


@dataclass(frozen=True)
class Row:
    """A simulator at one time: points (dt, CPU s, own error, error to clothsim's reference [mm], energy [mJ])."""

    program: str
    points: tuple[tuple[float, float, float, float, float], ...]
    doubt: float
    to_base: float
    energy: float
    bad: int
    checked: int


def scene_at(cells: int, dt: float) -> PeerScene:
    """The frictionless sheet with that time step, up to the last of TIMES."""
    return shared_sheet(cells, TIMES[cells][-1], dt, friction=0.0)


def run_of(program: Program, cells: int, dt: float, python: str, folder: Path, reference: bool = False) -> Run:
    """The stored run of a program, or a new one; the frames of a reference are not checked."""
    label = "".join(letter for letter in program.name.lower() if letter.isalnum())
    file = folder / f"{cells}-{label}-{dt:g}{'-reference' if reference else ''}.npz"
    if not file.is_file():
        scene = scene_at(cells, dt)
        given = program.fine if reference and program.fine is not None else program.options
        result, steps = simulated(program.peer, scene, python, given)
        checked = () if reference else [any(pairs(scene, frame)) for frame in steps["frames"]]
        words = [result[key] for key in ("settings", "notes", "version")] + [date.today().isoformat()]
        folder.mkdir(parents=True, exist_ok=True)
        times = dt * np.arange(1, scene.steps + 1)
        every = np.array([np.argmin(np.abs(times - time)) for time in np.arange(0.02, times[-1] + 1e-9, 0.02)])
        np.savez(
            file,
            times=times[every],
            cpu=steps["cpu"][every],
            energies=steps["energies"][every],
            frames=steps["frames"][every],
            intersecting=np.array(checked, bool),
            words=np.array(words),
        )
        print(f"{program.name}, {cells} cells, dt {dt:g} s: {steps['cpu'][-1]:.2f} CPU s; {words}", file=sys.stderr)
    with np.load(file) as stored:
        columns = {name: stored[name] for name in ("times", "cpu", "energies", "frames", "intersecting")}
        return Run(**columns, words=tuple(map(str, stored["words"])))


def distance(one: Run, other: Run, time: float) -> float:
    """RMS distance over the vertices at a time [mm]."""
    difference = one.frames[one.at(time)] - other.frames[other.at(time)]
    return float(1e3 * np.sqrt((difference**2).sum(axis=1).mean()))


def row_at(program: Program, time: float, runs: Mapping[float, Run], own: Sequence[Run], base: Run) -> Row:
    """A row, from the runs by dt, the reference and the run with twice its dt, and clothsim's reference."""
    points = []
    for dt, run in runs.items():
        k = run.at(time)
        errors = distance(run, own[0], time), distance(run, base, time)
        points.append((dt, float(run.cpu[k]), *errors, float(1e3 * run.energies[k])))
    parts = [run.intersecting[: round(time / dt)] for dt, run in runs.items()]
    energy = float(1e3 * own[0].energies[own[0].at(time)])
    doubt, to_base = distance(own[0], own[1], time), distance(own[0], base, time)
    bad, checked = (sum(map(count, parts)) for count in (np.count_nonzero, len))
    return Row(program.name, tuple(points), doubt, to_base, energy, bad, checked)


def cost_ratios(row: Row, base: Row) -> Floats:
    """CPU of `row` over that of `base` at each error that both reach by their own references; empty where none is."""
    one, other = ([(error, cpu) for _, cpu, error, _, _ in each.points] for each in (row, base))
    return ratios_at_equal_cost(one, other)


def line(where: str, row: Row, base: Row) -> list[str]:
    """Cells of a row of the table."""
    ratios = cost_ratios(row, base)
    ends = sorted({f"{ratios.min():.2g}", f"{ratios.max():.2g}"}, key=float) if len(ratios) else []
    energies = [point[-1] for point in row.points] + [row.energy]
    unknown = np.isnan(energies).any()
    return [
        where,
        row.program,
        f"{row.doubt:.2g}",
        *(f"{own:.2g} ({common:.2g}), {cpu:.2f}" for _, cpu, own, common, _ in row.points),
        "1" if row.program == base.program else " to ".join(ends) or "no common error",
        f"{row.to_base:.2g}",
        "no velocities" if unknown else " / ".join(f"{energy:.0f}" for energy in energies),
        f"{row.bad} of {row.checked}",
    ]


def rows_of(cells: int, pythons: Mapping[str, str], folder: Path) -> dict[float, list[Row]]:
    """Rows by time of every program that a Python is given for."""
    taken = [program for program in PROGRAMS if program.peer in pythons]
    found: dict[float, list[Row]] = {time: [] for time in TIMES[cells]}
    references: dict[str, list[Run]] = {}
    for program in taken:
        python = pythons[program.peer]
        if not program.model:
            steps = (program.finest, 2 * program.finest)
            references[program.name] = [run_of(program, cells, dt, python, folder, True) for dt in steps]
        runs = {dt: run_of(program, cells, dt, python, folder) for dt in DTS}
        for time, rows in found.items():
            own = references[program.model or program.name]
            rows.append(row_at(program, time, runs, own, references[BASE][0]))
    return found


def page_of(found: Mapping[tuple[int, float], Sequence[Row]], days: str) -> str:
    """The table, Markdown."""
    lines = [
        line(f"{cells} x {cells}, {time:g} s", row, rows[0]) for (cells, time), rows in found.items() for row in rows
    ]
    return f"Measured on {days}.\n\n{markdown_table(HEADER, lines)}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is missing; print the table, or write it into the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peer", nargs="+", default=[], metavar="NAME=PYTHON", help="simulators, and their Pythons")
    parser.add_argument("--cells", nargs="+", type=int, default=list(TIMES), choices=TIMES)
    parser.add_argument("-o", "--output", type=Path, default=Path("results/peers"), help="folder for the runs")
    parser.add_argument("--docs", action="store_true", help="write docs/results/performance.md and its picture")
    given = parser.parse_args(arguments)
    known = {program.peer for program in PROGRAMS}
    pythons = {"clothsim": sys.executable, **dict(each.split("=", 1) for each in given.peer)}
    if unknown := sorted(set(pythons) - known):
        parser.error(f"--peer: there is no {', '.join(unknown)}. Known: {', '.join(sorted(known))}.")
    found: dict[tuple[int, float], Sequence[Row]] = {}
    try:
        for cells in given.cells:
            found |= {(cells, time): rows for time, rows in rows_of(cells, pythons, given.output).items()}
    except ClothsimError as error:
        print(error, file=sys.stderr)
        return 2
    days = {str(np.load(file)["words"][-1]) for file in given.output.glob("*.npz")}
    text = page_of(found, when(days))
    print(text)
    if given.docs:
        from tests.benchmarks.peers.equal_error_picture import draw

        write_between(DOCS / "results" / "performance.md", "peers", text)
        draw(found, DOCS / "pictures" / "peers.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
