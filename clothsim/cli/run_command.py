"""`clothsim run` and `clothsim resume`."""

import argparse
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.cli import on_demand, progress, run_report
from clothsim.cli.arguments import as_count, as_length, as_positive_number
from clothsim.cli.progress import frame_counter
from clothsim.cli.report import Report, messages
from clothsim.cli.view_command import page_of

if TYPE_CHECKING:
    from clothsim import Run, Scene
    from clothsim.engine import Session

ITERATES = "iterates_{}.npz"
"""The file of --dump-iterates."""
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
    if arguments.scene.suffix == ".zip":
        raise InputError(f"{arguments.scene} is no scene file.", "`clothsim resume` replays an archive.")
    scene = clothsim.load_scene(arguments.scene)
    if arguments.preset is not None:
        scene = _with_preset(scene, arguments)
    for assignment in arguments.set:
        scene = engine.override(scene, assignment)
    if arguments.error is not None:
        scene = engine.override(scene, f"solver.error={as_length('--error', arguments.error)!r}")
    if arguments.estimate:
        scene = engine.override(scene, "solver.estimate=true")
    if arguments.frames_per_second is not None:
        rate = as_positive_number("--frames-per-second", arguments.frames_per_second)
        scene = replace(scene, run={**scene.run, "frames_per_second": rate})
    directory = arguments.output or Path(arguments.scene.stem)
    _dumped_step(arguments)
    engine.refuse_earlier_run(directory, arguments.overwrite)
    let_finish = engine.start_precompiling()
    with page_of(directory) if arguments.view else nullcontext():
        code = _execute(
            arguments,
            directory,
            lambda **listeners: clothsim.simulate(
                scene,
                directory,
                message=messages(arguments),
                overwrite=arguments.overwrite,
                force=arguments.force,
                **listeners,
            ),
        )
    if code != INTERRUPTED:
        let_finish()  # the rest of its kernels serves the next run
    return code


def _with_preset(scene: "Scene", arguments: argparse.Namespace) -> "Scene":
    """The scene with the settings of a preset, whose error is estimated; prints them."""
    scene, settings_text = on_demand.with_preset(scene, arguments.preset)
    messages(arguments)(f"preset {arguments.preset}: {settings_text}")
    return engine.replace(scene, "solver.estimate", True)


def _resume(arguments: argparse.Namespace) -> int:
    directory = arguments.directory
    if directory.is_file():
        archive, directory = directory, arguments.output or Path(directory.stem)
        engine.unpack_bundle(archive, directory)
    elif arguments.output is not None:
        raise InputError(f"{directory} is no archive.", "Leave -o out: a run continues in its own directory.")
    return _execute(arguments, directory, lambda **listeners: clothsim.resume(directory, **listeners))


def _dumped_step(arguments: argparse.Namespace) -> int | None:
    return None if arguments.dump_iterates is None else as_count("--dump-iterates", arguments.dump_iterates)


def _execute(arguments: argparse.Namespace, directory: Path, job: "Callable[..., Run]") -> int:
    """Run `job` with its callbacks, draw the pictures, print the result."""
    subject = arguments.scene if arguments.command == "run" else directory
    step = _dumped_step(arguments)
    if step is not None:
        (directory / ITERATES.format(step)).unlink(missing_ok=True)  # of an earlier run
    message = messages(arguments, subject)
    note = run_report.existing_files_note if arguments.command == "run" else run_report.resumption_note
    before = note(directory)

    sessions: list[Session] = []

    def announce(session: "Session") -> None:
        sessions.append(session)
        message(run_report.settings(session, directory, before))

    try:
        with progress.shown(arguments.quiet) as listener:
            run = job(progress=listener, announce=announce, dump_iterates=step)
        trouble = engine.draw_pictures(
            run,
            sessions[-1].built.world,
            picture=not arguments.no_picture,
            movie=arguments.movie,
            message=lambda line: None if arguments.quiet else print(line, file=sys.stderr, flush=True),
            progress=frame_counter(arguments.quiet),
        )
    except KeyboardInterrupt:
        print(run_report.stopped(directory), file=sys.stderr)
        return INTERRUPTED
    if step is not None and not (run.directory / ITERATES.format(step)).is_file():
        trouble.append(f"No {ITERATES.format(step)}: the run took {run.summary['steps']} steps.")
    code = 0 if run.status == "completed" else 1
    return Report(run.summary, run_report.verdict(run, trouble), code, verdict=True).show(arguments)
