"""`clothsim farm`, `sweep` and `learn`: many drapes of one recipe, none lost, and a model of them."""

import argparse
import contextlib
import re
import signal
import sys
import threading
import tomllib
from collections.abc import Iterator
from dataclasses import asdict
from math import isnan
from pathlib import Path
from time import sleep
from types import FrameType
from typing import TYPE_CHECKING, Any

from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.base.file_writing import refuse_replacing
from clothsim.base.inputs import nearest
from clothsim.base.text import text_table
from clothsim.cli import on_demand
from clothsim.cli.arguments import (
    Parser,
    Renamed,
    add_output_options,
    add_overwrite,
    add_set,
    as_count,
    as_positive_number,
    as_seconds,
    refuse_output,
    scene_of,
)
from clothsim.cli.progress import clock
from clothsim.cli.report import Report

if TYPE_CHECKING:
    from clothsim.study.farm.drape import Drape
    from clothsim.study.farm.plan import DrapeJob, Farm
    from clothsim.study.farm.recipe import Recipe
    from clothsim.study.farm.status import Status

_LEARN = """\
Learn a model of the drapes of a farm as a function of its varied numbers, for [seed] from = "model". With --motion it
is of a garment on moving bodies, from a farm of clips or its recipe; errors are those on what was held out.

  clothsim learn drapes -o model.npz
  clothsim learn shirt_in_motion --motion -o moving.npz     farm and training in one command
  clothsim learn moving_farm --motion --model recurrent -o moving.npz      a recurrent network too; the best is written
"""


