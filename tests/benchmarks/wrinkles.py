"""Wrinkles on coarse cloth (`clothsim wrinkle`) against the coarse run and the simulated fine one.

`python -m tests.benchmarks.wrinkles [CASE ...] [-o FOLDER] [--json FILE]`. Each case is simulated on a coarse mesh,
wrinkled, and simulated on the same finer mesh with all loads; the coarse one as it is, and with its membrane relaxed in
compression. Distances are between the same points of the cloth, the coarse run's on its flat triangles. A run that
starts 1e-6 m aside is the noise: what two simulated fine runs differ by. FOLDER keeps the runs, and a picture of three
side by side for each case.
"""

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import process_time

import numpy as np
from PIL import Image

import clothsim
from clothsim import Run, Scene
from clothsim.base.arrays import Floats
from clothsim.base.record import to_json
from clothsim.base.text import text_table
from clothsim.engine import build
from clothsim.garments.wrinkle.finer import Subdivision, subdivision
from clothsim.garments.wrinkled import finer_scene, wrinkle
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.mesh.generators.shapes import capsule

RELAXED = 0.05
"""effects.membrane.compression of the coarse run that is wrinkled."""
ASIDE = 1e-6
"""Displacement of the start of the twin of the fine run [m]."""


@dataclass(frozen=True)
class Case:
    """A scene, the parts of its edges, and the frame and view of its picture."""

    scene: Scene
    parts: int
    frame: int = -1
    view: tuple[float, float, float] = (0.3, -1.0, 0.6)


@dataclass(frozen=True)
class Row:
    """What one way gives: RMS and largest distance from the fine run [m], bending energy [J], CPU seconds, a verdict.

    height : float
        RMS distance along the normals alone [m].
    """

    case: str
    what: str
    vertices: int
    rms: float
    height: float
    largest: float
    bending: float
    seconds: float
    newton: int
    intersection_free: bool


def _effects(**others: Mapping[str, object]) -> dict[str, Mapping[str, object]]:
    own: dict[str, Mapping[str, object]] = {name: {} for name in ("inertia", "membrane", "bending", "self_contact")}
    return {**own, **others}


def twisted_sheet(cells: tuple[int, int] = (25, 10), seconds: float = 1.0) -> Scene:
    """A strip of cotton of 1 m whose ends turn against each other."""
    turning = [{"select": side, "motion": {"rotate_degrees_per_second": [turn, 0, 0]}}
               for side, turn in (("left", 180.0), ("right", -180.0))]  # fmt: skip
    return Scene(
        {"mesh": "rectangle", "size": [1.0, 0.4], "cells": list(cells)},
        effects=_effects(friction={}, pins={"group": turning}),
        solver={"dt": 0.02, "threads": 1},
        run={"duration": seconds},
    )


def bent(points: Floats, angle: float, blend: float) -> Floats:
    """Points (n, 3) of an arm along z with the elbow at 0: what is above it turned by `angle` [rad] about x."""
    part = np.clip(0.5 + points[:, 2] / blend, 0.0, 1.0)
    turn = angle * part * part * (3 - 2 * part)
    c, s = np.cos(turn), np.sin(turn)
    # The axis of the arm is an arc within the blend: the integral of its direction.
    z = np.linspace(-0.5, 0.5, 2001) * max(1.0, 2.1 * np.abs(points[:, 2]).max())
    q = np.clip(0.5 + z / blend, 0.0, 1.0)
    along = angle * q * q * (3 - 2 * q)
    axis = np.column_stack([-np.sin(along), np.cos(along)])
    axis = np.cumsum(0.5 * (axis[1:] + axis[:-1]) * np.diff(z)[:, None], axis=0)
    axis = np.vstack([[0.0, 0.0], axis])
    axis[:, 1] += z[0]  # below the elbow the arm stays
    y, up = (np.interp(points[:, 2], z, axis[:, k]) for k in range(2))
    return np.column_stack([points[:, 0], y + c * points[:, 1], up + s * points[:, 1]])


