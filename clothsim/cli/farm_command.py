"""`clothsim farm`: many drapes of one recipe, none lost."""

import argparse
import contextlib
import re
import signal
import sys
import threading
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from time import sleep
from types import FrameType
from typing import TYPE_CHECKING, Any

from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.base.file_writing import refuse_replacing
from clothsim.base.inputs import did_you_mean
from clothsim.base.text import many
from clothsim.cli import on_demand
from clothsim.cli.arguments import (
    Parser,
    Renamed,
    add_output_options,
    add_overwrite,
    as_count,
    as_positive_number,
    as_seconds,
)
from clothsim.cli.progress import clock
from clothsim.cli.report import FAILED, INTERRUPTED, Report

if TYPE_CHECKING:
    from clothsim.study.farm.drape import Drape
    from clothsim.study.farm.plan import DrapeJob
    from clothsim.study.farm.recipe import Recipe
    from clothsim.study.farm.status import Status


def add_to(commands: Any) -> None:
    """Add the commands to the parser."""
    farm = commands.add_parser("farm", description=_FARM)
    actions = farm.add_subparsers(metavar="ACTION", dest="action", parser_class=Parser, required=True)
    plan = actions.add_parser("plan", help="write the scene and values of every drape")
    plan.add_argument("recipe", type=Path, metavar="RECIPE", help=_RECIPE)
    plan.add_argument("-o", "--output", type=Path, metavar="DIR", required=True, help="folder of the farm")
    plan.add_argument("--no-pilot", action="store_true", help="skip the pilot drape that tests the recipe")
    plan.set_defaults(handler=_plan)
    sample = actions.add_parser("sample", help="plan, make, verify and pack the drapes of a recipe, in one process")
    sample.add_argument("recipe", type=Path, metavar="RECIPE", help=_RECIPE)
    sample.add_argument(
        "-o", "--output", type=Path, metavar="DIR", required=True, help="folder; its data.h5 is the set"
    )
    sample.set_defaults(handler=_sample)
    for each in (plan, sample):
        each.remedies["--count"] = "The number of drapes is count under [farm] in the recipe."
    work = actions.add_parser("work", help="make the drapes that are left")
    work.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm")
    how = work.add_mutually_exclusive_group()
    how.add_argument("--workers", metavar="N", help="processes of Dask on this machine (default: this process)")
    how.add_argument("--scheduler", metavar="ADDRESS", help="address of a Dask scheduler: tcp://host:8786")
    work.add_argument("--attempts", default="3", metavar="N", help="tries before a drape counts as killed (default 3)")
    work.add_argument(
        "--stale", default="60s", metavar="TIME", help="when a claim without heartbeat expires (default 60s)"
    )
    work.set_defaults(handler=_work)
    status = actions.add_parser("status", help="count what is done, failed and left")
    status.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm")
    status.add_argument("--watch", action="store_true", help="print it every 2 s until all drapes are done")
    status.set_defaults(handler=_status)
    verify = actions.add_parser("verify", help="check all files, make some drapes again")
    verify.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm")
    verify.add_argument(
        "--fraction", default="0.01", metavar="X", help="fraction of drapes to make again (default 0.01)"
    )
    verify.add_argument("--share", dest="fraction", action=Renamed, now="--fraction")
    verify.set_defaults(handler=_verify)
    mend = actions.add_parser("repair", help="put torn and killed drapes back into the plan")
    mend.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm")
    mend.add_argument("--cause", action="append", metavar="NAME", help="also drapes of this cause, such as refused")
    mend.set_defaults(handler=_repair)
    pack = actions.add_parser("pack", help="write a data set: one HDF5 file, or a folder of WebDataset shards")
    pack.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm")
    pack.add_argument("-o", "--output", type=Path, metavar="FILE|DIR", required=True, help="data.h5, or a folder")
    pack.add_argument("--shard", default="1000", metavar="N", help="drapes per shard (default 1000)")
    pack.add_argument("--sheet", action="store_true", help="also write contact sheets (PNG, HTML)")
    add_overwrite(pack)
    pack.set_defaults(handler=_pack)
    for action in (plan, sample, work, status, verify, mend, pack):
        add_output_options(action, json="print the result as JSON", quiet="print nothing but errors")


SHIPPED = ("shirt_by_body", "skirt_by_fabric", "outfit_by_pose", "outfit_that_walks", "shirt_in_motion")
"""Recipes that come with the package."""
_RECIPE = f"a TOML file with [farm] and [vary], or {', '.join(SHIPPED)}"

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


