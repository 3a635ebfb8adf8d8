"""`clothsim run`, `clothsim resume` and `clothsim wrinkle`: a simulation, with its settings and its result as text."""

import argparse
import os
import re
import shlex
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine, files
from clothsim.base.errors import InputError
from clothsim.base.text import length_text, many
from clothsim.cli import on_demand, progress
from clothsim.cli.arguments import add_output_options, add_overwrite, add_set, as_count, as_length, as_positive_number
from clothsim.cli.progress import clock, frame_counter
from clothsim.cli.report import INTERRUPTED, Report, messages, program

if TYPE_CHECKING:
    from clothsim import Run
    from clothsim.engine import Session

ITERATES = "iterates_{}.npz"
"""The file of --dump-iterates."""

_RUN = """\
Simulate a scene. Writes trajectory, record, summary, checkpoint and a picture; failure.png if it fails.

  clothsim run scenes/sphere.toml -o drape --movie
"""
_RESUME = """\
Continue a stopped run from its last frame, or replay a failed one from its last good state, also from
an archive of `clothsim bundle`.

  clothsim resume drape
"""

_WRINKLE = """\
Add wrinkles to a coarse run: waves where its cloth is compressed, as targets of a finer cloth under contact.
Writes the files of a run, whose frames are checked exactly, targets.npy and wrinkles.json.

  clothsim run twist -o coarse --set effects.membrane.compression=0.05
  clothsim wrinkle coarse --cells 4x -o fine
"""


def add_to(commands: Any) -> None:
    """Add the commands to the parser."""
    run = commands.add_parser("run", description=_RUN)
    run.add_argument("scene", type=Path, metavar="SCENE", help="a scene file (TOML), or the name of an example")
    run.add_argument("-o", "--output", type=Path, metavar="DIR", help="output directory (default: the scene's name)")
    run.add_argument("--frames-per-second", metavar="N", help="frames to store per second, instead of the scene's")
    add_set(run, "change a key: body.mesh=PATH")
    run.add_argument("--preset", metavar="NAME", help="draft, standard or fine, with an estimate of the error")
    run.add_argument("--error", metavar="LENGTH", help="choose dt, cells and d_hat for this error: 1mm")
    run.add_argument("--estimate", action="store_true", help="estimate the error by two coarser runs")
    add_overwrite(run, "replace an earlier run in the output directory")
    run.add_argument("--force", action="store_true", help="run at any cost, also from inside a body")
    run.add_argument("--view", action="store_true", help="show it in a browser while it runs (clothsim[view])")
    run.set_defaults(handler=_run)
    resume = commands.add_parser("resume", description=_RESUME)
    resume.add_argument("directory", type=Path, metavar="DIR|FILE", help="the output of `clothsim run` or `bundle`")
    resume.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="output directory for an archive (default: its name)"
    )
    resume.set_defaults(handler=_resume)
    wrinkle = commands.add_parser("wrinkle", description=_WRINKLE)
    wrinkle.add_argument("directory", type=Path, metavar="RUN", help="the output of `clothsim run`")
    wrinkle.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="output directory")
    wrinkle.add_argument("--cells", default="4x", metavar="Nx", help="parts of each edge, 2x to 8x (default: 4x)")
    wrinkle.add_argument(
        "--least-radius", metavar="LENGTH", help="smallest radius of crests, such as 4mm (default: by mechanics)"
    )
    add_overwrite(wrinkle, "replace an earlier run in the output directory")
    wrinkle.set_defaults(handler=_wrinkle, dump_iterates=None)
    for command in (run, resume, wrinkle):
        command.add_argument("--no-picture", action="store_true", help="do not write picture.png or failure.png")
        command.add_argument("--movie", action="store_true", help="also write movie.mp4, or movie.gif without ffmpeg")
        if command is not wrinkle:
            command.add_argument(
                "--dump-iterates", metavar="STEP", help="write the Newton iterates of that step, from 1"
            )
        add_output_options(command, json="print the summary as JSON, the rest on stderr", quiet="print only the result")


PATIENCE = 5.0
"""Time that the page of a run has to end in [s]."""


@contextmanager
def page_of(directory: Path) -> Iterator[None]:
    """Serve the page of a run that is about to begin, by a process of its own.

    Neither slows the other. On a terminal it stays after the run, until Ctrl-C.

    Raises
    ------
    InputError
        viser is not installed.
    """
    if find_spec("viser") is None:
        raise InputError("The page needs the package viser.", "pip install 'clothsim[view]'")
    command = [sys.executable, "-m", "clothsim", "view", str(directory), "--wait"]
    with subprocess.Popen(command, stdout=sys.stderr) as page:
        try:
            yield
            if sys.stderr.isatty() and page.poll() is None:
                print("The page stays open until Ctrl-C.", file=sys.stderr, flush=True)
                page.wait()
        except KeyboardInterrupt:
            pass
        finally:
            page.terminate()
            try:
                page.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                page.kill()


