"""`clothsim recover`: numbers of a scene from a drape, from pictures of it, or from outlines."""

import argparse
import math
import sys
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine, gradients, patterns
from clothsim.base.errors import InputError
from clothsim.base.file_writing import make_directory, refuse_replacing, write_atomically
from clothsim.base.interruption import interruption
from clothsim.base.text import percent
from clothsim.cli import on_demand
from clothsim.cli.arguments import (
    add_output_options,
    add_overwrite,
    add_set,
    as_count,
    as_length,
    as_scale,
    assigned_number,
    meshed,
    scene_of,
    words,
)
from clothsim.cli.report import Report, messages

if TYPE_CHECKING:
    from clothsim.patterns import PatternMesh


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    recover = commands.add_parser("recover", usage="clothsim recover [SCENE] [options]", description=_RECOVER)
    recover.add_argument("scene", type=Path, nargs="?", metavar="SCENE", help=argparse.SUPPRESS)
    recover.add_argument(
        "--target", type=Path, metavar="FILE", help="a drape: a mesh, points (.xyz), or a run's directory"
    )
    recover.add_argument("--views", type=Path, metavar="FILE", help="pictures and scans (TOML), in place of --target")
    recover.add_argument("--on", type=Path, metavar="BODY", help="with --views and --pattern: dress BODY first")
    recover.add_argument("--free", metavar="NAMES", help="youngs_modulus,pattern.front.width")
    recover.add_argument("--prior", action="store_true", help="combine bending with 618 measured fabrics")
    recover.add_argument("--test", choices=("cusick",), help="outlines of drapes (.npz), with --set density=0.15")
    recover.add_argument("--pattern", type=Path, metavar="FILE", help="pattern.json of a cloth of arrays")
    recover.add_argument("--size", default="2cm", metavar="L", help="mesh size of that pattern (default 2cm)")
    recover.add_argument("-o", "--output", type=Path, metavar="DIR", help="output directory (default: none)")
    recover.add_argument("--starts", metavar="N", help="starts of the search (default 2; 1 with --views)")
    recover.add_argument("--folds", metavar="N", help="with --views: drapes from which a start is chosen (6)")
    recover.add_argument(
        "--no-twins", action="store_true", help="with --views: skip the runs for the model's own error"
    )
    recover.add_argument("--finer", action="store_true", help="with --views: end on half the mesh size")
    recover.add_argument("--scale", metavar="FACTOR", help="metres per unit of the target or body")
    add_set(recover)
    recover.add_argument("--resume", action="store_true", help="go on with a search that was stopped")
    add_overwrite(recover, "replace an earlier run in the output directory")
    add_output_options(
        recover, json="print recovery.json, the rest on stderr", quiet="print only the result", handler=_recover
    )


RECOVERY_NAME = "recovery.json"

_RECOVER = """\
Find the parameters with which a scene, fabric or pattern hangs as in a target or in pictures, with standard errors.
SCENE is a scene, an example or a run, and with --test outlines (.npz).

  clothsim recover scene.toml --target drape.obj --free youngs_modulus,bending_stiffness -o recovered
  clothsim recover skirt.toml --views views.toml --free pattern.front.width -o recovered
"""


RUNS = "runs"
"""Ending of the folder of a search's results so far, beside the output directory."""


def _kept_runs(output: Path) -> Path:
    return output.with_name(f"{output.name}_{RUNS}")


def _runs_folder(arguments: argparse.Namespace) -> Path | str:
    """Where the results of runs are kept until the search ends; "" without an output directory."""
    out = arguments.output
    if out is None:
        if arguments.resume:
            raise InputError("--resume needs -o.", "Name the output directory of the search that was stopped.")
        return ""
    folder = _kept_runs(out)
    there = folder.is_dir()
    if arguments.resume and not there:
        raise InputError(f"There is no {folder}: no search for {out} was stopped.", "Leave --resume out.")
    if there and not arguments.resume:
        if not arguments.overwrite:
            raise InputError(
                f"{folder} holds the runs of a search that was stopped.",
                "Go on with it: --resume; or replace it: --overwrite.",
            )
        _remove_runs(folder)
    return folder


def _remove_runs(folder: Path | str) -> None:
    """Remove the results of a search, and their folder where nothing else is in it."""
    if folder and Path(folder).is_dir():
        for file in Path(folder).glob("*.npz"):
            file.unlink(missing_ok=True)
        with suppress(OSError):
            Path(folder).rmdir()