def add_to(commands: Any) -> None:
    """Add the commands to the parser."""
    farm = commands.add_parser("farm", description=_FARM)
    actions = farm.add_subparsers(metavar="ACTION", dest="action", parser_class=Parser, required=True)
    plan, sample, work = _add_making(actions)
    status = actions.add_parser("status", help="count what is done, failed and left")
    status.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm")
    status.add_argument("--watch", action="store_true", help="print it every 2 s until all drapes are done")
    status.set_defaults(handler=_status)
    verify = actions.add_parser("verify", help="check all files, make some drapes again")
    verify.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm")
    verify.add_argument("--fraction", default="0.01", metavar="X", help="drapes to make again (default 0.01; 0: none)")
    verify.add_argument("--share", dest="fraction", action=Renamed, now="--fraction")
    verify.set_defaults(handler=_verify)
    mend = actions.add_parser("repair", help="take torn and killed drapes back into the plan")
    mend.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm")
    mend.add_argument("--cause", action="append", metavar="NAME", help="also drapes of this cause, as refused")
    mend.set_defaults(handler=_repair)
    pack = actions.add_parser("pack", help="write a data set: one HDF5 file, or a folder of WebDataset shards")
    pack.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm")
    pack.add_argument("-o", "--output", type=Path, metavar="FILE|DIR", required=True, help="data.h5, or a folder")
    pack.add_argument("--shard", default="1000", metavar="N", help="drapes of a shard (default 1000)")
    pack.add_argument("--sheet", action="store_true", help="leave contact sheets (PNG, HTML) beside it")
    add_overwrite(pack)
    pack.set_defaults(handler=_pack)
    for action in (plan, sample, work, status, verify, mend, pack):
        add_output_options(action, json="print the result as JSON", quiet="print nothing but errors")
    sweep = commands.add_parser("sweep", description=_SWEEP)
    sweep.add_argument("scene", type=Path, metavar="SCENE", help="a scene file (TOML), or the name of an example")
    sweep.add_argument("--vary", action="append", default=[], metavar="KEY=A,B,C", help="a key and its values")
    add_set(sweep, "change a key of all")
    sweep.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder (default: the scene's name_sweep)")
    add_output_options(sweep, json="print the rows as JSON", quiet="print nothing but errors", handler=_sweep)
    learn = commands.add_parser("learn", usage="clothsim learn DIR -o FILE [options]", description=_LEARN)
    learn.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm; with --motion also a recipe")
    learn.add_argument("-o", "--output", type=Path, metavar="FILE", required=True, help="the model, an .npz file")
    learn.add_argument("--held-out", type=float, metavar="F", help="fraction held out (default 0.25)")
    learn.add_argument(
        "--components", type=int, metavar="K", help="principal components (default 16, with --motion 48)"
    )
    _add_motion(learn)
    add_overwrite(learn)
    add_output_options(learn, json="print the errors as JSON", quiet="print nothing but errors", handler=_learn)


MODELS = ("skinned", "nearest", "ridge", "recurrent")
"""Kinds of models of motion; a test compares them with those of the package."""


def _add_motion(learn: Parser) -> None:
    """Add the options of models of motion."""
    learn.add_argument("--motion", action="store_true", help="learn a garment in motion, from a farm of clips")
    learn.add_argument("--held-kind", metavar="KIND", help="with --motion: kind held out (default: drawn)")
    learn.add_argument("--held-bodies", default="2", metavar="N", help="with --motion: bodies held out (default 2)")
    learn.add_argument("--model", choices=["recurrent"], help="with --motion: this too (clothsim[learn])")
    learn.add_argument("--kind", choices=MODELS, help="with --motion: write that kind of model, not the best")
    learn.add_argument("--seed", default="0", metavar="N", help="with --motion: of all that is drawn (default 0)")


def _add_making(actions: Any) -> tuple[Parser, Parser, Parser]:
    """Add the actions that make drapes: plan, sample, work."""
    plan = actions.add_parser("plan", help="write the scene and values of every drape")
    plan.add_argument("recipe", type=Path, metavar="RECIPE", help=_RECIPE)
    plan.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="folder of the farm")
    plan.add_argument("--no-pilot", action="store_true", help="make no drape first to test the recipe")
    plan.set_defaults(handler=_plan)
    sample = actions.add_parser("sample", help="plan, make, verify and pack the drapes of a recipe, in one process")
    sample.add_argument("recipe", type=Path, metavar="RECIPE", help=_RECIPE)
    sample.add_argument(
        "-o", "--output", type=Path, metavar="DIR", required=True, help="folder; its data.h5 is the set"
    )
    sample.set_defaults(handler=_sample)
    work = actions.add_parser("work", help="make the drapes that are left")
    work.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm")
    how = work.add_mutually_exclusive_group()
    how.add_argument("--workers", metavar="N", help="processes of Dask on this machine (default: this process)")
    how.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask scheduler: tcp://host:8786")
    work.add_argument("--attempts", default="3", metavar="N", help="tries before a drape counts as killed (default 3)")
    work.add_argument("--stale", default="60s", metavar="TIME", help="a claim without heartbeat ends (default 60s)")
    work.set_defaults(handler=_work)
    return plan, sample, work


SHIPPED = ("shirt_by_body", "skirt_by_fabric", "outfit_by_pose", "outfit_that_walks", "shirt_in_motion")
"""Recipes that come with the package."""
_RECIPE = f"a TOML file with [farm] and [vary], or {', '.join(SHIPPED)}"
FAULT = 1
"""Exit code where a drape is torn or differs."""

_FARM = """\
Make many drapes of one recipe. Each is published exactly once, even where processes are killed. DIR is a folder that
all machines share.

  clothsim farm sample shirt_by_body -o drapes  50 drapes of a recipe that ships, all steps at once: two minutes
  clothsim farm plan recipe.toml -o drapes
  clothsim farm work drapes                    once for each core, on any machine
  clothsim farm work drapes --workers 8        with Dask: pip install 'clothsim[farm]'
  clothsim farm status drapes --watch
  clothsim farm verify drapes                  compare all files with their hashes, make some drapes again, sign off
  clothsim farm repair drapes                  put torn and killed drapes back into the plan
  clothsim farm pack drapes -o data.h5         or a folder, for shards
"""


_SWEEP = """\
Run a scene with every combination of the values of some keys, and list the results: a farm in one process.

  clothsim sweep sphere --vary cloth.fabric=cotton,denim --vary solver.dt=0.02,0.01 -o sweep

The same command continues a stopped sweep; `clothsim farm work DIR` helps it from another process.
"""


