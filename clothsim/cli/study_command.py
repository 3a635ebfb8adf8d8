"""`clothsim study`: error against computing time."""

import argparse
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import engine
from clothsim.base.file_writing import refuse_replacing
from clothsim.cli import on_demand
from clothsim.cli.arguments import (
    Renamed,
    add_output_options,
    add_overwrite,
    add_set,
    as_count,
    as_seconds,
    loss_of,
    scene_of,
    words,
)
from clothsim.cli.progress import SECONDS_BETWEEN_LINES, clock, listener_for
from clothsim.cli.report import Report, messages

if TYPE_CHECKING:
    from clothsim import Scene
    from clothsim.study.evaluation import StudyProgress
    from clothsim.study.goal_report import NamedGoal

FILES = ("study.md", "study.json", "study.png", "goal.png")

_DESCRIPTION = """\
Measure the error of a scene's last frame, the sources of that error, and what a smaller one would cost. Runs the scene
with finer and coarser settings, one process for each core, and writes study.md, study.json and study.png. A repeated
call continues from the stored runs. If the budget is too small to refine dt and cells, the answer is the budget that is
needed, not an error (exit code 1).

  clothsim study scenes/study_strip.toml -o accuracy --budget 120s
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    study = commands.add_parser("study", description=_DESCRIPTION)
    study.add_argument("scene", type=Path, metavar="SCENE", help="a scene file (TOML)")
    study.add_argument("-o", "--output", type=Path, metavar="DIR", help="output directory (default: SCENE_study)")
    study.add_argument("--parameters", metavar="NAMES", help="dt,cells,tolerance,d_hat,eps_v,iterations (default: all)")
    study.add_argument("--knobs", dest="parameters", action=Renamed, now="--parameters")
    study.add_argument("--goal", metavar="GOAL", help="show which triangles cause its error: hem, girth=0.8, ...")
    study.add_argument("--budget", default="120s", metavar="TIME", help="CPU time of all its processes: 90s, 10min")
    study.add_argument("--workers", metavar="N", help="processes at a time (default: one per core)")
    add_set(study)
    add_overwrite(study)
    add_output_options(
        study, json="print study.json, the rest on stderr", quiet="print only the result", handler=_study
    )


def _study(arguments: argparse.Namespace) -> Report:
    budget = as_seconds("--budget", arguments.budget)
    parameters = None if arguments.parameters is None else words("--parameters", arguments.parameters, "dt,cells")
    workers = None if arguments.workers is None else as_count("--workers", arguments.workers)
    scene = scene_of(arguments)
    goal = None if arguments.goal is None else _goal(arguments.goal, scene)
    directory = arguments.output or Path(f"{arguments.scene.stem}_study")
    if not (directory / on_demand.FOLDER).is_dir():  # else a study that goes on
        refuse_replacing([directory / name for name in FILES], arguments.overwrite, (arguments.scene,))
    messages(arguments, arguments.scene)
    with study_progress(arguments.quiet) as progress, terminated() as stopped:
        named: dict[str, Any] = {"name": arguments.scene.stem, **({} if goal is None else {"goal": goal})}
        named["stopped"] = stopped
        done = clothsim.study_accuracy(scene, directory, parameters, budget, workers, progress, **named)
    lines = on_demand.answer_lines(done.result)
    lines += [
        f"  for <= {each['error']:g} mm: {on_demand.settings_text(each['settings'])}, about {each['seconds']:.2g} s"
        for each in done.result["recommended"]
    ]
    if goal is not None:
        lines += on_demand.goal_lines(done.result["goal"])
    left = len(done.result["left_out"])
    if left:
        lines.append(f"{left} runs exceeded the budget or are not valid: study.md names them.")
    files = ", ".join(name for name in FILES if (directory / name).is_file())
    document = on_demand.read_summary(done.directory / "study.json") if arguments.json else None
    answered = done.result["headline"]["status"] != on_demand.UNFINISHED
    return Report(document, "\n".join([*lines, f"  files     {directory}: {files}"]), answered, verdict=True)


def _goal(text: str, scene: "Scene") -> "NamedGoal":
    """The goal of --goal; InputError for one that is none, before anything runs."""
    loss_of(text, engine.build(scene, affordable=True).world, "--goal")
    return on_demand.NamedGoal(text, lambda world: loss_of(text, world, "--goal"))


@contextmanager
def terminated() -> "Iterator[Callable[[], bool]]":
    """A function that is True once SIGTERM came: the study then ends its workers, and with what it has."""
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():  # which alone receives signals
        yield lambda: False
        return
    before = signal.signal(signal.SIGTERM, lambda number, frame: came.append(number))
    try:
        yield lambda: bool(came)
    finally:
        signal.signal(signal.SIGTERM, before)


def study_progress(quiet: bool) -> "AbstractContextManager[Callable[[StudyProgress], None]]":
    """A callback that shows the progress of a study on stderr: a bar on a terminal, else a line every few seconds."""
    return listener_for(quiet, _bar, _lines())


def _lines() -> "Callable[[StudyProgress], None]":
    last = [-SECONDS_BETWEEN_LINES]

    def listener(progress: "StudyProgress") -> None:
        if progress.seconds - last[0] >= SECONDS_BETWEEN_LINES:
            last[0] = progress.seconds
            print(_state(progress), file=sys.stderr, flush=True)

    return listener


@contextmanager
def _bar() -> "Iterator[Callable[[StudyProgress], None]]":
    columns = (on_demand.BarColumn(bar_width=24), on_demand.TextColumn("{task.fields[state]}"))
    with on_demand.Bar(*columns, console=on_demand.Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0, state="")

        def listener(progress: "StudyProgress") -> None:
            bar.update(task, total=progress.budget, completed=progress.seconds, state=_state(progress))

        yield listener


def _state(progress: "StudyProgress") -> str:
    """Time of the budget, runs done, the one that began or ended."""
    time = f"{clock(progress.seconds)} of {clock(progress.budget)}"
    return f"{time}: {progress.done} runs done, {progress.known - progress.done} to go ({progress.label})"