NUMBERS = "Name the numbers to find, such as --free youngs_modulus,pattern.front.width."
"""Remedy of a recovery without --free."""


def _recover(arguments: argparse.Namespace) -> Report:
    if arguments.test is not None:
        return _recover_drape(arguments)
    try:
        return _recover_from_target(arguments) if arguments.views is None else _recover_from_views(arguments)
    except KeyboardInterrupt:
        if arguments.output is not None and _kept_runs(arguments.output).is_dir():
            print("To go on with the search, give the same command with --resume.", file=sys.stderr)
        raise


def _recover_from_target(arguments: argparse.Namespace) -> Report:
    for name in ("scene", "target", "free"):
        if getattr(arguments, name) is None:
            option = "SCENE" if name == "scene" else f"--{name}"
            remedy = NUMBERS if name == "free" else "Or give pictures with --views, outlines with --test cusick."
            raise InputError(f"recover needs {option}.", remedy)
    if arguments.on is not None:
        raise InputError("--on has no effect without --views.", "Dress the body first, and name its directory.")
    if arguments.folds is not None or arguments.no_twins or arguments.finer:
        raise InputError("--folds, --no-twins and --finer have no effect without --views.", "Leave them out.")
    free, starts = words("--free", arguments.free), as_count("--starts", arguments.starts or "2")
    scale = as_scale("--scale", arguments.scale) or 1.0
    if not arguments.target.exists():
        raise InputError(f"There is no {arguments.target}.", "Name a mesh, an .xyz file or a run with --target.")
    scene = scene_of(arguments, or_run=True)
    if arguments.output is not None:
        inputs = (arguments.scene, scene, arguments.target, arguments.pattern)
        engine.refuse_earlier_run(arguments.output, arguments.overwrite, (RECOVERY_NAME,), inputs)
    runs = _runs_folder(arguments)
    messages(arguments, f"{', '.join(free)} of {arguments.scene}")
    loss = gradients.named_loss("target", engine.build(scene, affordable=True).world, arguments.target, scale)
    pattern = None if arguments.pattern is None else meshed(arguments.pattern, arguments.size, scene)
    with interruption():
        found = clothsim.recover(
            scene,
            loss,
            free,
            starts,
            None if arguments.quiet else _progress(starts),
            pattern=pattern,
            prior=arguments.prior,
            runs=runs,
        )
    content = summary(found, type(loss).__name__)
    good = found.best.intersecting_pairs == 0
    if arguments.output is not None:
        run = clothsim.simulate(found.scene, arguments.output, overwrite=arguments.overwrite)
        good = good and run.status == "completed"
        write_atomically(arguments.output / RECOVERY_NAME, on_demand.to_json(content).encode())
        _remove_runs(runs)
    return Report(content, "\n".join(lines(found, arguments.output)), good, verdict=True)


def _progress(starts: int) -> Any:
    """A callback that prints each run of a search."""

    def show(start: int, each: Any) -> None:
        numbers = ", ".join(f"{path} {value:.4g}" for path, value in each.values.items())
        where = f"start {start} of {starts}" if start else "folds"
        print(f"{where}: {numbers}: {each.failure or f'loss {each.loss:.4g}'}", file=sys.stderr, flush=True)

    return show


PATTERN_NAME, DRESSED = "pattern.json", "dressed"
"""The pattern with the recovered numbers, and the folder of the garment as it was read, sewn on the body."""