def sleeve(cells: tuple[int, int] = (16, 16), seconds: float = 1.0, degrees: float = 80.0) -> Scene:
    """A tube of cotton on an arm that bends at the elbow; its upper border is held."""
    arm, triangles = capsule(radius=0.042, height=0.62, segments=24)
    rate = 25.0
    times = np.arange(round(seconds * rate) + 1) / rate / seconds
    angles = np.radians(degrees) * times * times * (3 - 2 * times)
    frames = np.array([bent(arm, angle, 0.12) for angle in angles])
    return Scene(
        {"mesh": "tube", "radius": 0.055, "height": 0.34, "cells": list(cells), "fabric": "cotton"},
        clothsim.Body(arm, triangles, frames=frames, frames_per_second=rate, name="arm"),
        _effects(gravity={}, body_contact={}, friction={}, damping={"rate": 3.0}, pins={"select": "bottom"}),
        {"dt": 0.02, "threads": 1},
        run={"duration": seconds},
    )


def shirt(edge: float = 0.045, seconds: float = 0.6) -> Scene:
    """A shirt that falls onto the shoulders of the mannequin."""
    return Scene(
        {"name": "shirt", "mesh": "shirt", "edge": edge, "fabric": "cotton"},
        {"name": "mannequin", "mesh": "mannequin"},
        _effects(gravity={}, body_contact={}, friction={}, damping={"rate": 3.0}),
        {"dt": 0.02, "threads": 1},
        run={"duration": seconds},
    )


CASES = {
    "twisted sheet": lambda: Case(twisted_sheet(), 4, 22, (0.3, -1.0, 0.8)),
    "sleeve": lambda: Case(sleeve(), 4, -1, (1.0, 0.3, 0.2)),
    "shirt": lambda: Case(shirt(), 3, -1, (0.2, -1.0, 0.1)),
}


def measured(name: str, case: Case, folder: Path) -> list[Row]:
    """The rows of a case; its runs are left in `folder`."""
    plain, plain_seconds = _simulated(case.scene, folder / "coarse")
    keys = {**case.scene.effects["membrane"], "compression": RELAXED}
    relaxed_scene = replace(case.scene, effects={**case.scene.effects, "membrane": keys})
    relaxed, relaxed_seconds = _simulated(relaxed_scene, folder / "relaxed")
    world = build(case.scene).world
    finer = [subdivision(cloth.triangles, len(cloth.positions), case.parts) for cloth in world.cloths]
    fine_scene = _with_loads(finer_scene(plain, world, finer), case.scene)
    fine, fine_seconds = _simulated(fine_scene, folder / "fine")
    twin, twin_seconds = _simulated(_aside(fine_scene), folder / "twin")
    started = process_time()
    wrinkled = wrinkle(relaxed, case.parts, folder / "wrinkled", overwrite=True)
    seconds = process_time() - started
    return [
        _row(name, "fine", fine, fine, fine_seconds),
        _row(name, "fine, start 1e-6 m aside", twin, fine, twin_seconds),
        _row(name, "coarse", plain, fine, plain_seconds, finer),
        _row(name, "coarse, relaxed", relaxed, fine, relaxed_seconds, finer),
        _row(name, "wrinkled, with its coarse run", wrinkled, fine, seconds + relaxed_seconds),
    ]


def _simulated(scene: Scene, output: Path) -> tuple[Run, float]:
    started = process_time()
    run = clothsim.simulate(scene, output, overwrite=True)
    return run, process_time() - started


def _with_loads(finer: Scene, scene: Scene) -> Scene:
    """The finer cloth with all effects of the coarse scene, and its steps."""
    loads = {name: keys for name, keys in scene.effects.items() if name not in finer.effects}
    return replace(finer, effects={**finer.effects, **loads}, solver=scene.solver)


