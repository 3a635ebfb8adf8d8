"""`clothsim study` and `test`: error against computing time; a standard test of a fabric, simulated."""

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
from clothsim.base.file_writing import make_directory, refuse_replacing, write_atomically
from clothsim.cli import on_demand
from clothsim.cli.arguments import (
    Renamed,
    add_output_options,
    add_overwrite,
    add_set,
    as_count,
    as_length,
    as_seconds,
    assigned_number,
    loss_of,
    scene_of,
    words,
)
from clothsim.cli.progress import SECONDS_BETWEEN_LINES, clock, listener_for
from clothsim.cli.report import Report, messages

if TYPE_CHECKING:
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
    test = commands.add_parser("test", description=_TEST)
    test.add_argument("fabric", metavar="FABRIC", help="a named fabric (`clothsim fabrics` lists them)")
    methods = ("cusick", "cantilever", "bias", "tensile", "shear")
    test.add_argument("--method", choices=methods, default="cusick", help="the test (default cusick)")
    test.add_argument("--lays", metavar="N", help="specimens (default 16 lays, or 3 strips of each direction)")
    test.add_argument("--size", metavar="L", help="distance between vertices of a drape (default 6mm)")
    test.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a key of [cloth] to replace")
    test.add_argument("-o", "--output", type=Path, metavar="DIR", help="write test.json (and drape.png) there")
    add_overwrite(test)
    test.add_argument("--quiet", action="store_true", help="print only the result")
    test.add_argument("--json", action="store_true", help="print test.json, the rest on stderr")
    test.add_argument("--debug", action="store_true", help="show tracebacks")
    test.set_defaults(handler=_test)


def _study(arguments: argparse.Namespace) -> Report:
    budget = as_seconds("--budget", arguments.budget)
    parameters = None if arguments.parameters is None else words("--parameters", arguments.parameters, "dt,cells")
    workers = None if arguments.workers is None else as_count("--workers", arguments.workers)
    scene = scene_of(arguments)
    goal: NamedGoal | None = None
    if (text := arguments.goal) is not None:
        loss_of(text, engine.build(scene, affordable=True).world, "--goal")  # refuses what is none before anything runs
        goal = on_demand.NamedGoal(text, lambda world: loss_of(text, world, "--goal"))
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
    last = [-SECONDS_BETWEEN_LINES]

    def listener(progress: "StudyProgress") -> None:
        if progress.seconds - last[0] >= SECONDS_BETWEEN_LINES:
            last[0] = progress.seconds
            print(_state(progress), file=sys.stderr, flush=True)

    return listener_for(quiet, _bar, listener)


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


_TEST = """\
Simulate a standard test of a fabric: cusick, the drape of ISO 9073-9 (coefficient, folds, their depth over many lays);
cantilever, the bending length of ASTM D1388; tensile, bias and shear, force against stretch. Each value comes with its
spread over the specimens and with what is known of its error.

  clothsim test cotton --method cusick
  clothsim test denim --method cantilever --set bending_warp=3e-5
"""


TEST_NAME, DRAPE_NAME = "test.json", "drape.png"


def _test(arguments: argparse.Namespace) -> Report:
    engine.fabric_named("FABRIC", arguments.fabric)
    lays = None if arguments.lays is None else as_count("--lays", arguments.lays)
    cloth = {"fabric": arguments.fabric, **dict(assigned_number(text) for text in arguments.set)}
    size = {} if arguments.size is None else {"size": as_length("--size", arguments.size, "6mm")}
    if arguments.output is not None:
        refuse_replacing([arguments.output / name for name in (TEST_NAME, DRAPE_NAME)], arguments.overwrite)
    message = messages(arguments, f"{arguments.fabric} by {arguments.method}")
    done = on_demand.fabric_tested(cloth, arguments.method, lays, message=message, **size)
    lines = done.text()
    if arguments.output is not None:
        make_directory(arguments.output)
        write_atomically(arguments.output / TEST_NAME, on_demand.to_json(done.document()).encode())
        files = [TEST_NAME]
        if arguments.method == "cusick":
            on_demand.draw_drape(done, arguments.output / DRAPE_NAME)
            files.append(DRAPE_NAME)
        lines += f"\n  files     {arguments.output}: {', '.join(files)}"
    return Report(done.document(), lines, verdict=True)