RECIPE = ".recipe"
"""Ending of the recipes that come with the package, TOML files beside its scenes."""
SAMPLE_FRACTION, SAMPLE_DATA = 0.02, "data.h5"
"""Drapes of a sample that are made again, and the file of its data set."""


def _sample(arguments: argparse.Namespace) -> Report | int:
    worked, verified = _make(_recipe(arguments.recipe), arguments.output, arguments)
    if not isinstance(worked, Report):
        return worked
    farm = on_demand.open_farm(arguments.output)
    packed = on_demand.pack(farm, arguments.output / SAMPLE_DATA, overwrite=True)  # its own, of the same drapes
    file = packed.files[0]
    text = f"{worked.text}\n{verified.whole} drapes verified, {verified.repeated} made again; {packed.drapes} in {file}"
    return Report({**worked.document, "verified": verified.whole, "packed": packed.drapes, "file": str(file)}, text)


def _make(recipe: "Recipe", directory: Path, arguments: argparse.Namespace) -> tuple[Report | int, Any]:
    """Plan, make and verify the drapes of a recipe in a folder: a report, or an exit code, and the verification."""
    on_demand.refuse_other_plan(recipe, directory)
    on_demand.refuse_unbuildable(recipe)
    on_demand.plan(recipe, directory)
    usual = {"directory": directory, "workers": None, "scheduler": None, "attempts": "3", "stale": "60s"}
    worked = _work(argparse.Namespace(**{**vars(arguments), **usual}))
    if not isinstance(worked, Report):
        return worked, None
    verified = on_demand.verify(on_demand.open_farm(directory), SAMPLE_FRACTION)
    if not verified.good:
        raise InputError(f"{directory} is not signed off.", f"See `clothsim farm verify {directory}`.")
    return worked, verified


def _recipe(path: Path) -> "Recipe":
    """The recipe in a file, or the shipped one of that name. InputError that lists these for another name."""
    file = engine.example_file(path, RECIPE)
    if not file.exists():
        hint = nearest(path.name.removesuffix(RECIPE), SHIPPED)
        known = f"{', '.join(SHIPPED)} come with the package; else name a TOML file with [farm] and [vary]."
        raise InputError(f"There is no recipe {path}.", hint or known)
    return on_demand.load_recipe(file)


def _plan(arguments: argparse.Namespace) -> Report:
    recipe = _recipe(arguments.recipe)
    on_demand.refuse_other_plan(recipe, arguments.output)
    on_demand.refuse_unbuildable(recipe)
    made = None if arguments.no_pilot else on_demand.pilot(recipe)
    farm = on_demand.plan(recipe, arguments.output)
    lines = [f"{farm.directory}: {len(farm.jobs)} drapes planned. `clothsim farm work {farm.directory}` makes them."]
    if made is not None:
        left = clock(len(farm.jobs) * made.cpu_seconds)
        lines.append(
            f"A pilot, drape {made.index}, is usable after {made.time:g} s. It took {made.cpu_seconds:.1f} CPU s; "
            f"all take about {left} of one core."
        )
    pilot = None if made is None else asdict(made)
    return Report({"directory": str(farm.directory), "planned": len(farm.jobs), "pilot": pilot}, "\n".join(lines))


def _work(arguments: argparse.Namespace) -> Report | int:
    farm = on_demand.open_farm(arguments.directory)
    attempts = as_count("--attempts", arguments.attempts)
    stale = as_seconds("--stale", arguments.stale)
    with terminated_like_interrupted():
        try:
            if arguments.workers is None and arguments.scheduler is None:
                on_demand.work(
                    farm,
                    on_demand.worker_of(stale),
                    attempts,
                    None if arguments.quiet or arguments.json else _line(farm),
                )
            else:
                _work_with_dask(arguments, farm, attempts, stale)
        except KeyboardInterrupt:
            left = len(farm.unpublished())
            print(f"Stopped: {left} drapes are left. `clothsim farm work {farm.directory}` goes on.", file=sys.stderr)
            return 130
        except on_demand.LostWorkersError as error:
            print(f"{error.sentence} {error.remedy}", file=sys.stderr)
            return FAULT
    on_demand.write_manifest(farm)
    if farm.plan_fault:
        raise InputError(f"{farm.plan_fault} The drapes of its other lines are made.", on_demand.REPLAN)
    state = on_demand.status(farm)
    return Report(asdict(state), _text(state))


