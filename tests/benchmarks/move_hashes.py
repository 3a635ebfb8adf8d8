"""Hashes of results before and after a move: `python -m tests.benchmarks.move_hashes FILE [NAME ...] [--against OLD]`.

The first steps of every scene, three fits, three dresses, a gradient, a restored run, a drape of a farm. It uses
public names and commands only, so that one copy of this file runs on two revisions; both must run on one machine.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np

import clothsim

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
STEPS = 25
RECIPE = """
[farm]
scene = "shirt.toml"
count = 1
until = "time"
[set]
"cloth.edge" = 0.04
"run.duration" = 0.04
[vary]
"body.chest" = { uniform = [0.95, 1.08] }
"""

FITS: Mapping[str, Sequence[str]] = {
    "fit_shirt": ("shirt", "--to", "shirt_large"),
    "fit_female": ("shirt", "--to", str(DATA / "bodies" / "mean_female.obj")),
    "fit_average": ("shirt", "--to", str(DATA / "bodies" / "mean_all.obj"), "--fabric", "denim"),
}
DRESSES: Mapping[str, Sequence[str]] = {
    "dress_tunic": ("tunic", "--on", "shirt", "--size", "5cm"),
    "dress_skirt": (str(DATA / "patterns" / "skirt_2_panels.json"), "--on", "shirt", "--size", "4cm"),
    "dress_tee": (str(DATA / "patterns" / "tee.json"), "--on", "shirt", "--size", "4cm"),
}


def digest(*arrays: np.ndarray) -> str:
    """Hash of the bytes of the arrays."""
    found = hashlib.blake2b(digest_size=8)
    for array in arrays:
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def stepped(simulation: clothsim.Simulation, steps: int) -> list[str]:
    """A hash of positions and velocities after each step."""
    found = []
    while len(found) < steps and not simulation.finished:
        state = simulation.step()
        names = sorted(state.positions)
        found.append(digest(*(state.positions[name] for name in names), *(state.velocities[name] for name in names)))
    return found


def scene_hashes(name: str) -> list[str]:
    """Of the first steps of a shipped scene."""
    return stepped(clothsim.Simulation(clothsim.load_scene(ROOT / "scenes" / f"{name}.toml")), STEPS)


def restored_hashes() -> list[str]:
    """Of a run that is saved after two steps and restored."""
    simulation = clothsim.Simulation(clothsim.load_scene(ROOT / "scenes" / "sphere.toml"))
    before = stepped(simulation, 2)
    with tempfile.TemporaryDirectory() as folder:
        simulation.save(Path(folder) / "saved.npz")
        return before + stepped(clothsim.Simulation.restore(Path(folder) / "saved.npz"), 2)


def command(*words: str) -> None:
    """Run a command of the package."""
    done = subprocess.run(
        [sys.executable, "-m", "clothsim", *words],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"clothsim {' '.join(words)} ended {done.returncode}: {done.stderr[-500:]}")


def run_hashes(words: Sequence[str]) -> list[str]:
    """Of the last frames that a command leaves; `{words[0]} ... -o FOLDER` is the command."""
    with tempfile.TemporaryDirectory() as folder:
        command(*words, "-o", f"{folder}/out", "--no-picture", "--quiet")
        run = clothsim.open_run(f"{folder}/out")
        return [digest(run.positions(k)) for k in range(len(run.times))]


def gradient_hashes() -> list[str]:
    """Of every array of a gradient."""
    with tempfile.TemporaryDirectory() as folder:
        file = f"{folder}/gradient.npz"
        command("gradient", "study_strip", "--loss", "height", "--wrt", "youngs_modulus", "-o", file)
        with np.load(file) as arrays:
            return [f"{name} {digest(arrays[name])}" for name in sorted(arrays) if arrays[name].dtype.kind == "f"]


def farm_hashes() -> list[str]:
    """Of the published positions of a drape."""
    with tempfile.TemporaryDirectory() as folder:
        recipe = Path(folder) / "recipe.toml"
        recipe.write_text(RECIPE.replace("shirt.toml", str(ROOT / "scenes" / "shirt.toml")))
        command("farm", "plan", str(recipe), "-o", f"{folder}/farm", "--quiet")
        command("farm", "work", f"{folder}/farm", "--quiet")
        return [digest(np.load(file)) for file in sorted(Path(folder, "farm").rglob("cloth.npy"))]


def all_hashes() -> dict[str, Callable[[], list[str]]]:
    """What is hashed, by name; what needs shared data is left out where there is none."""
    found: dict[str, Callable[[], list[str]]] = {
        file.stem: partial(scene_hashes, file.stem) for file in sorted((ROOT / "scenes").glob("*.toml"))
    }
    found |= {"restored": restored_hashes, "gradient": gradient_hashes, "farm": farm_hashes}
    for table, verb in ((FITS, "fit"), (DRESSES, "dress")):
        for name, words in table.items():
            if all(Path(word).exists() for word in words if word.startswith("/")):
                found[name] = partial(run_hashes, (verb, *words))
    return found


def main(argv: Sequence[str] | None = None) -> int:
    """Write the hashes, compare them where asked; 1 where any differs."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.move_hashes", description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path, metavar="FILE", help="where the hashes are written (JSON)")
    parser.add_argument("names", nargs="*", metavar="NAME", help="only these")
    parser.add_argument("--against", type=Path, metavar="OLD", help="hashes of the other revision")
    arguments = parser.parse_args(argv)
    old = json.loads(arguments.against.read_text()) if arguments.against else {}
    found, different = {}, []
    for name, hashes in all_hashes().items():
        if arguments.names and name not in arguments.names:
            continue
        began = process_time()
        try:
            found[name] = hashes()
        except Exception as error:  # a revision that fails is a difference too, and the others are still compared
            found[name] = [f"{type(error).__name__}: {error}"]
        if old and found[name] != old.get(name):
            different.append(name)
        verdict = "" if not old else "DIFFERENT" if name in different else "same"
        print(f"{name}: {len(found[name])} hashes, {process_time() - began:.1f} s {verdict}", flush=True)
        arguments.file.write_text(json.dumps(found, indent=1))
    print(f"{len(found)} hashed, {len(different)} different: {', '.join(different) or 'none'}")
    return int(bool(different))


if __name__ == "__main__":
    sys.exit(main())
