"""`clothsim body`, `unpose` and `repose`: a body of given measures; garments in the rest pose of theirs."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine, files
from clothsim.base.errors import InputError
from clothsim.cli import on_demand
from clothsim.cli.arguments import add_output_options, add_overwrite, as_frame, as_length, refuse_output
from clothsim.cli.report import Report

if TYPE_CHECKING:
    from clothsim import MeasuredBody

_DESCRIPTION = """\
Make a body from measurements: the mannequin with proportions fitted to those given. The others follow its height.

  clothsim body --height 168cm --chest 96cm --waist 80cm --hips 104cm --inside-leg 76cm -o me.obj
  clothsim dress tunic --on me.obj --size 15mm           # a pattern on it
"""
OPTIONS = (
    ("height", "from the soles to the crown (default 1.7 m)"),
    ("neck", "neck girth"),
    ("shoulder_width", "between the shoulder joints"),
    ("chest", "chest or bust girth"),
    ("waist", "waist girth"),
    ("hips", "hip girth"),
    ("upper_arm", "upper arm girth"),
    ("arm_length", "from the shoulder joint to the wrist"),
    ("thigh", "thigh girth, under the crotch"),
    ("calf", "calf girth"),
    ("inside_leg", "from the ground to the crotch"),
    ("waist_height", "from the ground to the waist"),
)
"""Measures in the order in which they are printed; a test compares them with those of `clothsim.measured_body`."""
EXAMPLE = "96cm"
"""Of a measure, for the remedy."""
POSES = ("a", "t", "walk", "reach", "arms_down")
MET = 5e-4
"""Residual [m] below which a measure is met."""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    body = commands.add_parser("body", description=_DESCRIPTION)
    for name, meaning in OPTIONS:
        body.add_argument(f"--{name.replace('_', '-')}", metavar="LENGTH", help=meaning)
    body.add_argument("--pose", choices=POSES, default="a", help="of the arms and legs (default: a)")
    body.add_argument("-o", "--output", type=Path, metavar="FILE", required=True, help="an OBJ file, z up, in metres")
    add_overwrite(body)
    add_output_options(body, json="print measures, residuals and keys as JSON", handler=_body)
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


def _body(arguments: argparse.Namespace) -> Report:
    given = {name: getattr(arguments, name) for name, _ in OPTIONS}
    texts = {name: text for name, text in given.items() if text is not None}
    wanted = {name: as_length(f"--{name.replace('_', '-')}", text, EXAMPLE) for name, text in texts.items()}
    refuse_output(arguments.output, arguments)
    if arguments.output.suffix.lower() != ".obj":
        raise clothsim.InputError(f"{arguments.output} is not an OBJ file.", "Give it the ending .obj: -o me.obj.")
    made = clothsim.measured_body(**wanted)
    files.write_obj(arguments.output, *made.mesh(arguments.pose))
    document = {
        "measures": made.measures,
        "residuals": made.residuals,
        "keys": made.keys,
        "at_bounds": list(made.at_bounds),
        "file": str(arguments.output),
    }
    return Report(document, "\n".join(lines(made, arguments.output)))


def lines(made: "MeasuredBody", file: Path) -> list[str]:
    """The body in lines for the user: each measure, what is not met and why, the keys of a scene, the file."""
    out = ["measure         wanted    body [cm]"]
    for name, value in made.measures.items():
        given = made.wanted.get(name)
        left = "" if given is None or abs(value - given) < MET else f"   {100 * (value - given):+.1f}"
        out.append(
            f"{name.replace('_', ' '):14} {'' if given is None else f'{100 * given:.1f}':>7}  {100 * value:7.1f}{left}"
        )
    if any(abs(left) >= MET for left in made.residuals.values()):
        ends = ", ".join(made.at_bounds)
        out.append(
            f"Not all can be met: {ends or 'they exclude one another'}{' at the end of the range' * bool(ends)}."
        )
    keys = ", ".join(f"{name} = {value:g}" for name, value in made.keys.items())
    return [*out, f'In a scene: [[body]] mesh = "mannequin"{keys and ", " + keys}', str(file)]


_UNPOSE = """\
Bring the garments of every frame of a run to the rest pose of its body model.

  clothsim unpose walk -o canonical.npz
"""
_REPOSE = """\
Pose a canonical garment on the body model of a scene, at any time and in any shape: a start for a drape.

  clothsim repose canonical.npz other.toml -o shirt.obj --cloth shirt
"""


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
    try:
        time = float(arguments.time)
    except ValueError:
        time = math.nan
    if not math.isfinite(time):
        raise InputError(f"--time is {arguments.time!r}.", "Give a number of seconds.")
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


def _refuse_ending(path: Path, ending: str) -> None:
    if path.suffix.lower() != ending:
        raise InputError(f"{path.name} does not end in {ending}.", "Give the file that ending.")
