"""Clips authored from two edited frames, against what the edit truly makes of the clip.

`python -m tests.benchmarks.author [EDIT ...] [--walk] [--cells N] [--free NAMES] [-o FOLDER] [--json FILE] [--small]`.
A sheet that hangs from its upper edge is struck by a ball: 60 frames, of which two, 3 %, are the keys; with `--walk` a
shirt on a walking body, 52 frames (`tests.benchmarks.author_walk`). The truth of each edit is a run of its own, of
which the author sees the keys alone: a fabric four times as stiff; a hem 5 % longer, the change within the lowest
quarter; a pleat, two creases that the rest shape has not. Errors are root mean squares over the vertices and the frames
that are no keys. Runs that the folder has already are taken from it.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np

import clothsim
from clothsim import Authored, Run, Scene
from clothsim.base.record import to_json
from clothsim.base.text import text_table
from clothsim.garments.author import edited_frames, targets
from clothsim.garments.floor import floor_of, scene_of_arrays
from tests.benchmarks.author_walk import WalkingShirt

YOUNG, BENDING, SIZE = 1e5, 2e-5, 0.5
"""Of the sheet [Pa], [N m], [m]."""


@dataclass(frozen=True)
class Row:
    """Error of one way in frames that are no keys, and at the keys [m]; CPU seconds, runs, and the exact verdict."""

    edit: str
    what: str
    error: float
    at_keys: float
    seconds: float
    runs: int
    intersection_free: bool | None


@dataclass(frozen=True)
class Clip:
    """A sheet and its keys: cells along a side, duration [s], frames."""

    cells: int = 7
    duration: float = 1.2
    keys: tuple[int, ...] = (25, 50)

    def scene(self, stiffer: float = 1.0) -> Scene:
        """The sheet and the ball; stiffer: factor on the fabric."""
        cloth = {
            "name": "sheet",
            "mesh": "rectangle",
            "size": [SIZE, SIZE],
            "cells": [self.cells, self.cells],
            "rotation_degrees": [90, 0, 0],
            "density": 0.15,
            "youngs_modulus": stiffer * YOUNG,
            "bending_stiffness": stiffer * BENDING,
        }
        ball = {
            "name": "ball",
            "mesh": "sphere",
            "radius": 0.1,
            "subdivisions": 2,
            "position": [0.05, -0.16, -0.08],
            "motion": {"velocity": [0.0, 0.25, 0.0]},
        }
        effects = {name: {} for name in ("inertia", "membrane", "bending", "gravity", "body_contact", "self_contact")}
        effects |= {"damping": {"rate": 1.5}, "friction": {"coefficient": 0.2}, "pins": {"select": "top"}}
        solver = {"dt": 0.02, "threads": 1, "tolerance": 1e-4}
        return Scene(cloth, ball, effects, solver, run={"duration": self.duration, "frames_per_second": 50})

    def longer_hem(self) -> Scene:
        """The rest shape 5 % wider at the hem."""
        scene = scene_of_arrays(self.scene())
        arrays = scene.cloths[0].mesh
        rest = arrays.rest.copy()
        quarter = rest[:, 1].min() + SIZE / 4
        rest[:, 0] *= 1 + 0.05 * np.clip((quarter - rest[:, 1]) / (SIZE / 4), 0, 1)
        return replace(scene, cloth=[{**scene.cloths[0], "mesh": replace(arrays, rest=rest)}])

    def pleat(self) -> Scene:
        """Two creases from the hem to near the pins."""
        scene, side = self.scene(), SIZE / self.cells
        lines = [((-1.5 + k) * side, angle) for k, angle in enumerate((100.0, -100.0))]
        creases = [{"through": [[x, -SIZE / 2, 0], [x, 0.3 * SIZE, 0]], "angle_degrees": angle} for x, angle in lines]
        return replace(scene, effects={**scene.effects, "rest_angle": {"crease": creases}})


EDITS: dict[str, Callable[[Clip | WalkingShirt], Scene]] = {
    "fabric x 4": lambda clip: clip.scene(4.0),
    "hem 5 % longer": lambda clip: clip.longer_hem(),
    "pleat": lambda clip: clip.pleat(),
}


def measured(
    edit: str, clip: Clip | WalkingShirt, folder: Path, free: Sequence[str] = ()
) -> tuple[list[Row], Authored]:
    """The rows of an edit, and what the full form found; runs are left in `folder`."""
    run, truth = (
        _simulated(scene, folder / name) for scene, name in ((clip.scene(), "run"), (EDITS[edit](clip), edit))
    )
    keys = {frame: truth.positions(frame) for frame in clip.keys}
    frames = [_frames(each) for each in (run, truth)]

    def row(what: str, positions: Sequence[np.ndarray], seconds: float, runs: int, free: bool | None) -> Row:
        squares = np.array([((a - b) ** 2).sum(axis=1).mean() for a, b in zip(positions, frames[1], strict=True)])
        others = [k for k in range(1, len(squares)) if k not in clip.keys]
        errors = (float(np.sqrt(squares[list(each)].mean())) for each in (others, clip.keys))
        return Row(edit, what, *errors, seconds, runs, free)

    started = process_time()
    start, stop = floor_of(run).rms(set(clip.keys))
    seconds = process_time() - started
    rows = [
        Row(edit, "twin, start 1e-6 m aside", start, float("nan"), seconds, 1, None),
        Row(edit, "twin, a tenth of the stop", stop, float("nan"), seconds, 1, None),
        row("unedited run", frames[0], 0.0, 1, run.intersection_free),
    ]
    edited = edited_frames(run, keys)
    spaces = ("world", "canonical") if any("model" in each.as_table() for each in run.scene.bodies) else ("world",)
    rows += [row(f"offsets in {space} space", targets(run, edited, space), 0.0, 0, None) for space in spaces]
    started = process_time()
    quick = clothsim.author(run, keys, folder / f"{edit} quick", quick=True).run
    rows.append(row("quick", _frames(quick), process_time() - started, 1, quick.intersection_free))
    started = process_time()
    found = clothsim.author(run, keys, folder / f"{edit} authored", free=free)
    seconds, recovery = process_time() - started, found.recovery
    if recovery.rest is not None:
        numbers = _simulated(recovery.scene_of_numbers, folder / f"{edit} numbers")
        rows.append(row("numbers", _frames(numbers), float("nan"), recovery.runs, numbers.intersection_free))
    what = "numbers" if recovery.rest is None else "numbers, rest shape"
    rows.append(row(what, _frames(found.run), seconds, recovery.runs, found.run.intersection_free))
    followed = clothsim.author(found.run, keys, folder / f"{edit} followed", quick=True, floor=False).run
    rows.append(row("the same, then quick", _frames(followed), float("nan"), 1, followed.intersection_free))
    return rows, found


def _frames(run: Run) -> list[np.ndarray]:
    return [run.positions(k) for k in range(len(run))]


def _simulated(scene: Scene, output: Path) -> Run:
    if output.exists():
        return clothsim.open_run(output)
    return clothsim.simulate(scene, output)


def report(rows: Sequence[Row]) -> str:
    """The table in mm."""
    header = ["edit", "", "other frames", "at keys", "CPU s", "runs", "free"]
    verdict = {True: "yes", False: "NO", None: "-"}
    lines = [
        [
            row.edit,
            row.what,
            f"{1e3 * row.error:.3g}",
            "-" if np.isnan(row.at_keys) else f"{1e3 * row.at_keys:.3g}",
            "-" if np.isnan(row.seconds) else f"{row.seconds:.0f}",
            str(row.runs),
            verdict[row.intersection_free],
        ]
        for row in rows
    ]
    return text_table(header, lines)


def main(arguments: Sequence[str]) -> int:
    """The table of the edits that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("edits", nargs="*", choices=[*EDITS, []], metavar="EDIT")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--cells", type=int, default=Clip.cells, help="along a side of the sheet, odd (default 7)")
    parser.add_argument("--walk", action="store_true", help="a shirt on a walking body in place of the sheet")
    parser.add_argument("--free", default="", help="numbers that may explain the edits (default: all)")
    parser.add_argument("--small", action="store_true", help="a coarser and shorter sheet, two numbers of the fabric")
    given = parser.parse_args(arguments)
    small = Clip(4, 0.6, (12, 25)) if given.small else Clip(given.cells)
    clip = WalkingShirt() if given.walk else small
    free = ["stretch", "bending"] if given.small else [name for name in given.free.split(",") if name]
    rows: list[Row] = []
    with TemporaryDirectory() as own:
        folder = given.output or Path(own)
        for edit in given.edits or (["fabric x 4"] if given.small else EDITS):
            found, authored = measured(edit, clip, folder, free)
            rows += found
            print(report(found), flush=True)
            print(to_json(authored.as_json().get("explained", {})), flush=True)
    if given.json is not None:
        given.json.write_text(to_json([asdict(row) for row in rows]))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