def _recover_from_views(arguments: argparse.Namespace) -> Report:
    if arguments.target is not None:
        raise InputError("--target has no effect with --views.", "Give one of them.")
    if arguments.free is None:
        raise InputError("recover needs --free.", NUMBERS)
    free, starts = words("--free", arguments.free), as_count("--starts", arguments.starts or "1")
    if not arguments.views.is_file():
        raise InputError(f"There is no {arguments.views}.", "Write a TOML file with a table [[view]] for each picture.")
    runs = _runs_folder(arguments)
    if arguments.on is not None:
        scene, mesh = _dressed(arguments)
    else:
        if arguments.scene is None:
            raise InputError("recover needs SCENE.", "Name it, or a pattern and a body with --pattern and --on.")
        scene = scene_of(arguments, or_run=True)
        if arguments.output is not None:
            inputs = (arguments.scene, scene, arguments.views, arguments.pattern)
            engine.refuse_earlier_run(arguments.output, arguments.overwrite, (RECOVERY_NAME, PATTERN_NAME), inputs)
        mesh = None if arguments.pattern is None else meshed(arguments.pattern, arguments.size, scene)
    messages(arguments, f"{', '.join(free)} from {arguments.views}")
    progress = None if arguments.quiet else _progress(starts)
    with interruption():
        found = clothsim.recover_views(
            scene,
            arguments.views,
            free,
            starts,
            progress,
            pattern=mesh,
            prior=arguments.prior,
            twins=not arguments.no_twins,
            folds=as_count("--folds", arguments.folds or "6"),
            finer=arguments.finer,
            runs=runs,
        )
    content = summary(found, "pictures") | {
        "pictures": [asdict(each) for each in found.pictures],
        "twins": [asdict(each) for each in found.twins],
        "model_errors": dict(found.model_errors),
        "total_errors": dict(found.total_errors),
        "folds": list(found.folds),
        "notes": list(found.notes),
        "fewer_pictures": {name: dict(errors) for name, errors in found.fewer_pictures.items()},
        "wide": list(found.wide),
        "from_minimum": found.from_minimum,
        "cpu_seconds": found.cpu_seconds,
        "adjoint_fraction": found.adjoint_fraction,
    }
    good = found.best.intersecting_pairs == 0
    out = arguments.output
    if out is not None:
        run = clothsim.simulate(found.scene, out, overwrite=arguments.overwrite)
        good = good and run.status == "completed"
        write_atomically(out / RECOVERY_NAME, on_demand.to_json(content).encode())
        for name, picture in found.overlays.items():
            on_demand.as_image(picture).save(out / overlay_name(name))
        if found.pattern is not None:
            patterns.write_specification(out / PATTERN_NAME, found.pattern)
        _remove_runs(runs)
    return Report(content, "\n".join([*lines(found, out), *_picture_lines(found)]), good, verdict=True)


def overlay_name(view: str) -> str:
    """File of the picture of a view: letters and digits of its name."""
    return f"view_{''.join(c if c.isalnum() else '_' for c in view)}.png"


def _dressed(arguments: argparse.Namespace) -> "tuple[clothsim.Scene, PatternMesh | None]":
    """The drape of a pattern on a body, and its mesh."""
    if arguments.scene is not None or arguments.pattern is None or arguments.output is None:
        raise InputError("--on needs --pattern and -o, and no SCENE.", "The pattern is sewn on the body first.")
    inputs = (arguments.pattern, arguments.on, arguments.views)
    engine.refuse_earlier_run(arguments.output, arguments.overwrite, (RECOVERY_NAME, PATTERN_NAME), inputs)
    pattern = engine.example_file(arguments.pattern, "_specification.json", "a pattern, as tunic")
    body = engine.example_file(arguments.on, what="a body: a mesh file, or a scene with one, such as shirt")
    tell = messages(arguments, f"{arguments.pattern} on {arguments.on}")
    folder, size = (
        arguments.output.with_name(f"{arguments.output.name}_{DRESSED}"),
        as_length("--size", arguments.size, "2cm"),
    )
    # in pattern.json the last bit of a number may be another, and another diagonal of four points on a circle is chosen
    cut = pattern if pattern.suffix.lower() == ".json" else folder / PATTERN_NAME
    if arguments.resume and (folder / PATTERN_NAME).is_file() and clothsim.open_run(folder).status == "completed":
        scene = clothsim.open_run(folder).scene
        return engine.override(scene, *arguments.set), meshed(cut, arguments.size, scene)
    scale = as_scale("--scale", arguments.scale)
    worn = clothsim.dress(
        pattern,
        body,
        folder,
        size=size,
        scale=scale,
        overwrite=arguments.overwrite,
        on_stage=lambda stage: tell(f"  {stage.name}"),
    )
    if not worn.draped or worn.run is None:
        raise InputError(f"The pattern as given cannot be worn: {worn.reason}", "Correct it with `clothsim dress`.")
    scene = worn.run.scene
    return engine.override(scene, *arguments.set), meshed(cut, arguments.size, scene)


