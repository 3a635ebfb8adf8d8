"""`clothsim gradient` and `clothsim recover`: derivatives of a loss of a run, and numbers of a scene from a drape."""

import argparse
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine, gradients
from clothsim.base.errors import InputError
from clothsim.base.file_writing import make_directory, refuse_replacing, write_atomically
from clothsim.cli import on_demand
from clothsim.cli.arguments import (
    LOSSES,
    add_output_options,
    add_overwrite,
    add_set,
    as_count,
    as_positive_number,
    assigned_number,
    loss_of,
    meshed,
    refuse_output,
    scene_of,
    words,
)
from clothsim.cli.report import Report, messages

if TYPE_CHECKING:
    from clothsim import Gradient
    from clothsim.base.arrays import Floats

_GRADIENT = """\
Run a scene and derive a loss of its last frame by numbers, bodies and states, with what the solves and the time steps
cost the loss. One run and one pass back serve all names.

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
    recover = commands.add_parser("recover", description=_RECOVER)
    recover.add_argument(
        "scene",
        type=Path,
        metavar="SCENE",
        help="a scene, an example, a run; outlines (.npz)",
    )
    recover.add_argument(
        "--target", type=Path, metavar="FILE", help="a drape: a mesh, points (.xyz), or a run's directory"
    )
    recover.add_argument("--free", metavar="NAMES", help="youngs_modulus,pattern.front.width")
    recover.add_argument("--prior", action="store_true", help="weigh bending with 618 measured fabrics")
    recover.add_argument("--test", choices=("cusick",), help="outlines of drapes")
    recover.add_argument("--pattern", type=Path, metavar="FILE", help="pattern.json of a cloth of arrays")
    recover.add_argument("--size", default="2cm", metavar="L", help="size that it was meshed with (default 2cm)")
    recover.add_argument("-o", "--output", type=Path, metavar="DIR", help="output directory (default: none)")
    recover.add_argument("--starts", default="2", metavar="N", help="starts of the search (default 2)")
    recover.add_argument("--scale", default="1", metavar="FACTOR", help="metres per unit of the target")
    add_set(recover)
    add_overwrite(recover, "replace an earlier run in the output directory")
    add_output_options(
        recover, json="print recovery.json, the rest on stderr", quiet="print the end only", handler=_recover
    )


def _gradient(arguments: argparse.Namespace) -> Report:
    names = words("--wrt", ",".join(arguments.wrt))
    if arguments.output is not None and arguments.output.suffix != ".npz":
        raise InputError(f"{arguments.output} is no .npz file.", "Name one with -o.")
    scene = scene_of(arguments)
    if arguments.output is not None:
        refuse_output(arguments.output, arguments, arguments.scene, arguments.loss.partition("=")[2])
    messages(arguments, arguments.scene)
    loss = loss_of(arguments.loss, engine.build(scene, affordable=True).world)
    trace = gradients.traced(scene)
    gradient = trace.gradient(loss)
    derivatives = {name: gradient[name] for name in names}
    if arguments.output is not None:
        _save(arguments.output, derivatives)
    document = {"loss": gradient.value, "gradient": derivatives, **_errors(gradient), "stiffness": trace.stiffness}
    return Report(document, "\n".join(_lines(gradient, derivatives)), verdict=True)


def _errors(gradient: "Gradient") -> dict[str, float | None]:
    """What solves and contact stiffness cost the loss; None: not known."""
    return {name: finite(getattr(gradient, name)) for name in ("newton_error", "log_kappa_sensitivity")}


def _lines(gradient: "Gradient", derivatives: "dict[str, Floats]") -> list[str]:
    errors = _errors(gradient)
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
    left = errors["newton_error"]
    lines.append(f"  {'left by the solves':28} {'not known' if left is None else f'{left:.2g} of the loss'}")
    lines.append(f"  {'d/d log(contact stiffness)':28} {errors['log_kappa_sensitivity']:.2g}")
    return lines


def _save(file: Path, derivatives: "dict[str, Floats]") -> None:
    try:
        on_demand.savez(file, **derivatives)  # type: ignore[arg-type]
    except OSError as error:
        raise InputError(f"{file} cannot be written ({error.strerror}).", "Choose another with -o.") from error


RECOVERY_NAME = "recovery.json"

_RECOVER = """\
Find the numbers of a scene, of its fabric or of its pattern (pattern.front.width), for which it hangs as a target does,
with standard errors and what the target does not tell. With -o the recovered run and recovery.json are left there.

  clothsim recover scene.toml --target drape.obj --free youngs_modulus,bending_stiffness -o recovered
  clothsim recover --test cusick outlines.npz --set density=0.15 --prior
