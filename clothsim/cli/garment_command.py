"""`clothsim fit` and `clothsim dress`: a garment fitted from one body to another, a sewing pattern sewn on a body."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import render
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.file_writing import refuse_replacing
from clothsim.base.text import length_text
from clothsim.cli import on_demand, progress
from clothsim.cli.arguments import (
    Renamed,
    add_output_options,
    add_overwrite,
    as_length,
    as_positive_number,
    as_range,
    as_scale,
    as_seconds,
)
from clothsim.cli.report import Report, messages

if TYPE_CHECKING:
    from clothsim.garments.dressed import Dress
    from clothsim.garments.fitted import Fit
    from clothsim.garments.outfit import Outfit
    from clothsim.garments.stages import Stage

_DRESS = """\
Sew a pattern (specification.json of GarmentCode and others, or a DXF of AAMA) on a body under contact,
weld its seams and drape it.
Writes the files of a run, garment.obj with the pattern as texture coordinates, and pictures.

  clothsim dress shirt_specification.json --on body.obj -o worn
  clothsim dress tunic --on shirt -o worn            (a pattern and a body that come with the package)
  clothsim dress shirt_specification.json --on hers.obj --made-for his.obj     (graded by girths and lengths)
  clothsim dress trousers.json shirt.json --on body.obj -o worn       (one over another, then all draped together)
  clothsim dress jacket.json --over worn -o outdoors
