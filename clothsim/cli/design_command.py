"""`clothsim design` and `gradient`: a pattern whose garment hangs as wished; derivatives of a loss of a run."""

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine, gradients
from clothsim.base.errors import InputError
from clothsim.base.file_writing import replacing, write_atomically
from clothsim.cli import on_demand
from clothsim.cli.arguments import (
    LOSSES,
    add_output_options,
    add_overwrite,
    add_set,
    as_count,
    as_positive_number,
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
Run a scene and differentiate a loss of its last frame with respect to parameters, bodies and states. The error that the
solves leave in the loss is printed too. One run and one backward pass serve all names.

  clothsim gradient sphere --loss height --wrt youngs_modulus,body.ball.position
"""


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


DESIGN_NAME = "design.json"

_DESCRIPTION = """\
Find parameters of a pattern so that the garment hangs as you wish, by runs with gradients from a fixed start. With -o,
the run of the garment and design.json are written into a directory.

  clothsim design skirt.toml --hem front.0+back.0=0.55 --girth 0.6=1.1 --stretch 1.03 \\
      --free pattern.front+back.height,pattern.front.edge[0].control[0].y,pattern.front.edge[0].control[1].y -o designed
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    design = commands.add_parser(
        "design",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    design.add_argument(
        "scene", type=Path, metavar="SCENE", help="a scene file (TOML), an example, or the directory of a run"
    )
    design.add_argument("--free", required=True, metavar="NAMES", help="pattern.front.height,pattern.front.vertex[0].y")
    design.add_argument(
        "--hem", metavar="EDGES=HEIGHT", help="edges of panels at a height [m], such as front.0+back.0=0.55"
    )
    design.add_argument("--girth", metavar="HEIGHT=LENGTH", help="girth at a height [m]")
    design.add_argument("--silhouette", metavar="AREA", help="area of the shadow on the ground [m2]")
    design.add_argument("--stretch", metavar="BOUND", help="largest stretch, such as 1.03")
    design.add_argument(
        "--tolerance", default="1e-3", metavar="L", help="tolerance of hem and girth [m] (default 1e-3)"
    )
    design.add_argument("--area", metavar="AREA", help="bound on the area of the fabric [m2]")
    design.add_argument("--symmetric", action="store_true", help="move points as mirror images in each panel")
    design.add_argument("--runs", default="40", metavar="N", help="bound on the runs (default 40)")
    design.add_argument("--pattern", type=Path, metavar="FILE", help="pattern of a cloth of arrays")
    design.add_argument("--size", default="2cm", metavar="L", help="mesh size of that pattern (default 2cm)")
    design.add_argument("-o", "--output", type=Path, metavar="DIR", help="output directory (default: none)")
    add_set(design)
    add_overwrite(design, "replace an earlier run in the output directory")
    add_output_options(
        design, json="print design.json, the rest on stderr", quiet="print only the result", handler=_design
    )
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


def _design(arguments: argparse.Namespace) -> Report:
    free, runs = words("--free", arguments.free), as_count("--runs", arguments.runs)
    area = None if arguments.area is None else as_positive_number("--area", arguments.area)
    scene = scene_of(arguments, or_run=True)
    if arguments.output is not None:
        inputs = (arguments.scene, scene, arguments.pattern)
        engine.refuse_earlier_run(arguments.output, arguments.overwrite, (DESIGN_NAME,), inputs)
    pattern = None if arguments.pattern is None else meshed(arguments.pattern, arguments.size, scene)
    given: dict[str, Any] = {}
    if arguments.hem is not None:
        names, height = _pair("--hem", arguments.hem, "front.0+back.0=0.55")
        edges: list[tuple[str, int]] = []
        for name in names.split("+"):
            panel, _, number = name.strip().rpartition(".")
            if not panel or not number.isdigit():
                raise InputError(f"--hem names {name!r}.", "Write PANEL.EDGE, such as front.0; edges count from 0.")
            edges.append((panel, int(number)))
        given["hem"] = edges, _number("--hem", height)
    if arguments.girth is not None:
        height, length = _pair("--girth", arguments.girth, "0.6=1.1")
        given["girth"] = _number("--girth", height), as_positive_number("--girth", length)
    for name in ("silhouette", "stretch"):
        if getattr(arguments, name) is not None:
            given[name] = as_positive_number(f"--{name}", getattr(arguments, name))
    if not given:
        raise InputError("There is nothing to design for.", "Give --hem, --girth, --silhouette or --stretch.")
    tolerance = as_positive_number("--tolerance", arguments.tolerance)
    aims = gradients.aims(scene, pattern, **given, tolerance=tolerance)
    messages(arguments, f"of {arguments.scene}")
    found = clothsim.design(
        scene,
        list(aims.values()),
        free,
        pattern,
        area,
        arguments.symmetric,
        runs,
        None if arguments.quiet else lambda run: _shown(run.failure, run.aims, list(aims)),
    )
    content, completed = summary(found, list(aims)), True
    if arguments.output is not None:
        run = clothsim.simulate(found.scene, arguments.output, overwrite=arguments.overwrite)
        completed = run.status == "completed"
        write_atomically(arguments.output / DESIGN_NAME, on_demand.to_json(content).encode())
    good = completed and found.best.met and not found.best.intersecting_pairs
    return Report(content, "\n".join(lines(found, list(aims), arguments.output)), good, verdict=True)


def _pair(option: str, text: str, example: str) -> tuple[str, str]:
    first, equals, second = (part.strip() for part in text.partition("="))
    if not first or not equals or not second:
        raise InputError(f"{option} is {text!r}.", f"Write it as {option} {example}, in metres.")
    return first, second


def _number(option: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"{option}: {text!r} is not a height.", "Give it in metres.") from error


def _shown(failure: str, aims: Sequence[float], names: Sequence[str]) -> None:
    state = failure or ", ".join(f"{name} {_aim_text(aim)}" for name, aim in zip(names, aims, strict=True))
    print(f"  {state}", file=sys.stderr, flush=True)


def _aim_text(aim: float) -> str:
    """How far off an aim is, in tolerances."""
    return "met" if aim <= 1.0 else f"{aim**0.5:.3g} tolerances off"


def summary(found: "clothsim.Design", names: list[str]) -> dict[str, Any]:
    """Return the content of design.json."""
    best = found.best
    return {
        "values": dict(best.values),
        "aims": {name: {"tolerances": aim**0.5, "met": aim <= 1.0} for name, aim in zip(names, best.aims, strict=True)},
        "met": best.met,
        "area": best.area,
        "largest_stretch": best.stretch,
        "newton_error": best.newton_error,
        "intersecting_pairs": best.intersecting_pairs,
        "runs": len(found.runs),
    }


def lines(found: "clothsim.Design", names: list[str], directory: Path | None) -> list[str]:
    """Return the result in lines for the user."""
    best = found.best
    out = [f"  {path:40} {value:.6g}" for path, value in best.values.items()]
    out += [f"  {name:40} {_aim_text(aim)}" for name, aim in zip(names, best.aims, strict=True)]
    out.append(f"  {len(found.runs)} runs, {best.area:.4g} m2 of fabric, stretch at most {best.stretch:.4g}")
    if best.intersecting_pairs:
        out.append(f"  {best.intersecting_pairs} pairs of triangles intersect in the last state.")
    return out if directory is None else [*out, f"  files     {directory}: {DESIGN_NAME} and the run"]