UNEXPLAINED = 1.5
"""Misfit of a picture, in its noise, from which on the scene does not explain it: of skirts it is 0.6 to 1."""
BEHIND = "drapes that differ behind look alike in it"
"""Why one view tells heights alone: a hem was 16 % off where 2 % were stated, with the model's own."""
_TWINS = {
    "mesh": "a mesh of half the size",
    "step": "steps of half the length",
    "time": "twice the time",
    "start": "from the first start, pulled to the pictures",
    "place": "the cloth displaced as far as the pictures show",
}


def _picture_lines(found: "clothsim.ViewRecovery") -> list[str]:
    """How each picture fits, and what they do not tell."""
    out = [f"  {note}" for note in found.notes]
    for each in found.pictures:
        left = f", {percent(each.left_out)} without a residual" if each.left_out > 0 else ""
        switched = "" if math.isnan(each.switched) else f", {percent(each.switched)} of the pairs switched last"
        out.append(f"  view {each.view}, {each.what}: {each.misfit:.2g} of its noise{left}{switched}")
    worst = max(found.pictures, key=lambda each: each.misfit)
    if worst.misfit > UNEXPLAINED:
        out.append(
            f"  view {worst.view}, {worst.what}, is not explained to its noise: the errors are too small. The mesh is "
            "too coarse (--size), the folds are others (--folds, --starts), or the scene lacks something."
        )
    for twin in found.twins:
        text = twin.failure or ", ".join(f"{path} {percent(shift, '+')}" for path, shift in twin.shifts.items())
        out.append(f"  the model, {_TWINS[twin.name]}: {text}")
    if found.model_errors:
        with_model = ", ".join(f"{path} +- {percent(error)}" for path, error in found.total_errors.items())
        out.append(f"  errors with the model's own: {with_model}")
    behind = [path for path in found.values if not path.endswith(".height")]
    for name, errors in found.fewer_pictures.items():
        of_one = name != "masks alone"
        shown = {path: error for path, error in errors.items() if not (of_one and path in behind)}
        text = ", ".join(f"{path} {_error(error)}" for path, error in shown.items()) or "nothing"
        out.append(f"  {name} would tell: {text}{f'; no others, as {BEHIND}' if of_one and behind else ''}")
    kinds = {each.what for each in found.pictures}
    if behind and len({each.view for each in found.pictures}) == 1 and "scan" not in kinds:
        text = f"  One view does not determine {', '.join(behind)}, as {BEHIND}: their errors are too small."
        out.append(f"{text} Add a view.")
    if kinds.isdisjoint(("normals", "depth", "scan")):
        out.append("  Without normals or depths the folds are not seen: outlines alone determine bending.")
    if len(found.folds) > 1:
        out.append(f"  misfits of the folds of {len(found.folds)} drapes: {', '.join(f'{k:.3g}' for k in found.folds)}")
    out += [
        f"  {path} is known to no half of what it is without pictures: more views or normals." for path in found.wide
    ]
    out.append(f"  the step that is left, by the adjoint: {found.from_minimum:.2g} standard errors at most")
    out.append(f"  {found.cpu_seconds:.3g} CPU s, {percent(found.adjoint_fraction)} of it in the adjoint")
    return out


def _recover_drape(arguments: argparse.Namespace) -> Report:
    """D/(rho g) and curl from outlines of a drape tester."""
    for name in ("target", "free", "pattern", "views", "on", "folds", "resume"):
        if getattr(arguments, name) not in (None, False):
            raise InputError(f"--{name} has no effect with --test.", "The outlines are the target; leave it out.")
    if arguments.scene is None:
        raise InputError("--test needs outlines.", "Name their .npz file.")
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


def summary(found: "clothsim.Recovery", loss: str) -> dict[str, Any]:
    """Return the content of recovery.json; errors that are infinite or not known are null."""
    return {
        "values": dict(found.values),
        "relative_errors": dict(found.errors),
        "ratios": [
            {"first": each.first, "second": each.second, "value": each.value, "relative_error": each.error}
            for each in found.ratios
        ],
        "undetermined": [dict(weights) for weights in found.undetermined],
        "at_limit": list(found.at_limit),
        "loss": {"name": loss, "value": found.best.loss, "of_starts": list(found.minima)},
        "newton_error": found.best.newton_error,
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
        return "(no standard error: the loss is not a sum of squares, or a run beside the minimum failed)"
    return f"+- {percent(error)}" if math.isfinite(error) else "(not determined by the target)"
