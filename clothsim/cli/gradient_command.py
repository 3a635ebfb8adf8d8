"""`clothsim gradient`: derivatives of a loss of a run."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clothsim import engine, gradients
from clothsim.base.errors import InputError
from clothsim.base.file_writing import replacing
from clothsim.cli import on_demand
from clothsim.cli.arguments import (
    LOSSES,
    add_output_options,
    add_overwrite,
    add_set,
    loss_of,
    refuse_output,
    scene_of,
    words,
)
from clothsim.cli.report import Report, messages

if TYPE_CHECKING:
    from clothsim import Gradient
    from clothsim.base.arrays import Floats

_GRADIENT = """\
Run a scene and differentiate a loss of its last frame with respect to parameters, bodies and states. The error that the
solves leave in the loss is printed too. One run and one backward pass serve all names.

  clothsim gradient sphere --loss height --wrt youngs_modulus,body.ball.position
"""


def add_to(commands: Any) -> None:
    """Add the commands to the parser."""
    gradient = commands.add_parser("gradient", description=_GRADIENT)
    gradient.add_argument("scene", type=Path, metavar="SCENE", help="a scene file (TOML), or the name of an example")
    gradient.add_argument("--loss", required=True, metavar="LOSS", help=" | ".join(LOSSES))
    gradient.add_argument(
        "--wrt",
        required=True,
        action="append",
        metavar="NAMES",
        help="start, velocity, force, pins, body.NAME.position, youngs_modulus",
    )
    gradient.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the arrays (.npz)")
    add_set(gradient)
    add_overwrite(gradient)
    add_output_options(gradient, json="print JSON, the rest on stderr", handler=_gradient)


def _gradient(arguments: argparse.Namespace) -> Report:
    names = words("--wrt", ",".join(arguments.wrt))
    if arguments.output is not None and arguments.output.suffix != ".npz":
        raise InputError(f"{arguments.output} is not an .npz file.", "Name one with -o.")
    scene = scene_of(arguments)
    if arguments.output is not None:
        read = (arguments.scene, arguments.loss.partition("=")[2], *scene.files)
        refuse_output(arguments.output, arguments, *read)
    messages(arguments, arguments.scene)
    loss = loss_of(arguments.loss, engine.build(scene, affordable=True).world)
    trace = gradients.traced(scene)
    gradient = trace.gradient(loss)
    derivatives = {name: gradient[name] for name in names}
    if arguments.output is not None:
        with replacing(arguments.output) as beside, beside.open("wb") as target:
            on_demand.savez(target, **derivatives)  # type: ignore[arg-type]
    document = {
        "loss": gradient.value,
        "gradient": derivatives,
        "newton_error": gradient.newton_error,
        "log_kappa_sensitivity": gradient.log_kappa_sensitivity,
        "stiffness": trace.stiffness,
    }
    return Report(document, "\n".join(_lines(gradient, derivatives)), verdict=True)


def _lines(gradient: "Gradient", derivatives: "dict[str, Floats]") -> list[str]:
    lines = [note for note in gradient.run.session.notes if "held at" in note]
    lines.append(f"  {'loss':28} {gradient.value:.8g}, over {len(gradient.run.steps)} steps")
    for name, value in derivatives.items():
        if (value.ndim < 2 and value.size <= 3) or value.shape == (1, 3):
            text = ", ".join(f"{each:.6g}" for each in value.ravel())
        elif value.shape[1:] == (2,):  # of key frames: times [s] and values are no one sum
            times, values = (", ".join(f"{each:.4g}" for each in column) for column in value.T)
            text = f"of key frames: by times [{times}], by values [{values}]"
        else:
            row = int(on_demand.norm(value, axis=1).argmax())
            largest = ", ".join(f"{each:.4g}" for each in value[row])
            text = f"{len(value)} rows, the sum {on_demand.norm(value.sum(axis=0)):.4g}, largest [{largest}] in {row}"
        lines.append(f"  d/d {name:24} {text}")
    left = gradient.newton_error
    lines.append(f"  {'left by the solves':28} {f'{left:.2g} of the loss' if math.isfinite(left) else 'not known'}")
    lines.append(f"  {'d/d log(contact stiffness)':28} {gradient.log_kappa_sensitivity:.2g}")
    return lines
