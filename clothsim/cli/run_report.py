"""Settings and result of a run as text."""

import os
import shlex
import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from clothsim import files
from clothsim.base.text import length, many
from clothsim.cli import on_demand
from clothsim.cli.progress import clock

if TYPE_CHECKING:
    from clothsim import Run
    from clothsim.engine import Session

WIDTH = 100


def existing_files_note(directory: Path) -> str:
    """A note on files that the output directory holds already; empty where there are none."""
    if not directory.is_dir() or not any(directory.iterdir()):
        return ""
    if any((directory / name).is_file() for name in (on_demand.RECORD_NAME, files.TRAJECTORY_NAME)):
        return f"{directory} holds an earlier run, which is replaced."
    return f"{directory} holds other files. They stay; one named as a file of the run is replaced."


def resumption_note(directory: Path) -> str:
    """A note on the time and frame of a run that is resumed."""
    saved = files.read_checkpoint(directory / files.CHECKPOINT_NAME)
    return f"Continues at {saved.time:g} s, after frame {saved.frame}."


def settings(session: "Session", directory: Path, before: str) -> str:
    """The settings of a run, one line each."""
    built, scene, integrator = session.built, session.scene, session.integrator
    solver, run = scene.solver_settings, scene.run_settings
    world = built.world
    on = [name for name in scene.effects if name not in built.off]
    sizes = f"{world.n_cloth:,} vertices and {len(world.triangles):,} triangles of cloth"
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
        steps = f"steps chosen for an error of {length(solver.error)}, of {integrator.dt:g} s at most"
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
        *(("note", note) for note in session.notes),
        *([("note", before)] if before else []),
    ]
    return "\n".join(_row(name, text) for name, text in rows)


def verdict(run: "Run", trouble: list[str]) -> str:
    """The result of a run: status, reason, certificate in three lines, error, final notes, effort, files."""
    summary = run.summary
    files = sorted(path.name for path in run.directory.iterdir() if path.suffix in _ENDINGS and path.is_file())
    rejections = summary["rejected_steps"]
    rejected = f" ({rejections:,} rejected for their error)" if rejections else ""
    restarts = summary.get("restarted_steps", 0)
    rejected += f" ({restarts:,} by backward Euler at impacts)" if restarts else ""
    parts = summary.get("regional_iterations", 0)
    patch_iterations = f" and {parts:,} on patches" if parts else ""
    newton = f"{many(summary['newton_iterations'], 'Newton iteration')}{patch_iterations}"
    effort = (
        f"{clock(summary['wall_seconds'])} ({clock(summary['warmup_seconds'])} to start), "
        f"{many(summary['steps'], 'step')}{rejected}, {newton}, "
        f"{summary['peak_memory_bytes'] / 1e6:.0f} MB of memory at most"
    )
    rows = [
        *run.certificate_rows,
        *(("found", text) for text in summary.get("found", [])),
        ("effort", effort),
        ("files", f"{run.directory}{os.sep}: {', '.join(files)}"),
    ]
    lines = [f"{summary['status']}: {summary['reason']}", *(_row(name, text) for name, text in rows), *trouble]
    if summary["status"] != "completed":
        lines += _after_failure(run)
    return "\n".join(lines)


def _after_failure(run: "Run") -> list[str]:
    """The remedy, the last good state, and the commands that examine and pack the failure."""
    failure = run.summary["failure"]
    saved = files.read_checkpoint(run.directory / files.CHECKPOINT_NAME)
    directory = shlex.quote(str(run.directory))
    return [
        failure["remedy"],
        f"The last good state is step {saved.step} at {saved.time:g} s; the last frame is number {len(run.times) - 1}.",
        f"To examine it: {program()} resume {directory} --dump-iterates {failure['step']}",
        f"To report it: {program()} bundle {directory}",
    ]


def stopped(directory: Path) -> str:
    """The line that follows Ctrl-C."""
    if (directory / files.CHECKPOINT_NAME).is_file():
        return f"Stopped. Continue with: {program()} resume {shlex.quote(str(directory))}"
    return "Stopped before the first step: there is nothing to resume."


_ENDINGS = (".vtkhdf", ".jsonl", ".json", ".npz", ".png", ".mp4", ".gif")


def _row(name: str, text: str) -> str:
    """A name and its text, broken at WIDTH."""
    return textwrap.fill(
        text, WIDTH, initial_indent=f"  {name:<8} ", subsequent_indent=" " * 11, break_long_words=False
    )


def program() -> str:
    """The name of the command line as it was called."""
    return "python -m clothsim" if Path(sys.argv[0]).name == "__main__.py" else "clothsim"