def _aside(scene: Scene) -> Scene:
    """The scene with a start that is noise of ASIDE away."""
    noise = np.random.default_rng(0)

    def moved(mesh: MeshArrays) -> MeshArrays:
        rest = mesh.vertices if mesh.rest is None else mesh.rest
        return replace(mesh, vertices=mesh.vertices + ASIDE * noise.normal(size=mesh.vertices.shape), rest=rest)

    return replace(scene, cloth=[{**cloth, "mesh": moved(cloth.mesh)} for cloth in scene.cloths])


def _row(case: str, what: str, run: Run, fine: Run, seconds: float, finer: Sequence[Subdivision] | None = None) -> Row:
    squares, normal, largest, energies = [], [], 0.0, []
    built = build(run.scene)
    for frame in range(1, min(len(run), len(fine))):
        x, own = fine.positions(frame), run.positions(frame)
        full = built.world.start()
        full[: len(own)] = own - built.world.origin
        energies.append(built.energies["bending"].value(full))
        if finer is not None:
            starts = np.cumsum([0, *(one.weights.shape[1] for one in finer)])
            own = np.concatenate([one.linear(own[a:b]) for one, a, b in zip(finer, starts, starts[1:], strict=False)])
        distances = np.linalg.norm(own - x, axis=1)
        a, b, c = x[fine.triangles].transpose(1, 0, 2)
        normals = np.zeros_like(x)
        for corner in range(3):
            np.add.at(normals, fine.triangles[:, corner], np.cross(b - a, c - a))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        squares.append(np.mean(distances**2))
        normal.append(np.mean(((own - x) * normals).sum(axis=1) ** 2))
        largest = max(largest, float(distances.max()))
    rms, height = float(np.sqrt(np.mean(squares))), float(np.sqrt(np.mean(normal)))
    free = run.intersection_free is True
    bending, count = float(np.mean(energies)), len(run.positions(0))
    return Row(case, what, count, rms, height, largest, bending, seconds, run.summary["newton_iterations"], free)


def side_by_side(folder: Path, case: Case, path: Path) -> None:
    """A picture of the coarse, the wrinkled and the fine run of a case."""
    size = (520, 460)
    runs = [clothsim.open_run(folder / name) for name in ("relaxed", "wrinkled", "fine")]
    pictures = [run.plot(case.frame, size=size, colour="plain", view=case.view, up="z") for run in runs]
    Image.fromarray(np.concatenate(pictures, axis=1)[:, :, :3]).save(path)


def table(rows: Sequence[Row]) -> str:
    """The rows as text."""
    head = "case", "run", "vertices", "RMS [mm]", "along normals [mm]", "bending [mJ]", "CPU s", "Newton", "free"
    cells = [
        (
            one.case,
            one.what,
            f"{one.vertices:,}",
            f"{1e3 * one.rms:.1f}",
            f"{1e3 * one.height:.1f}",
            f"{1e3 * one.bending:.3g}",
            f"{one.seconds:.0f}",
            str(one.newton),
            "yes" if one.intersection_free else "NO",
        )
        for one in rows
    ]
    return text_table(head, cells)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure the cases and print the table; 1 where a run intersects."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"of {', '.join(CASES)} (default: all)")
    parser.add_argument("-o", "--output", type=Path, help="keep runs and pictures in this folder")
    parser.add_argument("--json", type=Path, help="write the rows to this file")
    arguments = parser.parse_args(argv)
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as temporary:
        for name in arguments.cases or CASES:
            folder = (arguments.output or Path(temporary)) / name.replace(" ", "_")
            case = CASES[name]()
            rows += measured(name, case, folder)
            if arguments.output is not None:
                side_by_side(folder, case, arguments.output / f"{folder.name}.png")
            print(table(rows), flush=True)
    if arguments.json is not None:
        arguments.json.write_text(to_json([asdict(row) for row in rows]))
    return 0 if all(row.intersection_free for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
