"""`clothsim run` and `clothsim resume`."""

import argparse
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from clothsim.base.errors import InputError
from clothsim.cli.arguments import as_count, as_length, as_positive_number

if TYPE_CHECKING:
    from clothsim import Run, Scene
    from clothsim.engine import Session

INTERRUPTED = 130
"""Exit code after Ctrl-C."""

_RUN = """\
Simulate a scene. Leaves trajectory, record, summary, checkpoint and a picture; where it failed, failure.png too.

  clothsim run scenes/sphere.toml -o drape --movie
"""
_RESUME = """\
Continue a run that was stopped, from its last frame; or replay one that failed, from its last good state, also from
an archive of `clothsim bundle`.

  clothsim resume drape
"""


def add_to(commands: Any) -> None:
    """Add both commands to the parser."""
    run = commands.add_parser("run", description=_RUN)
    run.add_argument("scene", type=Path, metavar="SCENE", help="a scene file (TOML), or the name of an example")
    run.add_argument("-o", "--output", type=Path, metavar="DIR", help="output directory (default: the scene's name)")
    run.add_argument("--frames-per-second", metavar="N", help="frames to keep, instead of the scene's number")
    run.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change a key: body.mesh=PATH")
    run.add_argument("--preset", metavar="NAME", help="draft, standard or fine, with the error of this run")
    run.add_argument("--error", metavar="LENGTH", help="choose dt, cells and d_hat for this error: 1mm")
    run.add_argument("--estimate", action="store_true", help="estimate the error by another, coarser run")
    run.add_argument("--overwrite", action="store_true", help="replace an earlier run in the output directory")
    run.add_argument("--force", action="store_true", help="run whatever it is expected to cost")
    run.add_argument("--view", action="store_true", help="show it in a browser while it runs (clothsim[view])")
    run.set_defaults(handler=_run)
    resume = commands.add_parser("resume", description=_RESUME)
    resume.add_argument("directory", type=Path, metavar="DIR|FILE", help="the output of `clothsim run` or `bundle`")
    resume.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="of an archive: output directory (default: its name)"
    )
    resume.set_defaults(handler=_resume)
    for command in (run, resume):
        command.add_argument("--no-picture", action="store_true", help="leave no picture.png and no failure.png")
        command.add_argument("--movie", action="store_true", help="leave movie.mp4 too, movie.gif without ffmpeg")
        command.add_argument("--dump-iterates", metavar="STEP", help="write the Newton iterates of that step, from 1")
        command.add_argument("--quiet", action="store_true", help="print the end only")
        command.add_argument("--json", action="store_true", help="print the summary as JSON, the rest on stderr")
        command.add_argument("--debug", action="store_true", help="show tracebacks")


def _run(arguments: argparse.Namespace) -> int:
    from clothsim import load_scene, simulate
    from clothsim.cli import precompile, view_beside
    from clothsim.engine import override, refuse_earlier_run, scene_file

    if arguments.scene.suffix == ".zip":
        raise InputError(f"{arguments.scene} is no scene file.", "`clothsim resume` replays an archive.")
    scene = load_scene(scene_file(arguments.scene))
    if arguments.preset is not None:
        scene = _with_preset(scene, arguments)
    for assignment in arguments.set:
        scene = override(scene, assignment)
    if arguments.error is not None:
        scene = override(scene, f"solver.error={as_length('--error', arguments.error)!r}")
    if arguments.estimate:
        scene = override(scene, "solver.estimate=true")
    if arguments.frames_per_second is not None:
        rate = as_positive_number("--frames-per-second", arguments.frames_per_second)
        scene = replace(scene, run={**scene.run, "frames_per_second": rate})
    directory = arguments.output or Path(arguments.scene.stem)
    _dumped_step(arguments)
    refuse_earlier_run(directory, arguments.overwrite)
    compiler = precompile.start()
    with view_beside.page_of(directory) if arguments.view else nullcontext():
        code = _execute(
            arguments,
            directory,
            lambda **listeners: simulate(
                scene,
                directory,
                message=_teller(arguments),
                overwrite=arguments.overwrite,
                force=arguments.force,
                **listeners,
            ),
        )
    if compiler is not None and code != INTERRUPTED:
        precompile.let_finish(compiler)  # the rest of its kernels serves the next run
    return code


def _teller(arguments: argparse.Namespace) -> "Callable[[str], None]":
    """Print the lines of solver.error and solver.estimate."""
    talk: IO[str] = sys.stderr if arguments.json else sys.stdout
    return (lambda line: None) if arguments.quiet else (lambda line: print(line, file=talk, flush=True))