def _run(arguments: argparse.Namespace) -> int:
    if arguments.scene.suffix == ".zip":
        raise InputError(f"{arguments.scene} is not a scene file.", "`clothsim resume` replays an archive.")
    scene = clothsim.load_scene(arguments.scene)
    if arguments.preset is not None:
        scene, settings_text = on_demand.with_preset(scene, arguments.preset)
        messages(arguments)(f"preset {arguments.preset}: {settings_text}")
        scene = engine.replace(scene, "solver.estimate", True)
    scene = engine.override(scene, *arguments.set)
    if arguments.error is not None:
        scene = engine.replace(scene, "solver.error", as_length("--error", arguments.error))
    if arguments.preset is not None and scene.solver_settings.error:
        messages(arguments)(
            f"--error takes precedence over --preset {arguments.preset}: it chooses dt, cells and d_hat, starting from "
            "those of the preset."
        )
    if arguments.estimate:
        scene = engine.replace(scene, "solver.estimate", True)
    if arguments.frames_per_second is not None:
        rate = as_positive_number("--frames-per-second", arguments.frames_per_second)
        scene = replace(scene, run={**scene.run, "frames_per_second": rate})
    directory = arguments.output or Path(arguments.scene.stem)
    step = _dumped_step(arguments)
    pictures = (*on_demand.RUN_PICTURES, *(() if step is None else (ITERATES.format(step),)))
    engine.refuse_earlier_run(directory, arguments.overwrite, pictures, (arguments.scene, scene))
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


def _resume(arguments: argparse.Namespace) -> int:
    directory = arguments.directory
    if directory.is_file():
        archive, directory = directory, arguments.output or Path(directory.stem)
        engine.unpack_bundle(archive, directory)
    elif arguments.output is not None:
        raise InputError(f"{directory} is not an archive.", "Leave -o out: a run continues in its own directory.")
    return _execute(arguments, directory, lambda **listeners: clothsim.resume(directory, **listeners))


def _wrinkle(arguments: argparse.Namespace) -> int:
    match = re.fullmatch(r"(\d{1,9})x", arguments.cells.strip())
    if not match:
        raise InputError(f"--cells is {arguments.cells!r}.", "Give the parts of each edge, such as 4x.")
    parts = int(match[1])
    radius = None if arguments.least_radius is None else as_length("--least-radius", arguments.least_radius)
    run = clothsim.open_run(arguments.directory)
    on_demand.refuse_unfit(run, parts)
    names = (*on_demand.RUN_PICTURES, *on_demand.OWN_FILES)
    engine.refuse_earlier_run(arguments.output, arguments.overwrite, names, (run.directory,))
    message = messages(arguments)

    def job(progress: Any, announce: Any, dump_iterates: None) -> "clothsim.Run":
        return on_demand.wrinkle(
            run,
            parts,
            arguments.output,
            radius,
            message=message,
            overwrite=arguments.overwrite,
            progress=progress,
            announce=announce,
        )

    return _execute(arguments, arguments.output, job)


def _dumped_step(arguments: argparse.Namespace) -> int | None:
    return None if arguments.dump_iterates is None else as_count("--dump-iterates", arguments.dump_iterates)


def _execute(arguments: argparse.Namespace, directory: Path, job: "Callable[..., Run]") -> int:
    """Run `job` with its callbacks, draw the pictures, print the result."""
    subject = arguments.scene if arguments.command == "run" else directory
    step = _dumped_step(arguments)
    if step is not None:
        (directory / ITERATES.format(step)).unlink(missing_ok=True)  # of an earlier run
    message = messages(arguments, subject)
    note = resumption_note if arguments.command == "resume" else existing_files_note
    before = note(directory)

    sessions: list[Session] = []

    def announce(session: "Session") -> None:
        sessions.append(session)
        message(settings(session, directory, before))

    try:
        with progress.progress_on_stderr(arguments.quiet) as listener:
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
        print(stopped(directory), file=sys.stderr)
        return INTERRUPTED
    if step is not None and not (run.directory / ITERATES.format(step)).is_file():
        trouble.append(f"No {ITERATES.format(step)}: the run took {run.summary['steps']} steps.")
    return Report(run.summary, verdict(run, trouble), run.status == "completed", verdict=True).show(arguments)


WIDTH = 100


def existing_files_note(directory: Path) -> str:
    """A note on files that the output directory holds already; empty where there are none."""
    if not directory.is_dir() or not any(directory.iterdir()):
        return ""
    if any((directory / name).is_file() for name in (on_demand.RECORD_NAME, files.TRAJECTORY_NAME)):
        return f"{directory} holds an earlier run, which is replaced."
    return f"{directory} holds other files, which are kept."


def resumption_note(directory: Path) -> str:
    """A note on the time and frame of a run that is resumed."""
    state = files.read_checkpoint(directory / files.CHECKPOINT_NAME).state
    return f"Continues at {state.time:g} s, after frame {state.frame}."


