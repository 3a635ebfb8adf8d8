"""`clothsim dress`: a sewing pattern sewn on a body."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine, render
from clothsim.base.errors import ClothsimError, InputError
from clothsim.cli import on_demand, progress
from clothsim.cli.arguments import Renamed, as_positive_number
from clothsim.cli.report import Report, messages

if TYPE_CHECKING:
    from clothsim.garments.dress.dressed import Dress
    from clothsim.garments.stages import Stage

_DESCRIPTION = """\
Sew a pattern (specification.json of GarmentCode and others, or a DXF of AAMA) on a body under contact,
weld its seams and drape it.
Leaves what a run leaves, garment.obj with the pattern as texture, and pictures.

  clothsim dress shirt_specification.json --on body.obj -o worn
  clothsim dress tunic --on shirt -o worn            (a pattern and a body that come with the package)
  clothsim dress shirt_specification.json --on hers.obj --made-for his.obj     (graded by girths and lengths)
"""
LENGTHS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    dress = commands.add_parser("dress", description=_DESCRIPTION)
    dress.add_argument(
        "pattern", type=Path, metavar="PATTERN", help="a specification.json, a .dxf, or the name of an installed one"
    )
    dress.add_argument("--on", required=True, type=Path, metavar="BODY", help="the body: a mesh file or a scene")
    dress.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="output directory (default: the pattern's name)"
    )
    dress.add_argument("--size", default="2cm", metavar="L", help="size of the mesh: 2cm, 15mm, .01 [m] (default 2cm)")
    dress.add_argument("--fabric", metavar="NAME", help="a named fabric (default cotton)")
    dress.add_argument(
        "--fabric-of",
        action="append",
        default=[],
        metavar="PANEL=NAME",
        help="fabric of a panel, as collar=denim, or of several: '*sleeve*=wool'; may be given again",
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
        help="grade by this factor of girth or length, as waist=1.05; may be given again",
    )
    dress.add_argument(
        "--waistband", action="store_true", help="take in upper edges that would slide to the girth of the body"
    )
    dress.add_argument("--hold", dest="waistband", action=Renamed, now="--waistband", nargs=0, const=True)
    dress.add_argument("--origin", default="auto", choices=("auto", "floor", "waist"), help="level y = 0 of the file")
    dress.add_argument("--rotation-order", default="zyx", choices=("zyx", "xyz"), help="of the panels (default zyx)")
    dress.add_argument("--seams", type=Path, metavar="TOML", help="seams and placement of a .dxf (default NAME.toml)")
    dress.add_argument("--scale", metavar="S", help="metres per unit of the body (default: by height)")
    dress.add_argument("--body-group", metavar="NAME", help="this group of the body's file (default: the largest)")
    dress.add_argument("--overwrite", action="store_true", help="replace an earlier run in the directory")
    dress.add_argument("--no-picture", action="store_true", help="draw nothing")
    dress.add_argument("--movie", action="store_true", help="leave movie.mp4 of the sewing, movie.gif without ffmpeg")
    dress.add_argument("--quiet", action="store_true", help="print the end only")
    dress.add_argument("--json", action="store_true", help="print the summary as JSON, the rest on stderr")
    dress.add_argument("--debug", action="store_true", help="show tracebacks")
    dress.set_defaults(handler=_dress)


def as_length(option: str, text: str) -> float:
    """A length in metres from "2cm", "15 mm", ".02". InputError for what is none."""
    unit = next((unit for unit in LENGTHS if text.strip().lower().endswith(unit)), "")
    return as_positive_number(option, text.strip()[: -len(unit)] if unit else text) * LENGTHS.get(unit, 1.0)


def as_fabrics(given: list[str]) -> dict[str, str]:
    """Named fabric by panel from "collar=denim" and the like. InputError for what is none, or a panel given twice."""
    found: dict[str, str] = {}
    for text in given:
        panel, equals, fabric = text.rpartition("=")
        if not (panel and equals and fabric):
            raise InputError(f"--fabric-of is {text!r}.", "Write PANEL=FABRIC, as collar=denim.")
        if panel in found:
            raise InputError(f"--fabric-of names the panel {panel} twice.", "Give it one fabric.")
        found[panel] = fabric
    return found


def as_factors(given: list[str]) -> dict[str, float]:
    """Factor by name from "waist=1.05" and the like. InputError for what is none, or a name given twice."""
    found: dict[str, float] = {}
    for text in given:
        name, equals, factor = text.partition("=")
        if not (name and equals):
            raise InputError(f"--grade is {text!r}.", "Write NAME=FACTOR, as waist=1.05.")
        if name in found:
            raise InputError(f"--grade names {name} twice.", "Give one factor.")
        found[name] = as_positive_number("--grade", factor)
    return found


def _body(path: Path | None) -> Path | None:
    """A body file, or the installed scene of that name."""
    return None if path is None else engine.example_file(path)


def _dress(arguments: argparse.Namespace) -> Report:
    directory = arguments.output or Path(arguments.pattern.stem)

    message = messages(arguments, arguments.pattern)
    pattern = engine.example_file(arguments.pattern, "_specification.json")
    body = _body(arguments.on)
    with progress.shown(arguments.quiet) as listener:
        done = clothsim.dress(
            pattern,
            body,
            directory,
            size=as_length("--size", arguments.size),
            fabric=arguments.fabric,
            fabrics=as_fabrics(arguments.fabric_of),
            made_for=_body(arguments.made_for),
            grade=as_factors(arguments.grade),
            waistband=arguments.waistband,
            origin=arguments.origin,
            rotation_order=arguments.rotation_order,
            seams=arguments.seams,
            scale=None if arguments.scale is None else as_positive_number("--scale", arguments.scale),
            body_group=arguments.body_group,
            overwrite=arguments.overwrite,
            on_stage=lambda stage: message(_stage(stage)),
            progress=listener,
        )
    trouble = _pictures(done, not arguments.no_picture, arguments.movie)
    summary = on_demand.read_summary(directory / on_demand.SUMMARY_NAME) if arguments.json else None
    code = 0 if done.status == "completed" else 1
    return Report(summary, "\n".join([*_verdict(done), *trouble]), code, verdict=True)


def _stage(stage: "Stage") -> str:
    note = f"; {stage.description}" if stage.description else ""
    return f"  {stage.name:<9} {stage.seconds:6.1f} s  {stage.counts}{note}"


def _verdict(done: "Dress") -> list[str]:
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
    trouble = [missing] if movie and missing else []
    for wanted, name, draw in (
        (pictures, "picture", lambda: on_demand.draw_dress(done)),
        (movie, film.name, lambda: on_demand.draw_sewing(done, film)),
    ):
        try:
            if wanted:
                draw()
        except (ClothsimError, OSError, ImportError) as error:
            trouble.append(f"No {name}: {error}")
    return trouble
