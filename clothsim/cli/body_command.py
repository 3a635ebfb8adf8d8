"""`clothsim body`: the mannequin with the measures of a person."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import files
from clothsim.cli.arguments import add_output_options, add_overwrite, as_length, refuse_output
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
