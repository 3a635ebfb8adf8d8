"""Runs with the base install only: extras and the renderer are not imported."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
EXTRAS = ("ipctk", "skfem", "imageio", "imageio_ffmpeg", "hypothesis", "pytest")
LATE = ("pyvista", "vtkmodules", "matplotlib", "embreex", "igl", "meshio", "trimesh", "PIL")
RUN = """
import json, sys
extras, late, output = json.loads(sys.argv[1])
for name in extras:
    sys.modules[name] = None
from clothsim.cli import main

settings = ["--set", "cloth.cells=[6,6]", "--set", "run.duration=0.04"]
code = main(["run", "scenes/sphere.toml", "-o", output, "--no-picture", "--quiet", *settings])
print(json.dumps([code, [name for name in late if name in sys.modules]]))
"""


def test_a_run_needs_no_extra_and_no_renderer(tmp_path):
    given = json.dumps([EXTRAS, LATE, str(tmp_path / "drape")])
    command = [sys.executable, "-c", RUN, given]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    assert json.loads(done.stdout.splitlines()[-1]) == [0, []]
