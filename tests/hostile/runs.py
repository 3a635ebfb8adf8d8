"""Hostile directories of runs: each file missing, cut, of garbage or handmade; archives; outputs."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from tests.hostile.case import ANY, Case
from tests.hostile.oracle import fault_of_run
from tests.hostile.stock import archive, changed, npy, npz, run, with_members

FILES = ("checkpoint.npz", "trajectory.vtkhdf", "record.jsonl", "summary.json")


def cases() -> Iterator[Case]:
    """All of them."""
    yield from _spoilt_files()
    yield from _checkpoints()
    yield from _archives()
    yield from _outputs()


def _with(changes: Mapping[str, bytes | str | None]) -> dict[str, bytes | str]:
    """The run with files changed, or left out where a change is None."""
    files = {**run(), **changes}
    return {name: content for name, content in files.items() if content is not None}


def _right(folder: Path, text: str) -> str:
    return fault_of_run(folder / "run") if (folder / "run/trajectory.vtkhdf").stat().st_size > 2000 else ""


def _spoilt_files() -> Iterator[Case]:
    yield Case("run: as it is, resumed", "resume run --no-picture", "completed", _with({}), check=_right)
    yield Case("run: as it is, checked", "check run", "completed", _with({}))
    for file in FILES:
        content = run()[f"run/{file}"]
        for what, spoilt in {
            "missing": None,
            "empty": b"",
            "cut in half": content[: len(content) // 2],
            "of garbage": bytes((7 * k * k + k) % 251 for k in range(3000)),
        }.items():
            for command in (
                ("resume run --no-picture", "check run") if what != "of garbage" else ("export run -o a.glb",)
            ):
                name = f"run: {file} {what}, {command.split()[0]}"
                yield Case(name, command, ANY, _with({f"run/{file}": spoilt}))
    for what, text in {
        "a number": "3",
        "lists 100,000 deep": "[" * 100_000,
        "other types": json.dumps({"status": 3, "certificate": "x", "steps": None, "notes": 7, "failure": []}),
    }.items():
        for command in ("check run", "explain run", "bundle run -o b.zip"):
            yield Case(
                f"run: summary.json is {what}, {command.split()[0]}", command, ANY, _with({"run/summary.json": text})
            )
    yield Case("run: record.jsonl of numbers, explain", "explain run", ANY, _with({"run/record.jsonl": "1\n2\n3\n"}))
    links = {name: content for name, content in run().items() if name != "run/trajectory.vtkhdf"}

    def linked(folder: Path) -> None:
        Case("", "", "", links).make(folder)
        (folder / "run/trajectory.vtkhdf").symlink_to(folder.parent / "outside/thesis.txt")

    yield Case("run: trajectory.vtkhdf is a link outside", "resume run --no-picture", "refused", linked)
    yield Case(
        "run: trajectory.vtkhdf is a link outside, replaced",
        "run sheet.toml -o run --overwrite --no-picture",
        "completed",
        linked,
        check=_right,
    )


def _checkpoints() -> Iterator[Case]:
    """Handmade ones."""
    good = run()["run/checkpoint.npz"]
    scene = json.loads(np.load(_file(good), allow_pickle=False)["scene_text"].tobytes())

    def text(value: object) -> bytes:
        return npy(np.frombuffer((value if isinstance(value, str) else json.dumps(value)).encode(), np.uint8))

    def of_scene(**sections: object) -> bytes:
        return text({**scene, **sections})

    n = 25 + 42
    for what, members in {
        "frame 999": {"counts": npy(np.array([999, 4, 0]))},
        "frame -1": {"counts": npy(np.array([-1, 4, 0]))},
        "step 10^18": {"counts": npy(np.array([1, 10**18, 0]))},
        "counts of nan": {"counts": npy(np.array([np.nan, 0, 0]))},
        "time nan": {"times": npy(np.array([np.nan, 0.01, 0]))},
        "time 1e300": {"times": npy(np.array([1e300, 0.01, 0]))},
        "dt 1e-300": {"times": npy(np.array([0.01, 1e-300, 0]))},
        "dt 1e9": {"times": npy(np.array([0.01, 1e9, 0]))},
        "positions of nan": {"positions": npy(np.full((n, 3), np.nan))},
        "positions at 1e200": {"positions": npy(np.full((n, 3), 1e200))},
        "positions in one place": {"positions": npy(np.zeros((n, 3)))},
        "positions of two vertices": {"positions": npy(np.zeros((2, 3)))},
        "positions (n, 2)": {"positions": npy(np.zeros((n, 2)))},
        "velocities of 1e200": {"velocities": npy(np.full((n, 3), 1e200))},
        "velocities missing": {"velocities": None},
        "no scene": {"scene_text": text("")},
        "a scene that is a list": {"scene_text": text([])},
        "a scene of 4,096 x 4,096 cells": {"scene_text": of_scene(cloth={**scene["cloth"], "cells": [4096, 4096]})},
        "a scene with a mesh of another folder": {"scene_text": of_scene(cloth={"mesh": "../../outside/thesis.txt"})},
        "a scene of another directory": {"scene_text": of_scene(directory="/proc/self")},
        "a scene without a solver": {"scene_text": text({k: v for k, v in scene.items() if k != "solver"})},
        "a scene with a function": {
            "scene_text": of_scene(effects={"gravity": {"acceleration": {"function": "os.system"}}})
        },
        "counters that are a list": {"counters": text([])},
        "counters of words": {
            "counters": text(dict.fromkeys(("memory", "certificate", "rest", "slow_steps", "temporal_error"), "x"))
        },
        "counters without a certificate": {"counters": text({"memory": {}})},
        "a pickle": {"positions": npy(np.array([{}], object))},
        "a later format": {"format": text("clothsim checkpoint 99")},
    }.items():
        changes = {"run/checkpoint.npz": with_members(good, **members), "run/summary.json": None}
        wanted = (
            ANY
            if what
            in (
                "dt 1e9",
                "velocities of 1e200",
                "a scene of another directory",
                "positions in one place",
                "a scene without a solver",
            )
            else "refused|found"
        )
        yield Case(f"checkpoint: {what}", "resume run --no-picture", wanted, _with(changes), check=_right)
    yield Case("checkpoint: alone", "resume run --no-picture", ANY, {"run/checkpoint.npz": good})
    yield Case("checkpoint: empty archive", "resume run", "refused", {"run/checkpoint.npz": npz()})


def _file(content: bytes) -> "object":
    import io

    return io.BytesIO(content)


def _archives() -> Iterator[Case]:
    """Archives of `bundle`."""
    good = run()["run.zip"]
    checkpoint = run()["run/checkpoint.npz"]
    yield Case("archive: as it is", "resume a.zip -o out --no-picture", "completed", {"a.zip": good})
    for what, content in {
        "empty": b"",
        "cut in half": good[: len(good) // 2],
        "of garbage": b"PK\x03\x04" + bytes(900),
        "a name outside": archive(**{"checkpoint.npz": checkpoint, "..__..__outside__thesis.txt": b"mine"}),
        "an absolute name": archive(**{"checkpoint.npz": checkpoint, "__etc__motd": b"mine"}),
        "a name with a backslash": archive(**{"checkpoint.npz": checkpoint, "meshes\\..\\a": b"mine"}),
        "no checkpoint": archive(**{"README.txt": b"x"}),
        "a directory that climbs": archive(**{"checkpoint.npz": checkpoint, "meshes__..__..__x": b"mine"}),
        "of its own checkpoint": archive(**{"checkpoint.npz": checkpoint}),
        "an unknown file": archive(**{"checkpoint.npz": checkpoint, "run.sh": b"rm -r ~"}),
    }.items():
        yield Case(f"archive: {what}", "resume a.zip -o out --no-picture", "refused", {"a.zip": content})
    yield Case(
        "archive: over a folder with files", "resume a.zip -o out", "refused", {"a.zip": good, "out/mine.txt": "mine"}
    )


def _outputs() -> Iterator[Case]:
    """Exports and pictures that cannot be."""
    for words, wanted in (
        ("export run -o a.obj --scale 1e300", "refused"),
        ("export run -o a.obj --scale -1", "refused"),
        ("export run -o a.glb --fps 1e9", "refused"),
        ("export run -o a.glb --fps nan", "refused"),
        ("export run -o a.glb --frame 99", "refused"),
        ("export run -o a.xyz", "refused"),
        ("export run -o nowhere/a.glb", "refused"),
        ("export run -o run/checkpoint.npz/a.glb", "refused"),
        ("export run -o /dev/full/a.glb", "refused"),
        ("export sheet.toml -o a.glb", "refused"),
        ("export run -o a.glb --overwrite", "completed"),
        ("export run -o a.vtkhdf", "completed"),
        ("render run -o a.png --size 99999x99999", "refused"),
        ("render run -o a.png --size 0x0", "refused"),
        ("render run -o a.png --frame 99", "refused"),
        ("render run -o a.png --view 0,0,0", "refused"),
        ("render run -o a.png --view nan,1,1", "refused"),
        ("render run -o a.png --field nothing", "refused"),
        ("render run -o a.png --range 2,1", "refused"),
        ("render run -o a.jpg", "refused"),
        ("bundle run -o a.tar", "refused"),
        ("bundle nothing", "refused"),
        ("unpose run -o a.npz", "refused"),
        ("view nothing", "refused"),
        ("resume nothing", "refused"),
        ("resume run -o out", "refused"),
        ("recover run --target nothing.obj --free density", "refused"),
        ("explain run --steps 5", "refused"),
    ):
        yield Case(f"output: {words}", words, wanted, _with({}))
    other = changed("radius = 0.3", "radius = 0.2")
    yield Case("output: run over another run", "run b.toml -o run", "refused", _with({"b.toml": other}))