"""


def add_to(commands: Any) -> None:
    """Add the commands to the parser."""
    usage = "clothsim fit GARMENT [--made-for BODY] --to BODY [-o DIR] [options]"
    fit = commands.add_parser("fit", description=_FIT, usage=usage)
    fit.add_argument(
        "garment",
        type=Path,
        metavar="GARMENT",
        help="a mesh, .mhclo, or a scene: a .toml or a name",
    )
    fit.add_argument("--made-for", type=Path, metavar="BODY", help="the body that it was made for (default: --to)")
    fit.add_argument("--from", dest="made_for", action=Renamed, now="--made-for", type=Path)
    fit.add_argument("--to", required=True, type=Path, metavar="BODY", help="the body that will wear it")
    fit.add_argument("-o", "--output", type=Path, metavar="DIR", help="output directory (default: the garment's name)")
    fit.add_argument("--scale", metavar="S", help="metres per unit of garment and body (default: by height)")
    fit.add_argument("--scale-to", metavar="S", help="the same for the body of --to")
    fit.add_argument(
        "--body-group",
        action="append",
        metavar="NAME",
        help="a group of the bodies; repeat for several (default: the largest)",
    )
    fit.add_argument("--part", metavar="LO:HI", help="only these vertices of the garment's file")
    fit.add_argument("--weld", metavar="M", help="sew borders of the garment closer than M [m]")
    fit.add_argument("--markers", type=Path, metavar="FILE", help="points on both bodies: x y z x y z per line")
    fit.add_argument("--fabric", metavar="NAME", help="a named fabric (default cotton)")
    size = fit.add_mutually_exclusive_group()
    size.add_argument("--own-size", action="store_true", help="keep the size in which it was cut")
    size.add_argument("--resize", action="store_true", help="grade it along girths and lengths (the default)")
    size.add_argument("--grade", dest="resize", action=Renamed, now="--resize", nargs=0, const=True)
    add_overwrite(fit, "replace an earlier run in the directory")
    fit.add_argument("--no-picture", action="store_true", help="draw nothing")
    add_output_options(
        fit, json="print the summary as JSON, the rest on stderr", quiet="print only the result", handler=_fit
    )
    dress = commands.add_parser("dress", description=_DRESS)
    dress.add_argument(
        "patterns",
        type=Path,
        metavar="PATTERN",
        nargs="+",
        help="a specification.json, a .dxf, or the name of an installed one; several: an outfit, the innermost first",
    )
    dress.add_argument("--on", type=Path, metavar="BODY", help="the body: a mesh file or a scene")
    dress.add_argument("--over", type=Path, metavar="RUN", help="sew over the garments of this run, on its body")
    dress.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="output directory (default: the pattern's name)"
    )
    dress.add_argument("--size", default="2cm", metavar="L", help="size of the mesh: 2cm, 15mm, 0.01 [m] (default 2cm)")
    dress.add_argument("--fabric", metavar="NAME", help="a named fabric (default cotton)")
    dress.add_argument(
        "--fabric-of",
        action="append",
        default=[],
        metavar="PANEL=NAME",
        help="fabric of a panel, such as collar=denim, or of several: '*sleeve*=wool'; can be repeated",
    )
    dress.add_argument(
        "--made-for", type=Path, metavar="BODY", help="the body that the pattern was cut for: grade it to --on"
    )
    dress.add_argument("--cut-for", dest="made_for", action=Renamed, now="--made-for", type=Path)
    dress.add_argument(
        "--grade",
        action="append",
        default=[],
        metavar="NAME=F",
        help="grade by this factor of girth or length, such as waist=1.05; can be repeated",
    )
    dress.add_argument("--waistband", action="store_true", help="take in upper edges that would slide down")
    dress.add_argument(
        "--coarse-sewing",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="sew on a coarser mesh that is refined before the drape (default)",
    )
    dress.add_argument("--hold", dest="waistband", action=Renamed, now="--waistband", nargs=0, const=True)
    dress.add_argument(
        "--origin", default="auto", choices=("auto", "floor", "waist"), help="what is at y = 0 in the file"
    )
    dress.add_argument(
        "--rotation-order", default="zyx", choices=("zyx", "xyz"), help="order of panel rotations (default zyx)"
    )
    dress.add_argument("--seams", type=Path, metavar="TOML", help="seams and placement of a .dxf (default NAME.toml)")
    dress.add_argument("--scale", metavar="S", help="metres per unit of the body (default: by height)")
    dress.add_argument(
        "--body-group",
        action="append",
        metavar="NAME",
        help="a group of the body; repeat for several (default: the largest)",
    )
    dress.add_argument(
        "--budget", metavar="TIME", help="CPU time after which it stops and names what keeps seams open: 90s, 10min"
    )
    add_overwrite(dress, "replace an earlier run in the directory")
    dress.add_argument("--no-picture", action="store_true", help="draw nothing")
    dress.add_argument(
        "--movie", action="store_true", help="write movie.mp4 of the sewing, or movie.gif without ffmpeg"
    )
    add_output_options(
        dress, json="print the summary as JSON, the rest on stderr", quiet="print only the result", handler=_dress
    )


PICTURE_NAME = "fit.png"

_FIT = """\
Fit a garment made for one body onto another, or free it of its own body, and drape it. Writes the
files of a run, fitted.obj, and fit.png with the garment before and after.

  clothsim fit suit.mhclo --made-for base.obj --to base.obj -o fitted