def _with_preset(scene: "Scene", arguments: argparse.Namespace) -> "Scene":
    """The scene with the settings of a preset, whose error is estimated; prints them."""
    from clothsim.engine import set_key, with_preset

    scene, settings_text = with_preset(scene, arguments.preset)
    if not arguments.quiet:
        talk: IO[str] = sys.stderr if arguments.json else sys.stdout
        print(f"preset {arguments.preset}: {settings_text}", file=talk, flush=True)
    return set_key(scene, "solver.estimate", True)


def _resume(arguments: argparse.Namespace) -> int:
    from clothsim import resume

    directory = arguments.directory
    if directory.is_file():
        from clothsim.engine import unpack_bundle

        archive, directory = directory, arguments.output or Path(directory.stem)
        unpack_bundle(archive, directory)
    elif arguments.output is not None:
        raise InputError(f"{directory} is no archive.", "Leave -o out: a run continues in its own directory.")
    return _execute(arguments, directory, lambda **listeners: resume(directory, **listeners))


def _dumped_step(arguments: argparse.Namespace) -> int | None:
    return None if arguments.dump_iterates is None else as_count("--dump-iterates", arguments.dump_iterates)


def _execute(arguments: argparse.Namespace, directory: Path, job: "Callable[..., Run]") -> int:
    """Run `job` with its callbacks, draw the pictures, print the result."""
    from clothsim import __version__
    from clothsim.cli import progress, run_report
    from clothsim.engine import iterates_name

    subject = arguments.scene if arguments.command == "run" else directory
    step = _dumped_step(arguments)
    if step is not None:
        (directory / iterates_name(step)).unlink(missing_ok=True)  # of an earlier run
    talk: IO[str] = sys.stderr if arguments.json else sys.stdout
    if not arguments.quiet:
        print(f"clothsim {__version__}: {arguments.command} {subject}", file=talk, flush=True)
    note = run_report.existing_files_note if arguments.command == "run" else run_report.resumption_note
    before = note(directory)

    sessions: list[Session] = []

    def announce(session: "Session") -> None:
        sessions.append(session)
        if not arguments.quiet:
            print(run_report.settings(session, directory, before), file=talk, flush=True)

    try:
        with progress.shown(arguments.quiet) as listener:
            run = job(progress=listener, announce=announce, dump_iterates=step)
        trouble = _pictures(arguments, run, sessions[-1])
    except KeyboardInterrupt:
        print(run_report.stopped(directory), file=sys.stderr)
        return INTERRUPTED
    if arguments.json:
        from clothsim.base.safe_files.record import to_json

        print(to_json(run.summary))
    if step is not None and not (run.directory / iterates_name(step)).is_file():
        trouble.append(f"No {iterates_name(step)}: the run took {run.summary['steps']} steps.")
    print(run_report.verdict(run, trouble), file=talk)
    return 0 if run.status == "completed" else 1


def _pictures(arguments: argparse.Namespace, run: "Run", session: "Session") -> list[str]:
    """Draw picture, movie and the place of a failure.

    Returns a line for each that could not be drawn, which does not change the status of the run.
    """
    from clothsim.base.errors import ClothsimError
    from clothsim.cli.render_command import frame_counter
    from clothsim.engine import (
        FAILURE_NAME,
        GIF_NAME,
        MOVIE_NAME,
        PICTURE_NAME,
        draw_failure,
        draw_frame,
        draw_movie,
        upright,
    )
    from clothsim.render import has_ffmpeg

    for name in (PICTURE_NAME, MOVIE_NAME, GIF_NAME, FAILURE_NAME):
        (run.directory / name).unlink(missing_ok=True)
    directory, up, trouble = run.directory, upright(run.directory), []
    jobs: list[tuple[str, Callable[[], Any]]] = []
    if not arguments.no_picture:
        jobs.append((PICTURE_NAME, lambda: draw_frame(run.trajectory, directory / PICTURE_NAME, up=up)))
        failure, world = run.summary.get("failure") or {}, session.built.world
        if failure.get("position") is not None:
            target = directory / FAILURE_NAME
            jobs.append((FAILURE_NAME, lambda: draw_failure(directory, failure, world, target, up)))
    if arguments.movie:
        counter = frame_counter(arguments.quiet)
        film = MOVIE_NAME if has_ffmpeg() else GIF_NAME
        if film == GIF_NAME:
            trouble.append(f"{film}, not {MOVIE_NAME}: ffmpeg is missing. Run: pip install 'clothsim[movies]'")
        jobs.append((film, lambda: draw_movie(run.trajectory, directory / film, counter, up=up)))
    for name, job in jobs:
        if not arguments.quiet:
            print(f"drawing {name}", file=sys.stderr, flush=True)
        try:
            job()
        except (ClothsimError, OSError, ImportError) as error:
            trouble.append(f"No {name}: {error}")
    return trouble