def _work_with_dask(arguments: argparse.Namespace, farm: "Farm", attempts: int, stale: float) -> None:
    def announce(link: str) -> None:
        if not arguments.quiet:
            print(f"dashboard: {link}", file=sys.stderr, flush=True)

    workers = 1 if arguments.workers is None else as_count("--workers", arguments.workers)
    on_demand.work_with_dask(farm, arguments.scheduler, workers, attempts, announce, stale)


def _status(arguments: argparse.Namespace) -> Report:
    farm = on_demand.open_farm(arguments.directory)
    while True:
        state = on_demand.status(farm)
        report = Report(asdict(state), _text(state))
        if not arguments.watch or state.published == state.planned:
            return report
        report.show(arguments)
        sleep(2.0)


def _verify(arguments: argparse.Namespace) -> Report:
    none = bool(re.fullmatch(r"0+(\.0*)?|\.0+", arguments.fraction))
    fraction = 0.0 if none else as_positive_number("--fraction", arguments.fraction)
    if fraction > 1:
        raise InputError(f"--fraction is {arguments.fraction!r}.", "Give a number from 0 to 1, such as .01.")
    done = on_demand.verify(on_demand.open_farm(arguments.directory), fraction)
    lines = [f"{done.whole} drapes are whole, {len(done.torn)} torn."]
    if done.repeated + done.elsewhere:
        lines.append(
            f"{done.repeated} drapes made again on this kind of processor, {done.same} with the same bytes; "
            f"{done.elsewhere} on another kind. Largest distance {1e3 * done.largest:.3g} mm."
        )
    lines += [*done.torn.values(), *(f"Drape {name} comes out differently." for name in done.different)]
    if done.plan:
        lines.append(f"{done.plan} {on_demand.REPLAN}")
    lines.append("Signed off." if done.good else "Not signed off.")
    if done.torn:
        lines.append("To make these drapes again: `clothsim farm repair DIR`, then `clothsim farm work DIR`.")
    return Report(asdict(done), "\n".join(lines), 0 if done.good else FAULT)


def _repair(arguments: argparse.Namespace) -> Report:
    farm = on_demand.open_farm(arguments.directory)
    done = on_demand.repair(farm, arguments.cause or on_demand.MACHINE)
    on_demand.write_manifest(farm)
    lines = [f"{name}: {why}" for name, why in done.taken_back.items()]
    lines.append(f"{len(done.meshes)} meshes stored again, {len(done.taken_back)} drapes taken back into the plan.")
    if done.taken_back:
        lines.append(f"`clothsim farm work {farm.directory}` makes them again.")
    if farm.plan_fault:
        lines.append(f"{farm.plan_fault} {on_demand.REPLAN}")
    return Report(asdict(done), "\n".join(lines), FAULT if farm.plan_fault else 0)


def _pack(arguments: argparse.Namespace) -> Report:
    sheets = [f".{kind}" for kind in ("png", "html") if arguments.sheet]
    written = on_demand.packed_files(arguments.output)
    refuse_replacing([*written, *(written[1].with_suffix(ending) for ending in sheets)], arguments.overwrite)
    farm = on_demand.open_farm(arguments.directory)
    done = on_demand.pack(farm, arguments.output, as_count("--shard", arguments.shard), arguments.overwrite)
    files = list(done.files)
    if arguments.sheet:
        beside = files[-1]
        files += [
            on_demand.contact_sheet(farm, beside.with_suffix(".png")),
            on_demand.contact_page(farm, beside.with_suffix(".html")),
        ]
    content = {"files": [str(file) for file in files], "drapes": done.drapes, "left_out": done.left_out}
    size = sum(file.stat().st_size for file in files)
    text = f"{done.drapes} drapes, {done.left_out} left out, {size / 1e6:.2g} MB: {', '.join(map(str, files))}"
    return Report(content, text)


