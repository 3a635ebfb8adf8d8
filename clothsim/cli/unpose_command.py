"""`clothsim unpose` and `clothsim repose`: garments of a run in the rest pose of their body model, and back."""

import argparse
import math
from pathlib import Path
from typing import Any

import clothsim
from clothsim import engine, files
from clothsim.base.errors import InputError
from clothsim.cli import on_demand
from clothsim.cli.arguments import add_output_options, add_overwrite, as_frame, refuse_output
from clothsim.cli.report import Report

_UNPOSE = """\
Bring the garments of every frame of a run to the rest pose of its body model.

  clothsim unpose walk -o canonical.npz
"""
_REPOSE = """\
Pose a canonical garment on the body model of a scene, at any time and in any shape: a start for a drape.

  clothsim repose canonical.npz other.toml -o shirt.obj --cloth shirt
"""


def add_to(commands: Any) -> None:
    """Add the commands to the parser."""
    unpose = commands.add_parser("unpose", description=_UNPOSE)
    unpose.add_argument("directory", type=Path, metavar="DIR", help="the output of `clothsim run`, with a body model")
    unpose.add_argument("-o", "--output", type=Path, metavar="FILE", required=True, help="an .npz")
    unpose.add_argument("--field", action="store_true", help="weights that depend on the canonical position")
    add_overwrite(unpose)
    add_output_options(unpose, json="print frames, vertices and residuals as JSON", handler=_unpose)
    repose = commands.add_parser("repose", description=_REPOSE)
    repose.add_argument("file", type=Path, metavar="FILE", help="the output of `clothsim unpose`")
    repose.add_argument("scene", type=Path, metavar="SCENE", help="a scene with the same body model")
    repose.add_argument("-o", "--output", type=Path, metavar="OBJ", required=True, help="the garment")
    repose.add_argument("--cloth", metavar="NAME", help="which cloth, if there are several")
    repose.add_argument("--frame", default="last", metavar="N", help="0, 1, ... or last (default: last)")
    repose.add_argument("--time", default="0", metavar="S", help="time in the scene's motion [s] (default: 0)")
    add_overwrite(repose)
    add_output_options(repose, json="print vertices, those inside and depth as JSON", handler=_repose)


def _unpose(arguments: argparse.Namespace) -> Report:
    _refuse_ending(arguments.output, ".npz")
    directory = arguments.directory
    refuse_output(arguments.output, arguments, directory / files.CHECKPOINT_NAME)
    if not (directory / files.CHECKPOINT_NAME).is_file():
        raise InputError(f"{directory} is not a directory of a run (no {files.CHECKPOINT_NAME}).")
    run = clothsim.open_run(directory)
    made = on_demand.unposed(run, run.scene, arguments.field)
    on_demand.write_canonical(arguments.output, made)
    near = float((made.residuals <= 1e-3).mean())
    figures = {
        "file": str(arguments.output),
        "frames": len(made.times),
        "vertices": made.positions.shape[1],
        "worst_residual": float(made.residuals.max()),
        "within_1_mm": near,
    }
    return Report(
        figures,
        f"{arguments.output}: {len(made.times)} frames of {made.positions.shape[1]} vertices. Posed again, "
        f"{100 * near:.4g} % are within 1 mm, the worst within {1e3 * made.residuals.max():.3g} mm.",
    )


def _repose(arguments: argparse.Namespace) -> Report:
    _refuse_ending(arguments.output, ".obj")
    refuse_output(arguments.output, arguments, arguments.file, arguments.scene)
    scene = clothsim.load_scene(arguments.scene)
    refuse_output(arguments.output, arguments, *scene.files)
    made = on_demand.read_canonical(arguments.file)
    rows = made.rows_of(arguments.cloth)
    placed, _ = engine.character_of_scene(scene)
    time = _seconds(arguments.time)
    points = made.posed(as_frame(arguments.frame), placed.skinning(time, made.body))[rows]
    inside = (made.triangles >= rows.start).all(axis=1) & (made.triangles < rows.stop).all(axis=1)
    files.write_obj(arguments.output, points, made.triangles[inside] - rows.start)
    body = placed.character.vertices(placed.pose(time)) @ placed.linear.T + placed.shift
    found = on_demand.body_surface(body, placed.character.triangles).penetration(points)
    figures = {"file": str(arguments.output), "vertices": len(points)}
    text = (
        f"{arguments.output}: {len(points)} vertices, {found.count} of them inside the body, "
        f"the deepest by {1e3 * found.depth:.3g} mm."
    )
    if found.count:
        text += "\n  [seed] untangle = true, or `clothsim fit`, brings them out."
    return Report({**figures, "inside": int(found.count), "deepest": float(found.depth)}, text)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not math.isfinite(seconds):
        raise InputError(f"--time is {text!r}.", "Give a number of seconds.")
    return seconds


def _refuse_ending(path: Path, ending: str) -> None:
    if path.suffix.lower() != ending:
        raise InputError(f"{path.name} does not end in {ending}.", "Give the file that ending.")