def settings(session: "Session", directory: Path, before: str) -> str:
    """The settings of a run, one line each."""
    built, scene, integrator = session.built, session.scene, session.integrator
    solver, run = scene.solver_settings, scene.run_settings
    world = built.world
    on = [name for name in scene.effects if name not in built.off]
    of_rods = sum(len(rod.positions) for rod, _ in world.rods)
    sizes = f"{world.n_cloth - of_rods:,} vertices and {len(world.triangles):,} triangles of cloth"
    if of_rods:
        sizes = f"{sizes}; {of_rods:,} vertices of rods" if len(world.triangles) else f"{of_rods:,} vertices of rods"
    if world.bodies:
        body_vertices = sum(len(body.positions) for body in world.bodies)
        names = ", ".join(body.name for body in world.bodies)
        sizes += f"; {body_vertices:,} vertices and {len(world.body_triangles):,} triangles of {names}"
    threads = many(integrator.system.solver.threads, "thread")
    kind = {"backward_euler": "backward Euler", "bdf2": "BDF2"}[integrator.formula]
    if "inertia" not in built.energies:
        kind = "quasi-static, loads grow over the duration"
    steps = f"steps of {integrator.dt:g} s"
    if solver.error:
        steps = f"steps chosen for an error of {length_text(solver.error)}, of {integrator.dt:g} s at most"
    end = f"{'until rest, at most ' if run.until == 'rest' else ''}{run.duration:g} s"
    newton = f"to {integrator.settings.tolerance:g} m/s"
    if integrator.settings.error_fraction and "inertia" in built.energies:
        newton = f"to {integrator.settings.error_fraction:g} of the time error"
        newton += ", forces balanced" if integrator.settings.converge else " of the motion"
    rows = [
        ("output", f"{directory}{os.sep}"),
        ("mesh", sizes),
        ("effects", ", ".join(on)),
        *(("off", f"{name}: {reason}") for name, reason in built.off.items()),
        ("time", f"{end} in {steps}, {run.frames_per_second:g} frames a second"),
        ("solver", f"{kind}; Newton {newton}; {integrator.system.solver.name}, {threads}"),
        *(("warning" if note in built.warnings else "note", note) for note in session.notes),
        *([("note", before)] if before else []),
    ]
    return "\n".join(_row(name, text) for name, text in rows)


def verdict(run: "Run", trouble: list[str]) -> str:
    """The result of a run: status, reason, certificate in three lines, error, final notes, effort, files."""
    summary = run.summary
    written = sorted(path.name for path in run.directory.iterdir() if path.suffix in _ENDINGS and path.is_file())
    rejections = summary["rejected_steps"]
    rejected = f" ({rejections:,} rejected for their error)" if rejections else ""
    restarts = summary.get("restarted_steps", 0)
    rejected += f" ({restarts:,} by backward Euler at impacts)" if restarts else ""
    parts = summary.get("regional_iterations", 0)
    patch_iterations = f" and {parts:,} on patches" if parts else ""
    newton = f"{many(summary['newton_iterations'], 'Newton iteration')}{patch_iterations}"
    effort = (
        f"{clock(summary['wall_seconds'])} ({clock(summary['warmup_seconds'])} to start), "
        f"{clock(summary['cpu_seconds'])} of CPU, "
        f"{many(summary['steps'], 'step')}{rejected}, {newton}, "
        f"{summary['peak_memory_bytes'] / 1e6:.0f} MB of memory at most"
    )
    rows = [
        *run.certificate_rows,
        *(("found", text) for text in summary.get("found", [])),
        ("effort", effort),
        ("files", f"{run.directory}{os.sep}: {', '.join(written)}"),
    ]
    lines = [f"{summary['status']}: {summary['reason']}", *(_row(name, text) for name, text in rows), *trouble]
    if summary["status"] != "completed":
        failure, at = summary["failure"], shlex.quote(str(run.directory))
        state = files.read_checkpoint(run.directory / files.CHECKPOINT_NAME).state
        good = f"The last good state is step {state.step} at {state.time:g} s"
        lines += [
            failure["remedy"],
            f"{good}; the last frame is number {len(run.times) - 1}.",
            f"To examine it: {program()} resume {at} --dump-iterates {failure['step']}",
            f"To report it: {program()} bundle {at}",
        ]
    return "\n".join(lines)


def stopped(directory: Path) -> str:
    """The line that follows Ctrl-C."""
    if (directory / files.CHECKPOINT_NAME).is_file():
        return f"Stopped. Continue with: {program()} resume {shlex.quote(str(directory))}"
    return "Stopped before the first step: there is nothing to resume."


_ENDINGS = (".vtkhdf", ".jsonl", ".json", ".npz", ".png", ".mp4", ".webp", ".gif")


def _row(name: str, text: str) -> str:
    """A name and its text, broken at WIDTH."""
    wrapper = textwrap.TextWrapper(WIDTH, break_long_words=False, break_on_hyphens=False)
    wrapper.initial_indent, wrapper.subsequent_indent = f"  {name:<8} ", " " * 11
    return wrapper.fill(text)
