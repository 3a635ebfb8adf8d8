"""Kernels compiled ahead of time, for a wheel: `python -m clothsim.cli.ship_kernels [SCENE ...] [--wheel FOLDER]`.

They are those that the named example scenes need from the start to `duration`, all by default, with their pictures, on
any processor of a level of the instruction set (`kernel_cache.shipped`). A wheel that is built afterwards holds them;
with `--wheel` one is built, and the package here stays without.
"""

import argparse
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import clothsim
from clothsim import engine
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.kernel_cache import shipped, storage

SOURCES = "clothsim", "transfer", "scenes", "pyproject.toml", "README.md", "LICENSE"
"""What a wheel is built from."""


def ship(scenes: Sequence[str], duration: float, to: Path | None = None) -> int:
    """Compile in a process of its own, whose processor is that of the level; returns the number of kernels.

    Parameters
    ----------
    scenes : sequence of str
        Names of example scenes.
    duration : float
        Simulated time of each [s].
    to : Path, optional
        Folder that is replaced by that of the kernels; None: the one that this package reads.
    """
    if not shipped.can_run():
        raise ClothsimError(f"This processor cannot run {shipped.LEVEL}.", "Build the wheel on another machine.")
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "clothsim.cli.ship_kernels", "--duration", str(duration), "--compile", *scenes]
        subprocess.run(command, env=os.environ | shipped.environment(Path(folder)), check=True)
        to = to or shipped.FOLDER
        shutil.rmtree(to, ignore_errors=True)
        compiled = Path(folder, "clothsim", "kernels")
        shutil.copytree(compiled, to, ignore=shutil.ignore_patterns("last-removal"))
    return len(list(to.rglob(f"*{storage.SUFFIX}")))


def build_wheel(scenes: Sequence[str], duration: float, folder: Path) -> tuple[int, Path]:
    """Build a wheel with kernels from a copy of the clone that this module is of: their number, and the file.

    A build leaves its files beside the sources, and the next one takes them in: hence the copy.

    Raises
    ------
    ClothsimError
        Outside of a clone, or where the processor is below the level.
    """
    clone = Path(__file__).parents[2]
    if not (clone / "pyproject.toml").is_file():
        raise ClothsimError(f"{clone} is not a clone of clothsim.", "Call the command in one.")
    with TemporaryDirectory() as work:
        copy, built = Path(work, "clone"), Path(work, "wheel")
        copy.mkdir()
        for source in (clone / name for name in SOURCES):
            if source.is_dir():
                shutil.copytree(source, copy / source.name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy2(source, copy)
        count = ship(scenes, duration, copy / shipped.FOLDER.relative_to(clone))
        command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", str(built), str(copy)]
        subprocess.run(command, check=True)
        (wheel,) = built.glob("*.whl")
        folder.mkdir(parents=True, exist_ok=True)
        return count, Path(shutil.copy2(wheel, folder))


def compile_kernels(scenes: Sequence[str], duration: float) -> None:
    """Run the start of the scenes and draw them."""
    engine.compile_remaining_kernels()
    for name in scenes:
        with TemporaryDirectory() as folder:
            try:
                scene = engine.replace(clothsim.load_scene(name), "run.duration", duration)
                run = clothsim.simulate(scene, folder, overwrite=True)
                run.plot(path=Path(folder) / "picture.png")
                print(f"{name}: {run.status}", flush=True)
            except ClothsimError as error:  # of a scene that runs longer only: what it compiled is compiled
                print(f"{name}: {error}", file=sys.stderr, flush=True)


def main(argv: Sequence[str] | None = None) -> int:
    """Compile the kernels of example scenes into the package."""
    parser = argparse.ArgumentParser(prog="python -m clothsim.cli.ship_kernels", description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: all that are installed")
    parser.add_argument("--duration", type=float, default=0.3, help="simulated time of each [s]")
    parser.add_argument("--wheel", type=Path, metavar="FOLDER", help="build the clone's wheel with them there")
    parser.add_argument("--compile", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    scenes = arguments.scenes or [scene.name for scene in engine.example_scenes() if not scene.missing]
    if arguments.compile:
        compile_kernels(scenes, arguments.duration)
        return 0
    try:
        if not 0.0 < arguments.duration < math.inf:
            raise InputError(f"--duration is {arguments.duration}.", "Give a time above 0 [s], such as 0.3.")
        for name in scenes:
            clothsim.load_scene(name)  # refuses what is not a scene before anything is compiled
        if arguments.wheel is None:
            print(f"{ship(scenes, arguments.duration)} kernels")
        else:
            count, wheel = build_wheel(scenes, arguments.duration, arguments.wheel)
            print(f"{wheel}: {count} kernels")
    except ClothsimError as error:
        print(error, file=sys.stderr)
        return 2
    except subprocess.CalledProcessError as error:  # which has said why
        print(f"{error.cmd[2]} ended with code {error.returncode}: nothing was built.", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