@contextlib.contextmanager
def terminated_like_interrupted() -> Iterator[None]:
    """Within the block SIGTERM does what Ctrl-C does, also in the background of a script, where SIGINT is ignored."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def forward(number: int, frame: FrameType | None) -> None:
        signal.raise_signal(signal.SIGINT)

    before, ignored = signal.signal(signal.SIGTERM, forward), signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    if ignored:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
        if ignored:
            signal.signal(signal.SIGINT, signal.SIG_IGN)


def _line(farm: "Farm") -> Any:
    """A callback that prints a line for each drape."""

    def show(job: "DrapeJob", made: "Drape") -> None:
        verdict = on_demand.verdict_text(made.summary)
        print(f"{job.id} {made.summary.get('cpu_seconds', 0.0):.1f} s {verdict}", flush=True)

    return show


def _text(state: "Status") -> str:
    lines = [
        f"{state.published} of {state.planned} drapes published, {state.usable} usable; {state.claimed} being made"
        + (f", {state.stale} abandoned by processes that ended" if state.stale else "")
        + "."
    ]
    lines += [f"  {count} {cause}" for cause, count in sorted(state.causes.items())]
    lines += [f"  {rate:.0f} usable drapes an hour and core ({name})" for name, rate in state.per_core_hour.items()]
    if {"torn", "killed"} & state.causes.keys():
        lines.append("  `clothsim farm repair DIR` puts torn and killed drapes back into the plan.")
    return "\n".join(lines)


def _sweep(arguments: argparse.Namespace) -> Report | int:
    if not arguments.vary:
        raise InputError("Nothing varies.", "Write --vary solver.dt=.02,.01.")
    scene = scene_of(arguments)
    varied = dict(_values(text) for text in arguments.vary)
    recipe = on_demand.make_recipe(scene, {"until": scene.run_settings.until}, {}, varied)
    on_demand.refuse_unbuildable(recipe)
    farm = on_demand.plan(recipe, arguments.output or Path(f"{arguments.scene.stem}_sweep"))
    with terminated_like_interrupted():
        try:
            on_demand.work(farm)
        except KeyboardInterrupt:
            print(f"Stopped. The same command, or `clothsim farm work {farm.directory}`, continues.", file=sys.stderr)
            return 130
    rows = on_demand.write_manifest(farm)
    code = 0 if all(row["usable"] for row in rows) else 1
    return Report({"directory": str(farm.directory), "drapes": rows}, _table(rows), code)


def _values(text: str) -> tuple[str, Any]:
    """Key and grid of "solver.dt=.02,.01"; each value is read as a number where it is one."""
    key, equals, values = text.partition("=")
    given = _outside_brackets(values)
    if not equals or not given:
        raise InputError(f"--vary {text!r} names no values.", "Write --vary solver.dt=.02,.01.")
    return key.strip(), {"grid": [_value(part) for part in given]}


def _outside_brackets(text: str) -> list[str]:
    """The parts of a text between commas that are in no brackets and no quotes, empty ones left out."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if letter in "\"'" and quote in ("", letter):
            quote = "" if quote else letter
        depth += 0 if quote else (letter in "[{") - (letter in "]}")
        if letter == "," and depth <= 0 and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts if part.strip()]


def _value(text: str) -> Any:
    """A value of --vary: as of --set, and ".02" is a number."""
    with contextlib.suppress(ValueError):
        return int(text)
    with contextlib.suppress(ValueError):
        return float(text)
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text


def _table(rows: list[dict[str, Any]]) -> str:
    keys = list(rows[0]["parameters"])
    lines = [
        [
            *(str(row["parameters"][key]) for key in keys),
            "certified" if row["usable"] else row["cause"],
            f"{row['newton_iterations'] or 0}",
            f"{row['cpu_seconds'] or 0.0:.1f}",
            row["id"],
        ]
        for row in rows
    ]
    return text_table([*keys, "verdict", "Newton", "CPU s", "drape"], lines)


