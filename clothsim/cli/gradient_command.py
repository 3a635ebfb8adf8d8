"""`clothsim gradient`: derivatives of a loss of a run."""

import argparse
import sys
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from clothsim import __version__, load_scene
from clothsim.base.errors import InputError
from clothsim.base.safe_files.record import to_json
from clothsim.cli.loss_arguments import LOSSES, loss_of, words
from clothsim.engine import build, override, scene_file
from clothsim.gradients import full_path, traced

if TYPE_CHECKING:
    from clothsim.base.arrays import Floats
    from clothsim.gradients import Gradient

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


def _gradient(arguments: argparse.Namespace) -> int:
    names = words("--wrt", arguments.wrt)
    if arguments.output is not None and arguments.output.suffix != ".npz":
        raise InputError(f"{arguments.output} is no .npz file.", "Name one with -o.")
    scene = load_scene(scene_file(arguments.scene))
    for assignment in arguments.set:
        scene = override(scene, assignment)
    talk: IO[str] = sys.stderr if arguments.json else sys.stdout
    print(f"clothsim {__version__}: gradient {arguments.scene}", file=talk, flush=True)
    loss = loss_of(arguments.loss, build(scene).world)
    trace = traced(scene)
    gradient = trace.gradient(loss)
    derivatives = {name: gradient[full_path(name)] for name in names}
    if arguments.output is not None:
        _save(arguments.output, derivatives)
    if arguments.json:
        print(to_json({"loss": gradient.value, "gradient": derivatives, **_errors(gradient)}))
    print("\n".join(_lines(gradient, derivatives)), file=talk)
    return 0


def _errors(gradient: "Gradient") -> dict[str, float]:
    return {name: getattr(gradient, name) for name in ("newton_error", "time_error", "kappa_share")}


def _lines(gradient: "Gradient", derivatives: "dict[str, Floats]") -> list[str]:
    import numpy as np

    errors = _errors(gradient)
    lines = [note for note in gradient.run.session.notes if "held at" in note]
    lines.append(f"  {'loss':28} {gradient.value:.8g}, over {len(gradient.run.steps)} steps")
    for name, value in derivatives.items():
        if np.size(value) <= 3:
            text = ", ".join(f"{each:.6g}" for each in np.ravel(value))
        else:
            row = int(np.linalg.norm(value, axis=1).argmax())
            largest = ", ".join(f"{each:.4g}" for each in value[row])
            text = f"{len(value)} rows, the sum {np.linalg.norm(value.sum(axis=0)):.4g}, largest [{largest}] in {row}"
        lines.append(f"  d/d {name:24} {text}")
    lines.append(f"  {'unfinished solves':28} {errors['newton_error']:.2g} of the loss")
    if np.isfinite(errors["time_error"]):
        lines.append(f"  {'time steps':28} {errors['time_error']:.2g} of the loss")
    lines.append(f"  {'d/d log(contact stiffness)':28} {errors['kappa_share']:.2g}")
    return lines


def _save(file: Path, derivatives: "dict[str, Floats]") -> None:
    import numpy as np

    try:
        np.savez(file, **derivatives)  # type: ignore[arg-type]
    except OSError as error:
        raise InputError(f"{file} cannot be written ({error.strerror}).", "Choose another with -o.") from error
