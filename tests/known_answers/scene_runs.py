"""Scenes as a user writes them, run by `clothsim.simulate`: last frame, forces on pins, rows on three meshes.

What a scene does not name is the default of the package, so that rows of these hold the defaults too.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from clothsim import Scene, simulate
from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from tests.known_answers.row import Outcome

G = 9.81
ELASTIC: Mapping[str, Any] = {"membrane": {}, "bending": {}}
PAPER: Mapping[str, Any] = {
    "density": 0.15,
    "thickness": 3e-4,
    "youngs_modulus": 2e7,
    "poisson_ratio": 0.0,
    "bending_stiffness": 1e-4,
}
"""A sheet that hardly stretches: E2 = 6,000 N/m. Without Poisson's ratio a strip bends by D, however wide."""
WEIGHT = PAPER["density"] * G
"""Of PAPER [N/m2]."""
AT_ONCE: Mapping[str, Any] = {"duration": 1.0, "frames_per_second": 1.0, "forces": True}
"""A run section: a quasi-static scene whose loads grow over a second, with the forces at its end."""


@dataclass(frozen=True)
class Ended:
    """A run that came to its end.

    Parameters
    ----------
    times : (k,) float64
        Times of the frames [s].
    positions : (k, n, 3) float64
        Positions of the cloth at the frames [m].
    moving : (k, b, 3) float64
        Vertices of the rigid body at the frames [m]; empty without one.
    pins : mapping of str to (3,)
        Force of each group of pins on the cloth at the end [N]; empty without `run.forces`.
    """

    times: Floats
    positions: Floats
    moving: Floats
    pins: Mapping[str, Floats]

    @property
    def last(self) -> Floats:
        """Positions of the cloth at the end (n, 3) [m]."""
        return self.positions[-1]


def ended(scene: Scene) -> Ended:
    """Run a scene in a temporary folder. ClothsimError where it does not come to its end."""
    with TemporaryDirectory() as folder:
        run = simulate(scene, Path(folder) / "run")
        if run.status != "completed":
            raise ClothsimError(run.reason)
        frames = range(len(run.times))
        names = [rigid.name for rigid in scene.rigid_bodies]
        moving = np.array([[x for name, x, _ in run.bodies(k) if name in names] for k in frames])
        positions = np.array([run.positions(k) for k in frames])
        forces = run.forces().pins if scene.run_settings.forces else {}
        pins = {name: values[-1] for name, values in forces.items()}
        return Ended(np.asarray(run.times), positions, moving[:, 0] if moving.size else moving, pins)


def on_meshes(
    measure: Callable[[int], float],
    cells: Sequence[int],
    exact: float,
    bar: float,
    orders: tuple[float, float],
    printed: str = "",
) -> Outcome:
    """The value on the finest of three meshes, the deviations of all, and the order of the last two."""
    values = [measure(count) for count in cells]
    errors = [abs(value - exact) for value in values]
    order = float(np.log(errors[-2] / errors[-1]) / np.log(cells[-1] / cells[-2]))
    coarser = tuple(value / exact - 1 for value in values[:-1])
    return Outcome(values[-1], exact, bar, printed=printed, order=order, orders=orders, coarser=coarser)