def _learn(arguments: argparse.Namespace) -> Report | int:
    refuse_output(arguments.output, arguments)
    if arguments.motion:
        return _learn_motion(arguments)
    given = {"--held-kind": arguments.held_kind, "--kind": arguments.kind, "--model": arguments.model}
    lost = [name for name, value in given.items() if value]
    if lost:
        raise InputError(f"{lost[0]} is of models of motion.", "Add --motion, or leave it out.")
    components = 16 if arguments.components is None else arguments.components
    held_out = 0.25 if arguments.held_out is None else arguments.held_out
    made = on_demand.learn(on_demand.open_farm(arguments.directory), held_out, components)
    made.model.write(arguments.output, arguments.overwrite)
    names = ("training", "held_out", "left_out", "error", "mean_error", "nearest_error")
    return Report(
        {"model": str(arguments.output), **{name: getattr(made, name) for name in names}},
        f"{arguments.output}: {made.training} drapes learned, {made.held_out} held out, {made.left_out} left out "
        f"(another mesh).\nerror of held-out drapes (rms): model {1e3 * made.error:.2f} mm, nearest drape "
        f"{1e3 * made.nearest_error:.2f} mm, mean drape {1e3 * made.mean_error:.2f} mm.",
    )


def _learn_motion(arguments: argparse.Namespace) -> Report | int:
    """Learn models of a garment in motion, from a farm or from the recipe of one."""
    directory, seed = arguments.directory, as_count("--seed", arguments.seed, least=0)
    if arguments.held_out is not None:
        raise InputError("--held-out is of models of drapes.", "With --motion give --held-kind or --held-bodies.")
    if arguments.components is not None and arguments.components < 1:
        raise InputError(f"--components is {arguments.components}.", "Give a whole number from 1.")
    bodies = as_count("--held-bodies", arguments.held_bodies, least=0)
    if not directory.is_dir():
        recipe = _recipe(directory)
        _refuse_unknown_kind(recipe, arguments.held_kind)
        directory = arguments.output.with_name(f"{arguments.output.stem}_farm")
        worked, _ = _make(recipe, directory, arguments)
        if not isinstance(worked, Report):
            return worked
    components = 48 if arguments.components is None else arguments.components
    farm = on_demand.open_farm(directory)
    recurrent = on_demand.RegressorTraining(seed=seed) if "recurrent" in (arguments.model, arguments.kind) else None
    made = on_demand.learn_motion(farm, arguments.held_kind, bodies, components, seed, recurrent)
    made.write(arguments.output, arguments.kind, arguments.overwrite)
    sets = made.division
    counts = {name: len(sets.rows(name)) for name in ("training", *on_demand.SETS)}
    rows = [
        [name, *(_missed(made.errors[name][part], made.inside[name][part]) for part in on_demand.SETS)]
        for name in made.models
    ]
    text = (
        f"{arguments.output}: {arguments.kind or made.best}; {counts['training']} clips learned, "
        f"{counts['validation']} for validation. Held out: {counts['new motion']} clips of the kind {sets.kind}, "
        f"{counts['new body']} on {len(sets.bodies)} bodies ({len(sets.left_out)} left out: their motion is known).\n"
        f"error (rms) and vertices inside the body:\n{text_table(['model', *on_demand.SETS], rows)}"
    )
    document = {"model": str(arguments.output), "kind": arguments.kind or made.best, "clips": counts}
    return Report({**document, "errors": made.errors, "inside": made.inside}, text)


def _refuse_unknown_kind(recipe: "Recipe", kind: str | None) -> None:
    """InputError for a kind of motion that no clip of the recipe has, before they are made."""
    drawn = [
        values for k in range(recipe.count) for key, values in recipe.values(k).items() if key.endswith("motion.clip")
    ]
    kinds = sorted({str(clip).partition(":")[0] for clip in drawn})
    if kind is not None and kinds and kind not in kinds:
        raise InputError(f"The recipe has no motion of the kind {kind!r}.", f"It has {', '.join(kinds)}.")


def _missed(error: float, inside: float) -> str:
    return "none" if isnan(error) else f"{1e3 * error:.1f} mm {100 * inside:.2f} %"
