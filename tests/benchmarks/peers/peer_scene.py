"""The scene that every simulator gets, in a file; it needs NumPy alone, so that the Python of a peer can read it."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

GRAVITY = 9.81
"""[m/s2]."""


@dataclass(frozen=True)
class PeerScene:
    """A square sheet at rest above a ball that does not move.

    Parameters
    ----------
    cells : int
        Cells along an edge of the sheet.
    positions, triangles : (n, 3) float, (m, 3) int
        The sheet [m].
    ball_positions, ball_triangles : (p, 3) float, (q, 3) int
        The ball as a mesh [m], inscribed in a sphere of `radius` about the origin.
    density : float
        Mass of the sheet by area [kg/m2].
    stretch, poisson, bending : float
        Young's modulus times thickness [N/m], Poisson's ratio and bending stiffness [N m] of an isotropic sheet.
    gap : float
        Distance at which contact acts [m].
    friction : float
        Coefficient, of the ball and of the sheet with itself.
    dt, steps : float, int
        Step [s], and their number.
    """

    cells: int
    positions: Any
    triangles: Any
    ball_positions: Any
    ball_triangles: Any
    radius: float
    density: float
    stretch: float
    poisson: float
    bending: float
    gap: float
    friction: float
    dt: float
    steps: int

    @property
    def shell(self) -> tuple[float, float]:
        """Young's modulus [Pa] and thickness [m] of a solid sheet as stiff in its plane and in bending."""
        thickness = float(np.sqrt(12.0 * self.bending * (1.0 - self.poisson**2) / self.stretch))
        return self.stretch / thickness, thickness

    @property
    def lame(self) -> tuple[float, float]:
        """Lame parameters mu and lambda of the sheet in plane stress [N/m]."""
        return self.stretch / (2.0 * (1.0 + self.poisson)), self.stretch * self.poisson / (1.0 - self.poisson**2)

    def write(self, file: Path) -> None:
        """Write the scene to a .npz file."""
        np.savez(file, **{field.name: getattr(self, field.name) for field in fields(self)})


def read_scene(file: Path) -> PeerScene:
    """The scene in a .npz file."""
    with np.load(file) as kept:
        return PeerScene(**{name: kept[name] if kept[name].ndim else kept[name].item() for name in kept.files})


@dataclass(frozen=True)
class Simulation:
    """A peer ready to run.

    Parameters
    ----------
    step : callable
        Advances by the scene's dt.
    positions : callable
        The sheet's (n, 3) at the time that has been reached [m].
    settings : str
        What was chosen.
    velocities : callable, optional
        The sheet's (n, 3) at that time [m/s].
    masses : (n,) float, optional
        Of the sheet's vertices [kg].
    notes : callable, optional
        What the steps so far met, for example how many stopped at a limit.
    """

    step: Callable[[], None]
    positions: Callable[[], Any]
    settings: str
    velocities: Callable[[], Any] | None = None
    masses: Any = None
    notes: Callable[[], str] | None = None

    def energy(self, start: Any) -> float:
        """Kinetic energy and that of gravity since the positions `start` [J]; nan without velocities and masses."""
        if self.velocities is None or self.masses is None:
            return float("nan")
        speeds = (np.asarray(self.velocities(), float) ** 2).sum(axis=1)
        rise = np.asarray(self.positions(), float)[:, 2] - start[:, 2]
        return float(np.asarray(self.masses, float) @ (0.5 * speeds + GRAVITY * rise))
