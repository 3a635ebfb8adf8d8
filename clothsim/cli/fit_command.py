"""`clothsim fit`: a garment fitted from one body to another."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine
from clothsim.base.errors import ClothsimError
from clothsim.base.text import length
from clothsim.cli import on_demand, progress
from clothsim.cli.arguments import Renamed, as_positive_number, as_range
from clothsim.cli.report import Report, messages

if TYPE_CHECKING:
    from clothsim.garments.fit.fit import Fit
    from clothsim.garments.stages import Stage

PICTURE_NAME = "fit.png"

_DESCRIPTION = """\
Fit a garment made for one body onto another, or free it of the body that it is on, and drape it. Leaves what a run
leaves, fitted.obj, and before and after in fit.png.

  clothsim fit suit.mhclo --made-for base.obj --to base.obj -o fitted
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    usage = "clothsim fit GARMENT [--made-for BODY] --to BODY [-o DIR] [options]"
    fit = commands.add_parser("fit", description=_DESCRIPTION, usage=usage)
    fit.add_argument(
        "garment",
        type=Path,
        metavar="GARMENT",
        help="a mesh, .mhclo, or a scene: a .toml or a name",
    )
    fit.add_argument("--made-for", type=Path, metavar="BODY", help="the body it lies on (default: --to)")
    fit.add_argument("--from", dest="made_for", action=Renamed, now="--made-for", type=Path)
    fit.add_argument("--to", required=True, type=Path, metavar="BODY", help="the body to wear it")
    fit.add_argument("-o", "--output", type=Path, metavar="DIR", help="output directory (default: the garment's name)")
    fit.add_argument("--scale", metavar="S", help="metres per unit of garment and body (default: by height)")
    fit.add_argument("--scale-to", metavar="S", help="metres per unit of the body of --to (default: by height)")
    fit.add_argument("--body-group", metavar="NAME", help="this group of the bodies (default: the largest)")
    fit.add_argument("--part", metavar="LO:HI", help="only these vertices of the garment's file")
    fit.add_argument("--weld", metavar="M", help="sew borders of the garment closer than that [m]")
    fit.add_argument("--markers", type=Path, metavar="FILE", help="x y z on each body, a line (default: none)")
    fit.add_argument("--fabric", metavar="NAME", help="a named fabric (default cotton)")
    size = fit.add_mutually_exclusive_group()
    size.add_argument("--own-size", action="store_true", help="keep the size that it was cut in")
    size.add_argument("--resize", action="store_true", help="grade it along girths and lengths (the default)")
    size.add_argument("--grade", dest="resize", action=Renamed, now="--resize", nargs=0, const=True)
    fit.add_argument("--overwrite", action="store_true", help="replace an earlier run in the directory")
    fit.add_argument("--no-picture", action="store_true", help="draw nothing")
    fit.add_argument("--quiet", action="store_true", help="print the end only")
    fit.add_argument("--json", action="store_true", help="print the summary as JSON, the rest on stderr")
    fit.add_argument("--debug", action="store_true", help="show tracebacks")
    fit.set_defaults(handler=_fit)


def _fit(arguments: argparse.Namespace) -> Report:
    def named(file: Path | None) -> Path | None:
        """The file, or the installed scene of that name."""
        return None if file is None else engine.example_file(file)

    directory = arguments.output or Path(arguments.garment.stem)

    message = messages(arguments, arguments.garment)
    with progress.shown(arguments.quiet) as listener:
        done = clothsim.fit(
            named(arguments.garment),
            named(arguments.to),
            named(arguments.made_for),
            directory,
            scale=None if arguments.scale is None else as_positive_number("--scale", arguments.scale),
            scale_to=None if arguments.scale_to is None else as_positive_number("--scale-to", arguments.scale_to),
            body_group=arguments.body_group,
            part=None if arguments.part is None else as_range("--part", arguments.part),
            weld=0.0 if arguments.weld is None else as_positive_number("--weld", arguments.weld),
            fabric=arguments.fabric,
            resize=not arguments.own_size,
            markers=arguments.markers,
            on_stage=lambda stage: message(_stage(stage)),
            progress=listener,
            overwrite=arguments.overwrite,
        )
    trouble = [] if arguments.no_picture else _picture(done)
    lines = [*_verdict(done), *trouble]
    if done.status == "distorted":
        lines.append(f"  worst     at {', '.join(f'{value:.3f}' for value in done.look.place)} m")
    summary = on_demand.read_summary(directory / on_demand.SUMMARY_NAME) if arguments.json else None
    return Report(summary, "\n".join(lines), 0 if done.status == "completed" else 1, verdict=True)


def _stage(stage: "Stage") -> str:
    note = f"; {stage.description}" if stage.description else ""
    return f"  {stage.name:<9} {stage.seconds:6.1f} s  {stage.counts}{note}"


def _verdict(done: "Fit") -> list[str]:
    cost, look = done.cost, done.look
    return [
        f"{done.status}: {done.reason}",
        *(f"  note      {note}" for note in done.notes),
        f"  fitted    {_answer(done)}{done.counts}",
        *_carried(done),
        f"  stretch   {cost.low:.3f} to {cost.high:.3f} (1st to 99th percentile, against the garment as given)",
        *([f"  size      {done.size}"] if str(done.size) and done.source is not done.target else []),
        f"  look      edges {look.edge_low:.2f} to {look.edge_high:.2f} with the scale {look.scale:.2f} taken out, "
        f"{100 * look.distorted:.1f} % of the triangles doubled or halved, hem {100 * look.hem:+.1f} %",
        f"  moved     at most {length(cost.displacement)} from where it was worn",
        f"  files     {done.directory}: {', '.join(sorted(file.name for file in done.directory.iterdir()))}",
    ]


def _carried(done: "Fit") -> list[str]:
    """A line on the vertices that the body carries, where it overlaps itself."""
    if not len(done.carried):
        return []
    at = ", ".join(f"{value:.3f}" for value in done.positions[done.carried].mean(axis=0))
    return [
        f"  carried   {len(done.carried)} vertices about ({at}) m, where {done.target.name} overlaps itself: one part "
        "carries them, and what they intersect is not counted"
    ]


def _answer(done: "Fit") -> str:
    """The stage that is the result, where it is not the last one."""
    if done.status != "failed":
        return ""
    return f"stage {done.answer_number + 1} of {len(done.stages)}, {done.answer.name}: "


def _picture(done: "Fit") -> list[str]:
    try:
        on_demand.draw_fit(done, done.directory / PICTURE_NAME)
    except (ClothsimError, OSError, ImportError) as error:
        return [f"No {PICTURE_NAME}: {error}"]
    return []
