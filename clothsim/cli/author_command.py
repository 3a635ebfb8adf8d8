"""`clothsim author`: a clip from edited frames of a run, simulated under contact."""

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import clothsim
from clothsim.base.errors import InputError
from clothsim.base.text import many, percent
from clothsim.cli import progress
from clothsim.cli.arguments import add_output_options, add_overwrite, as_positive_number
from clothsim.cli.report import Report, messages

if TYPE_CHECKING:
    from clothsim import Authored, ClipRecovery

_DESCRIPTION = """\
Make a clip from a run and some of its frames that you edited: find what explains the edits, and simulate all frames.

  clothsim export walk --frame 10 -o frame10.obj         # move its vertices, and save it as edited10.obj
  clothsim author walk --keys 10=edited10.obj,40=edited40.obj -o clip
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    author = commands.add_parser("author", description=_DESCRIPTION)
    author.add_argument("directory", type=Path, metavar="RUN", help="the output of `clothsim run`")
    author.add_argument(
        "--keys", required=True, metavar="N=FILE,...", help="frames from 1, each with a mesh of its moved vertices"
    )
    author.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="the clip, a run")
    author.add_argument(
        "--quick", action="store_true", help="interpolate the edits, and follow them under contact: one run"
    )
    author.add_argument("--free", default="", metavar="NAMES", help="parameters to fit: stretch,bending,hem,...")
    author.add_argument("--no-rest", action="store_true", help="fit parameters only, no residual rest shape")
    author.add_argument(
        "--rate",
        default="300",
        metavar="R",
        help="rate at which --quick draws the cloth to the edits [1/s] (default 300)",
    )
    author.add_argument(
        "--space", choices=("canonical", "world"), help="space of the quick form (default: by the body)"
    )
    author.add_argument("--no-floor", action="store_true", help="skip the two runs that measure the noise floor")
    add_overwrite(author, "replace an earlier run in the output directory")
    add_output_options(author, json="print author.json", quiet="print only the result", handler=_author)


def _author(arguments: argparse.Namespace) -> Report:
    keys = as_keys(arguments.keys)
    run = clothsim.open_run(arguments.directory)
    rate = as_positive_number("--rate", arguments.rate)
    messages(arguments, arguments.directory)
    with progress.progress_on_stderr(arguments.quiet) as listener:
        found = clothsim.author(
            run,
            keys,
            arguments.output,
            quick=arguments.quick,
            free=[name.strip() for name in arguments.free.split(",") if name.strip()],
            rest=not arguments.no_rest,
            rate=rate,
            space=arguments.space,
            progress=listener,
            overwrite=arguments.overwrite,
            floor=not arguments.no_floor,
        )
    free = found.run.status == "completed" and found.intersecting_frames == ()
    return Report(found.as_json(), "\n".join(lines(found)), free, verdict=True)


def as_keys(text: str) -> dict[int, Path]:
    """Files by frame of "10=edited10.obj,40=edited40.obj". InputError for another text, or a frame given twice.

    Examples
    --------
    >>> {frame: file.name for frame, file in as_keys("10=a.obj,40=b.obj").items()}
    {10: 'a.obj', 40: 'b.obj'}
    """
    keys: dict[int, Path] = {}
    for part in filter(None, (word.strip() for word in text.split(","))):
        found = re.fullmatch(r"(\d{1,9})\s*=\s*(.+)", part)
        if found is None:
            raise InputError(f"--keys has {part!r}.", "Write FRAME=FILE, such as 10=edited10.obj,40=edited40.obj.")
        frame = int(found[1])
        if frame in keys:
            raise InputError(f"--keys gives frame {frame} twice.", "Give each frame one file.")
        keys[frame] = Path(found[2])
    if not keys:
        raise InputError("--keys names no edited frame.", "Write FRAME=FILE, such as 10=edited10.obj,40=edited40.obj.")
    return keys


def lines(found: "Authored") -> list[str]:
    """The result in lines for the user: each key, the verdict, the files."""
    run = found.run
    out = [f"{run.status}: {run.reason}"]
    out += [] if found.recovery is None else _explained(found.recovery)
    out.append(f"  keys     {found.space + ' offsets, ' if found.space else ''}distances in mm (RMS, largest):")
    for key in found.keys:
        before, most, after, left = (1e3 * each for each in (key.before, key.before_most, key.after, key.after_most))
        crossing = f"; as edited {many(key.intersecting, 'pair')} of triangles intersect" if key.intersecting else ""
        out.append(f"    frame {key.frame}: {before:.3g} ({most:.3g}) before, {after:.3g} ({left:.3g}) now{crossing}")
    for whose, floor in (("run", found.floor), ("authored clip", found.own_floor)):
        if not np.isnan(floor).all():
            start, stop = (f"{1e3 * each:.3g}" if np.isfinite(each) else "not known" for each in floor)
            far = f"{start} from a start 1e-6 m aside, {stop} with a tenth of the stop"
            out.append(f"  floor    twins of the {whose}, mm RMS: {far}")
    frames, crossed = many(len(run), "frame"), found.intersecting_frames
    verdict = "not all tested" if crossed is None else "none intersects" if not crossed else f"INTERSECT: {crossed}"
    out.append(f"  checked  {frames}, each by the exact test: {verdict}")
    files = "a run, targets.npy and author.json" if found.recovery is None else "a run and author.json"
    return [*out, f"  files    {run.directory}: {files}"]


def _explained(found: "ClipRecovery") -> list[str]:
    """What explains the edits, in lines: numbers, what the keys do not determine, the price of the rest shape."""
    before, numbers, left = (f"{1e3 * each:.3g}" for each in found.misfits)
    known = ", ".join(f"{1e3 * each:.2g}" for each in found.noise)
    out = [f"  explained in {many(found.runs, 'run')}, the keys taken to be known to {known} mm:"]
    for name, factor in found.values.items():
        error = found.errors[name]
        known = f"+- {percent(error)}" if np.isfinite(error) else "not determined by the keys"
        limit = ", at its limit" if name in found.at_limit else ""
        out.append(f"    {name:<16} x {factor:<7.4g} {known}{limit}")
    for each in found.undetermined:
        if len(each) > 1:
            out.append(
                f"    not determined together: {', '.join(f'{name} {weight:+.2f}' for name, weight in each.items())}"
            )
    out.append(f"  at keys  mm RMS: {before} before, {numbers} with the numbers, {left} with the rest shape")
    if found.rest is not None:
        price = found.rest
        out.append(
            f"  rest     residual shape: {1e3 * price.displacement:.3g} mm RMS, {1e3 * price.most:.3g} at most; "
            f"lengths by {percent(price.length)}, angles by {np.degrees(price.angle):.2g} degrees at most"
        )
    elif found.no_rest:
        out.append(f"  rest     no residual shape: {found.no_rest}")
    if found.no_gradient:
        out.append(f"  adjoint  none: {found.no_gradient}")
    else:
        out.append(f"  adjoint  {found.from_minimum:.2g} standard errors from a minimum of the numbers")
    return out
