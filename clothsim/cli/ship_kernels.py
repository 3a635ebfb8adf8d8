"""Kernels compiled ahead of time, for a wheel: `python -m clothsim.cli.ship_kernels [SCENE ...]`.

They are those that the named example scenes need from the start to `duration`, all by default, with their pictures, on
any processor of a level of the instruction set (`kernel_cache.shipped`). A wheel that is built afterwards holds them.
"""

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory


def ship(scenes: Sequence[str], duration: float) -> int:
    """Compile in a process of its own, whose processor is that of the level; returns the number of kernels.

    Parameters
    ----------
    scenes : sequence of str
        Names of example scenes.
    duration : float
        Simulated time of each [s].
    """
    from clothsim.errors import ClothsimError
    from clothsim.kernel_cache import shipped, storage

    if not shipped.can_run():
        raise ClothsimError(f"This processor cannot run {shipped.LEVEL}.", "Build the wheel on another machine.")
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "clothsim.cli.ship_kernels", "--duration", str(duration), "--compile", *scenes]
        subprocess.run(command, env=os.environ | shipped.environment(Path(folder)), check=True)
        shutil.rmtree(shipped.FOLDER, ignore_errors=True)
        compiled = Path(folder, "clothsim", "kernels")
        shutil.copytree(compiled, shipped.FOLDER, ignore=shutil.ignore_patterns("last-removal"))
    return len(list(shipped.FOLDER.rglob(f"*{storage.SUFFIX}")))


def compile_kernels(scenes: Sequence[str], duration: float) -> None:
    """Run the start of the scenes and draw them."""
    from clothsim.cli.precompile import compile_remaining_kernels
    from clothsim.errors import ClothsimError
    from clothsim.run.example_scenes import scene_file
    from clothsim.run.pictures import draw_frame
    from clothsim.run.simulate import simulate
    from clothsim.scene.overrides import set_key
    from clothsim.scene.toml_file import load_scene

    compile_remaining_kernels()
    for name in scenes:
        with TemporaryDirectory() as folder:
            try:
                scene = set_key(load_scene(scene_file(Path(name))), "run.duration", duration)
                run = simulate(scene, folder, overwrite=True)
                draw_frame(run.trajectory, Path(folder) / "picture.png")
                print(f"{name}: {run.status}", flush=True)
            except ClothsimError as error:  # of a scene that runs longer only: what it compiled is compiled
                print(f"{name}: {error}", file=sys.stderr, flush=True)


def main(argv: Sequence[str] | None = None) -> int:
    """Compile the kernels of example scenes into the package."""
    from clothsim.run.example_scenes import example_scenes

    parser = argparse.ArgumentParser(prog="python -m clothsim.cli.ship_kernels", description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: all that are installed")
    parser.add_argument("--duration", type=float, default=0.3, help="simulated time of each [s]")
    parser.add_argument("--compile", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    scenes = arguments.scenes or [scene.name for scene in example_scenes() if not scene.missing]
    if arguments.compile:
        compile_kernels(scenes, arguments.duration)
        return 0
    print(f"{ship(scenes, arguments.duration)} kernels")
    return 0


if __name__ == "__main__":
    sys.exit(main())
