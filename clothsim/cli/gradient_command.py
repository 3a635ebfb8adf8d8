"""`clothsim gradient`: derivatives of a loss of a run."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine, gradients
from clothsim.base.errors import InputError
from clothsim.cli import on_demand
from clothsim.cli.loss_arguments import LOSSES, loss_of, words
from clothsim.cli.report import Report, messages

if TYPE_CHECKING:
    from clothsim import Gradient
    from clothsim.base.arrays import Floats

_DESCRIPTION = """\
Run a scene and derive a loss of its last frame by numbers, bodies and states, with what the solves and the time steps
cost the loss. One run and one pass back serve all names.

  clothsim gradient sphere --loss height --wrt youngs_modulus,body.ball.position --set effects.friction.eps_v=1e-3
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    gradient = commands.add_parser("gradient", description=_DESCRIPTION)
    gradient.add_argument("scene", type=Path, metavar="SCENE", help="a scene file (TOML), or the name of an example")
    gradient.add_argument("--loss", required=True, metavar="LOSS", help=" | ".join(LOSSES))
    gradient.add_argument(
        "--wrt", required=True, metavar="NAMES", help="start, velocity, force, pins, body.NAME.position, youngs_modulus"
    )
    gradient.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the arrays (.npz)")
    gradient.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change a key of the scene")
    gradient.add_argument("--json", action="store_true", help="print JSON, the rest on stderr")
    gradient.add_argument("--debug", action="store_true", help="show tracebacks")
    gradient.set_defaults(handler=_gradient)


def _gradient(arguments: argparse.Namespace) -> Report:
    names = words("--wrt", arguments.wrt)
    if arguments.output is not None and arguments.output.suffix != ".npz":
        raise InputError(f"{arguments.output} is no .npz file.", "Name one with -o.")
    scene = clothsim.load_scene(arguments.scene)
    for assignment in arguments.set:
        scene = engine.override(scene, assignment)
    messages(arguments, arguments.scene)
    loss = loss_of(arguments.loss, engine.build(scene).world)
    trace = gradients.traced(scene)
    gradient = trace.gradient(loss)
    derivatives = {name: gradient[name] for name in names}
    if arguments.output is not None:
        _save(arguments.output, derivatives)
    document = {"loss": gradient.value, "gradient": derivatives, **_errors(gradient)}
    return Report(document, "\n".join(_lines(gradient, derivatives)), verdict=True)


def _errors(gradient: "Gradient") -> dict[str, float]:
    return {name: getattr(gradient, name) for name in ("newton_error", "time_error", "kappa_share")}


def _lines(gradient: "Gradient", derivatives: "dict[str, Floats]") -> list[str]:
    errors = _errors(gradient)
    lines = [note for note in gradient.run.session.notes if "held at" in note]
    lines.append(f"  {'loss':28} {gradient.value:.8g}, over {len(gradient.run.steps)} steps")
    for name, value in derivatives.items():
        if value.size <= 3:
            text = ", ".join(f"{each:.6g}" for each in value.ravel())
        else:
            row = int(on_demand.norm(value, axis=1).argmax())
            largest = ", ".join(f"{each:.4g}" for each in value[row])
            text = f"{len(value)} rows, the sum {on_demand.norm(value.sum(axis=0)):.4g}, largest [{largest}] in {row}"
        lines.append(f"  d/d {name:24} {text}")
    lines.append(f"  {'unfinished solves':28} {errors['newton_error']:.2g} of the loss")
    if math.isfinite(errors["time_error"]):
        lines.append(f"  {'time steps':28} {errors['time_error']:.2g} of the loss")
    lines.append(f"  {'d/d log(contact stiffness)':28} {errors['kappa_share']:.2g}")
    return lines


def _save(file: Path, derivatives: "dict[str, Floats]") -> None:
    try:
        on_demand.savez(file, **derivatives)  # type: ignore[arg-type]
    except OSError as error:
        raise InputError(f"{file} cannot be written ({error.strerror}).", "Choose another with -o.") from error