"""


def _recover(arguments: argparse.Namespace) -> Report:
    if arguments.test is not None:
        return _recover_drape(arguments)
    for name in ("target", "free"):
        if getattr(arguments, name) is None:
            raise InputError(f"recover needs --{name}.", "Or give outlines with --test cusick.")
    free, starts = words("--free", arguments.free), as_count("--starts", arguments.starts)
    scale = as_positive_number("--scale", arguments.scale)
    if not arguments.target.exists():
        raise InputError(f"There is no {arguments.target}.", "Name a mesh, an .xyz file or a run with --target.")
    scene = scene_of(arguments, or_run=True)
    if arguments.output is not None:
        inputs = (arguments.scene, scene, arguments.target, arguments.pattern)
        engine.refuse_earlier_run(arguments.output, arguments.overwrite, (RECOVERY_NAME,), inputs)
    messages(arguments, f"{', '.join(free)} of {arguments.scene}")
    loss = gradients.named_loss("target", engine.build(scene, affordable=True).world, arguments.target, scale)
    pattern = None if arguments.pattern is None else meshed(arguments.pattern, arguments.size)
    found = clothsim.recover(
        scene,
        loss,
        free,
        starts,
        None
        if arguments.quiet
        else lambda start, each: _shown(
            f"start {start} of {starts}", each.values, each.failure or f"loss {each.loss:.4g}"
        ),
        pattern=pattern,
        prior=arguments.prior,
    )
    content = summary(found, type(loss).__name__)
    code = 0 if found.best.intersecting_pairs == 0 else 1
    if arguments.output is not None:
        run = clothsim.simulate(found.scene, arguments.output, overwrite=arguments.overwrite)
        code = code if run.status == "completed" else 1
        (arguments.output / RECOVERY_NAME).write_text(on_demand.to_json(content), encoding="utf-8")
    return Report(content, "\n".join(lines(found, arguments.output)), code, verdict=True)


def _recover_drape(arguments: argparse.Namespace) -> Report:
    """D/(rho g) and curl from outlines of a drape tester."""
    for name in ("target", "free", "pattern"):
        if getattr(arguments, name) is not None:
            raise InputError(f"--{name} has no effect with --test.", "The outlines are the target; leave it out.")
    outlines = on_demand.read_outlines(arguments.scene)
    own = dict(assigned_number(text) for text in arguments.set)
    if arguments.output is not None:
        refuse_replacing([arguments.output / RECOVERY_NAME], arguments.overwrite)
    message = messages(arguments, f"{len(outlines[0])} outlines of {arguments.scene}")
    found = on_demand.recover_drape(*outlines, own, arguments.prior, message=message)
    lines = found.text()
    if arguments.output is not None:
        make_directory(arguments.output)
        write_atomically(arguments.output / RECOVERY_NAME, on_demand.to_json(found.document()).encode())
        lines += f"\n  files     {arguments.output}: {RECOVERY_NAME}"
    return Report(found.document(), lines, verdict=True)


def finite(error: float) -> float | None:
    """An error as JSON has it: null where it is infinite or not known."""
    return error if math.isfinite(error) else None


def _shown(start: str, values: Mapping[str, float], state: str) -> None:
    numbers = ", ".join(f"{path} {value:.4g}" for path, value in values.items())
    print(f"{start}: {numbers}: {state}", file=sys.stderr, flush=True)


def summary(found: "clothsim.Recovery", loss: str) -> dict[str, Any]:
    """Return the content of recovery.json; errors that are infinite or not known are null."""
    return {
        "values": dict(found.values),
        "relative_errors": {path: finite(error) for path, error in found.errors.items()},
        "ratios": [
            {"first": each.first, "second": each.second, "value": each.value, "relative_error": finite(each.error)}
            for each in found.ratios
        ],
        "undetermined": [dict(weights) for weights in found.undetermined],
        "at_limit": list(found.at_limit),
        "loss": {"name": loss, "value": found.best.loss, "of_starts": list(found.minima)},
        "newton_error": finite(found.best.newton_error),
        "intersecting_pairs": found.best.intersecting_pairs,
        "runs": found.runs,
        **({"prior": found.prior} if found.prior else {}),
    }


def lines(found: "clothsim.Recovery", directory: Path | None) -> list[str]:
    """Return the result in lines for the user."""
    out = [f"  {path:32} {value:.6g} {_error(found.errors[path])}" for path, value in found.values.items()]
    out += [f"  {each.first} / {each.second}: {each.value:.6g} {_error(each.error)}" for each in found.ratios]
    for weights in found.undetermined:
        moves = " ".join(f"{path}^{weight:+.2f}" for path, weight in weights.items() if abs(weight) > 0.05)
        out.append(f"  The target says nothing of {moves}.")
    out += [f"  {path} is at the end of the range that was searched." for path in found.at_limit]
    out += [f"  prior: {found.prior}."] if found.prior else []
    others = ", ".join(f"{each:.4g}" for each in found.minima)
    out.append(f"  loss {found.best.loss:.4g} after {found.runs} runs (by starts: {others})")
    if found.best.intersecting_pairs:
        out.append(f"  {found.best.intersecting_pairs} pairs of triangles intersect in the last state.")
    return out if directory is None else [*out, f"  files     {directory}: {RECOVERY_NAME} and the run"]


def _error(error: float) -> str:
    if math.isnan(error):
        return "(no standard error: the loss is no sum of squares, or a run beside the minimum failed)"
    return f"+- {100 * error:.2g} %" if math.isfinite(error) else "(not determined by the target)"