RECIPE = ".recipe"
"""Ending of the recipes that come with the package, TOML files beside its scenes."""
SAMPLE_FRACTION, SAMPLE_DATA = 0.02, "data.h5"
"""Drapes of a sample that are made again, and the file of its data set."""


def _sample(arguments: argparse.Namespace) -> Report | int:
    worked, verified = make_drapes(read_recipe(arguments.recipe), arguments.output, arguments)
    if not isinstance(worked, Report):
        return worked
    farm = on_demand.open_farm(arguments.output)
    packed = on_demand.pack(farm, arguments.output / SAMPLE_DATA, overwrite=True)  # its own, of the same drapes
    file = packed.files[0]
    text = f"{worked.text}\n{verified.whole} drapes verified, {verified.repeated} made again; {packed.drapes} in {file}"
    return Report({**worked.document, "verified": verified.whole, "packed": packed.drapes, "file": str(file)}, text)


def make_drapes(recipe: "Recipe", directory: Path, arguments: argparse.Namespace) -> tuple[Report | int, Any]:
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
        raise InputError(f"{directory} is not verified.", f"See `clothsim farm verify {directory}`.")
    return worked, verified


def read_recipe(path: Path) -> "Recipe":
    """The recipe in a file, or the shipped one of that name. InputError that lists these for another name."""
    file = engine.example_file(path, RECIPE)
    if not file.exists():
        hint = did_you_mean(path.name.removesuffix(RECIPE), SHIPPED)
        known = f"{', '.join(SHIPPED)} come with the package; else name a TOML file with [farm] and [vary]."
        raise InputError(f"There is no recipe {path}.", hint or known)
    return on_demand.load_recipe(file)


def _plan(arguments: argparse.Namespace) -> Report:
    recipe = read_recipe(arguments.recipe)
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

                def show(job: "DrapeJob", made: "Drape") -> None:
                    if not (arguments.quiet or arguments.json):
                        verdict = on_demand.verdict_text(made.summary)
                        print(f"{job.id} {made.summary.get('cpu_seconds', 0.0):.1f} s {verdict}", flush=True)

                on_demand.work(farm, on_demand.worker_of(stale), attempts, show)
            else:

                def announce(link: str) -> None:
                    if not arguments.quiet:
                        print(f"dashboard: {link}", file=sys.stderr, flush=True)

                workers = 1 if arguments.workers is None else as_count("--workers", arguments.workers)
                on_demand.work_with_dask(farm, arguments.scheduler, workers, attempts, announce, stale)
        except KeyboardInterrupt:
            left = many(len(farm.unpublished()), "drape")
            print(f"Stopped: {left} left. `clothsim farm work {farm.directory}` continues.", file=sys.stderr)
            return INTERRUPTED
        except on_demand.LostWorkersError as error:
            print(f"{error.sentence} {error.remedy}", file=sys.stderr)
            return FAILED
    on_demand.write_manifest(farm)
    if farm.plan_fault:
        raise InputError(f"{farm.plan_fault} The drapes of its other lines are made.", on_demand.REPLAN)
    state = on_demand.status(farm)
    return Report(asdict(state), _text(state))


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
    remedy = "Give a number from 0 to 1, such as 0.01."
    fraction = 0.0 if none else as_positive_number("--fraction", arguments.fraction, remedy)
    if fraction > 1:
        raise InputError(f"--fraction is {arguments.fraction!r}.", remedy)
    done = on_demand.verify(on_demand.open_farm(arguments.directory), fraction)
    lines = [f"{done.whole} drapes are whole, {len(done.torn)} torn."]
    if done.repeated + done.elsewhere:
        lines.append(
            f"{many(done.repeated, 'drape')} made again on this kind of processor, {done.same} with the same bytes; "
            f"{done.elsewhere} on another kind. Largest distance {1e3 * done.largest:.3g} mm."
        )
    lines += [*done.torn.values(), *(f"Drape {name} comes out differently." for name in done.different)]
    if done.plan:
        lines.append(f"{done.plan} {on_demand.REPLAN}")
    lines.append("Signed off." if done.good else "Not signed off.")
    if done.torn:
        lines.append("To make these drapes again: `clothsim farm repair DIR`, then `clothsim farm work DIR`.")
    return Report(asdict(done), "\n".join(lines), done.good)


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
    return Report(asdict(done), "\n".join(lines), not farm.plan_fault)


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