"""


def _fit(arguments: argparse.Namespace) -> Report:
    directory = arguments.output or Path(arguments.garment.stem)
    if not arguments.no_picture:
        refuse_replacing([directory / PICTURE_NAME], arguments.overwrite)

    message = messages(arguments, arguments.garment)
    with progress.progress_on_stderr(arguments.quiet) as listener:
        done = clothsim.fit(
            arguments.garment,
            arguments.to,
            arguments.made_for,
            directory,
            scale=as_scale("--scale", arguments.scale),
            scale_to=as_scale("--scale-to", arguments.scale_to),
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
    wanted = (
        [] if arguments.no_picture else [(PICTURE_NAME, lambda: on_demand.draw_fit(done, directory / PICTURE_NAME))]
    )
    trouble = _drawn(directory, wanted)
    lines = [*_fit_verdict(done), *trouble]
    if done.status == "distorted":
        lines.append(f"  worst     at {', '.join(f'{value:.3f}' for value in done.look.place)} m")
    summary = on_demand.read_summary(directory / on_demand.SUMMARY_NAME) if arguments.json else None
    return Report(summary, "\n".join(lines), done.status == "completed", verdict=True)


def _stage(stage: "Stage") -> str:
    note = f"; {stage.description}" if stage.description else ""
    return f"  {stage.name:<9} {stage.seconds:6.1f} CPU s  {stage.counts}{note}"


def _fit_verdict(done: "Fit") -> list[str]:
    cost, look, stage = done.cost, done.look, ""
    if done.status == "failed":  # then it is not the last one
        stage = f"stage {done.answer_number + 1} of {len(done.stages)}, {done.answer.name}: "
    flypapered = []
    if len(done.flypapered):
        at = ", ".join(f"{value:.3f}" for value in done.positions[done.flypapered].mean(axis=0))
        flypapered = [
            f"  carried   {len(done.flypapered)} vertices about ({at}) m, where {done.target.name} overlaps itself: "
            "one part carries them, and what they intersect is not counted"
        ]
    return [
        f"{done.status}: {done.reason}",
        *(f"  note      {note}" for note in done.notes),
        f"  fitted    {stage}{done.counts}",
        *flypapered,
        f"  stretch   {cost.low:.3f} to {cost.high:.3f} (1st to 99th percentile, against the garment as given)",
        *([f"  size      {done.size}"] if str(done.size) and done.source is not done.target else []),
        f"  look      edges {look.edge_low:.2f} to {look.edge_high:.2f} with the scale {look.scale:.2f} taken out, "
        f"{100 * look.distorted:.1f} % of the triangles doubled or halved, hem {100 * look.hem:+.1f} %",
        f"  moved     at most {length_text(cost.displacement)} from where it was worn",
        f"  files     {done.directory}: {', '.join(sorted(file.name for file in done.directory.iterdir()))}",
    ]


def as_fabrics(given: list[str]) -> dict[str, str]:
    """Named fabric by panel from "collar=denim" and the like. InputError for other text, or a panel given twice."""
    found: dict[str, str] = {}
    for text in given:
        panel, equals, fabric = text.rpartition("=")
        if not (panel and equals and fabric):
            raise InputError(f"--fabric-of is {text!r}.", "Write PANEL=FABRIC, such as collar=denim.")
        if panel in found:
            raise InputError(f"--fabric-of names the panel {panel} twice.", "Give it one fabric.")
        found[panel] = fabric
    return found


def as_factors(given: list[str]) -> dict[str, float]:
    """Factor by name from "waist=1.05" and the like. InputError for other text, or a name given twice."""
    found: dict[str, float] = {}
    for text in given:
        name, equals, factor = text.partition("=")
        if not (name and equals):
            raise InputError(f"--grade is {text!r}.", "Write NAME=FACTOR, such as waist=1.05.")
        if name in found:
            raise InputError(f"--grade names {name} twice.", "Give one factor.")
        found[name] = as_positive_number("--grade", factor, "Write NAME=FACTOR, such as waist=1.05 for 5 % more.")
    return found


def _dress(arguments: argparse.Namespace) -> Report:
    several = len(arguments.patterns) > 1 or arguments.over is not None
    if several and (arguments.movie or arguments.seams):
        option = "--movie" if arguments.movie else "--seams"
        raise InputError(f"{option} is for one garment only.", "Leave it out, or dress one garment.")
    directory = arguments.output or Path("outfit" if several else arguments.patterns[0].stem)
    drawn = [] if arguments.no_picture else [*on_demand.DRESS_PICTURES]
    drawn += [render.movie_file(directory)[0].name] if arguments.movie else []
    refuse_replacing([directory / name for name in drawn], arguments.overwrite)

    message = messages(arguments, arguments.patterns[0])
    settings: dict[str, Any] = {
        "size": as_length("--size", arguments.size, "2cm"),
        "fabric": arguments.fabric,
        "fabrics": as_fabrics(arguments.fabric_of),
        "made_for": arguments.made_for,
        "grade": as_factors(arguments.grade),
        "waistband": arguments.waistband,
        "coarse_sewing": arguments.coarse_sewing,
        "origin": arguments.origin,
        "rotation_order": arguments.rotation_order,
        "scale": as_scale("--scale", arguments.scale),
        "body_group": arguments.body_group,
        "budget": None if arguments.budget is None else as_seconds("--budget", arguments.budget),
        "overwrite": arguments.overwrite,
        "on_stage": lambda stage: message(_stage(stage)),
    }
    with progress.progress_on_stderr(arguments.quiet) as listener:
        if several:
            settings |= {"over": arguments.over}
            worn = clothsim.outfit(arguments.patterns, arguments.on, directory, progress=listener, **settings)

            def draw_all() -> None:
                for each in worn.sewn:
                    if each.status != "completed":
                        on_demand.draw_dress(each)
                        continue
                    for name in drawn:  # what is worn is drawn once, with all that lies over it
                        (each.directory / name).unlink(missing_ok=True)
                if worn.worn:
                    on_demand.draw_outfit(worn)

            trouble = [] if arguments.no_picture else _drawn(directory, [("picture", draw_all)])
            status, lines = worn.status, _outfit_verdict(worn)
        else:
            if arguments.on is None:
                raise InputError("There is no body.", "Give it: --on BODY; `--on shirt` is a mannequin.")
            pattern = arguments.patterns[0]
            done = clothsim.dress(
                pattern, arguments.on, directory, seams=arguments.seams, progress=listener, **settings
            )
            trouble = _pictures(done, not arguments.no_picture, arguments.movie)
            status, lines = done.status, _dress_verdict(done)
    summary = on_demand.read_summary(directory / on_demand.SUMMARY_NAME) if arguments.json else None
    return Report(summary, "\n".join([*lines, *trouble]), status == "completed", verdict=True)


def _outfit_verdict(done: "Outfit") -> list[str]:
    return [
        f"{done.status}: {done.reason}",
        *(f"  note      {note}" for note in done.notes),
        *(
            f"  {each.directory.name:<9} {len(each.state.welded)} of {len(each.state.mesh.seams)} seams welded"
            for each in done.sewn
        ),
        *([f"  garments  {done.counts}"] if done.counts else []),
        f"  files     {done.directory}: {', '.join(sorted(file.name for file in done.directory.iterdir()))}",
    ]


def _dress_verdict(done: "Dress") -> list[str]:
    low, high = done.stretch
    welded, seams = len(done.state.welded), len(done.state.mesh.seams)
    return [
        f"{done.status}: {done.reason}",
        *(f"  note      {note}" for note in done.notes),
        f"  garment   {done.counts}; {welded} of {seams} seams welded",
        f"  stretch   {low:.3f} to {high:.3f} (1st to 99th percentile, against the pattern)",
        f"  files     {done.directory}: {', '.join(sorted(file.name for file in done.directory.iterdir()))}",
    ]


def _pictures(done: "Dress", pictures: bool, movie: bool) -> list[str]:
    """Draw pictures and movie; a line for each that could not be drawn."""
    film, missing = render.movie_file(done.directory)
    wanted: list[tuple[str, Callable[[], Any]]] = []
    wanted += [("picture", lambda: on_demand.draw_dress(done))] if pictures else []
    wanted += [(film.name, lambda: on_demand.draw_sewing(done, film))] if movie else []
    return [*([missing] if movie and missing else []), *_drawn(done.directory, wanted)]


def _drawn(directory: Path, wanted: list[tuple[str, Callable[[], Any]]]) -> list[str]:
    """Draw what is wanted, by name; a line for each that could not be drawn."""
    trouble = []
    for name, draw in wanted:
        try:
            draw()
            on_demand.record_peak_memory(directory / on_demand.SUMMARY_NAME)
        except (ClothsimError, OSError, ImportError) as error:
            trouble.append(f"No {name}: {error}")
    return trouble
