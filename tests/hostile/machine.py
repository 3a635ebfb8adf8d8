"""A hostile machine: signals, kills and what follows them, full disks, folders that are none.

Kills of the worker processes of `farm work --workers` take minutes: `python -m tests.benchmarks.farm_kills -o DIR`.
"""

import json
import platform
import signal
from collections.abc import Iterator
from pathlib import Path

from clothsim.files.runs.run_lock import LOCK_NAME
from tests.hostile.case import RUN, Case
from tests.hostile.farms import farm_with
from tests.hostile.oracle import fault_of_run, run_is_right
from tests.hostile.stock import LONG, RECIPE, SHEET, farm, run


def cases() -> Iterator[Case]:
    """All of them."""
    yield from _signals()
    yield from _full_disks()
    yield from _folders()


def _signals() -> Iterator[Case]:
    scene = {"a.toml": LONG}
    for what, file in {
        "at once": "a.toml",
        "at the first frame": "out/trajectory.vtkhdf",
        "with a record": "out/record.jsonl",
    }.items():
        yield Case(f"signal: Ctrl-C {what}", RUN, "stopped", scene, interrupt=[(signal.SIGINT, file)])
    yield Case(
        "signal: Ctrl-C in quiet", f"{RUN} --quiet", "stopped", scene, interrupt=[(signal.SIGINT, "out/record.jsonl")]
    )
    yield Case("signal: Ctrl-C twice", RUN, "stopped", scene, interrupt=[(signal.SIGINT, "out/record.jsonl")] * 2)
    yield Case(
        "signal: Ctrl-C in study",
        "study a.toml -o out --budget 60s",
        "stopped|completed|found",
        scene,
        interrupt=[(signal.SIGINT, "out/points")],
    )
    yield Case(
        "signal: Ctrl-C in a farm",
        "farm work farm",
        "stopped",
        farm_with(dict.fromkeys(name for name in farm() if name.startswith("farm/drapes/"))),
        interrupt=[(signal.SIGINT, "farm/farm.json")],
    )
    yield Case(
        "kill: of a run, then resumed", ["resume", "out", "--no-picture"], "completed", _killed, check=run_is_right()
    )


def _killed(folder: Path) -> None:
    """A run that ended between two writes: a checkpoint, a record of one step too many, half a line, no summary."""
    for name, content in run().items():
        if name.startswith("run/") and not name.endswith("summary.json"):
            path = folder / name.replace("run/", "out/", 1)
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(content + (b'{"step": 99, "ti' if name.endswith("jsonl") else b""))


def _full_disks() -> Iterator[Case]:
    for size in (0, 1000, 4000, 20_000):
        yield Case(f"disk: full at {size} bytes, run", RUN, "refused|found", {"a.toml": LONG}, limits={"FSIZE": size})
    for command in (
        "export run -o a.glb",
        "export run -o a.obj",
        "export run -o a.vtkhdf",
        "render run -o a.png --size 300x300",
        "render run -o a.gif --size 64x64",
        "bundle run -o b.zip",
        "unpose run -o a.npz",
    ):
        yield Case(
            f"disk: full at 1000 bytes, {command}",
            command,
            "refused|found",
            dict(run()),
            limits={"FSIZE": 1000},
            check=_nothing_left,
        )
    files = {"sheet.toml": SHEET, "recipe.toml": RECIPE}
    yield Case("disk: full, farm plan", "farm plan recipe.toml -o farm", "refused", files, limits={"FSIZE": 100})
    yield Case(
        "disk: full, farm work",
        "farm work farm",
        "refused|found",
        files,
        before=["farm plan recipe.toml -o farm"],
        limits={"FSIZE": 2000},
    )
    yield Case(
        "disk: full, farm pack", "farm pack farm -o data.h5", "refused|found", dict(farm()), limits={"FSIZE": 2000}
    )
    yield Case(
        "disk: full, gradient",
        "gradient a.toml --loss height --wrt start -o g.npz",
        "refused|found",
        {"a.toml": SHEET},
        limits={"FSIZE": 100},
    )
    yield Case(
        "disk: full, study",
        "study a.toml -o out --budget 20s --parameters dt",
        "refused|found",
        {"a.toml": SHEET},
        limits={"FSIZE": 100},
    )


def _nothing_left(folder: Path, text: str) -> str:
    return "it says it is done"


def _folders() -> Iterator[Case]:
    def linked(folder: Path) -> None:
        (folder / "a.toml").write_text(SHEET)
        (folder / "out").symlink_to(folder / "nothing")

    yield Case("folder: a link to nothing", RUN, "refused|completed", linked)
    yield Case("folder: a summary that is one", RUN, "refused", {"a.toml": SHEET, "out/summary.json": None})
    yield Case("folder: a record that is one", RUN, "refused", {"a.toml": SHEET, "out/record.jsonl": None})
    yield Case(
        "folder: a picture that is one", "run a.toml -o out", "refused", {"a.toml": SHEET, "out/picture.png": None}
    )
    for what, content in {
        "of a process that is gone": json.dumps({"pid": 999_999_999, "host": platform.node()}),
        "of garbage": bytes(range(256)),
        "of lists 4,096 deep": "[" * 4096,
        "of lists": '[{"pid": 1}]',
    }.items():
        files = {"a.toml": SHEET, f"out/{LOCK_NAME}": content}
        yield Case(f"folder: a lock {what}", RUN, "completed", files, check=_right)
    elsewhere = '{"pid": 1, "host": "elsewhere"}'
    yield Case("folder: a lock of another machine", RUN, "refused", {"a.toml": SHEET, f"out/{LOCK_NAME}": elsewhere})
    yield Case("folder: a lock that is a folder", RUN, "refused", {"a.toml": SHEET, f"out/{LOCK_NAME}": None})


def _right(folder: Path, text: str) -> str:
    return fault_of_run(folder / "out")
