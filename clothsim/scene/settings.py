"""The sections of a scene that are plain numbers and names, with their defaults."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from clothsim.errors import InputError


@dataclass(frozen=True)
class Solver:
    """dt [s]; tolerance on |dx|_inf/dt [m/s]; integrator; linear solver; threads (0: all cores, 1: repeatable bits).

    error [m], in place of dt: what the steps may add to the positions in the whole run (RMS); 0 where dt is given.
    """

    dt: float = 0.01
    tolerance: float = 1e-3
    integrator: str = "backward_euler"
    linear: str = "auto"
    threads: int = 0
    max_iterations: int = 100
    error: float = 0.0

    @property
    def longest_step(self) -> float:
        """dt [s]; inf where the steps are chosen by their error."""
        return math.inf if self.error else self.dt

    def __post_init__(self) -> None:
        if self.integrator not in ("backward_euler", "bdf2"):
            raise InputError(f"solver.integrator is {self.integrator!r}.", 'Known: "backward_euler", "bdf2".')
        if self.max_iterations == 0:
            raise InputError("solver.max_iterations must be at least 1.")


@dataclass(frozen=True)
class Contact:
    """backend: "auto" (numba), "numba" or "ipctk"."""

    backend: str = "auto"

    def __post_init__(self) -> None:
        if self.backend not in ("auto", "numba", "ipctk"):
            raise InputError(f"contact.backend is {self.backend!r}.", 'Known: "auto", "numba", "ipctk".')


@dataclass(frozen=True)
class RunSettings:
    """duration [s]; frames_per_second: how often a frame is kept."""

    duration: float = 2.0
    frames_per_second: float = 25.0


@dataclass(frozen=True)
class Seed:
    """Where the cloth starts: from its rest shape as placed, or from the vertices of a `file`.

    vertices: [lo, hi], only these of the file; position (3,): the file moved by it [m]; untangle: vertices at crossings
    and in squeezed triangles are moved until nothing intersects (see `scene.untangle`).
    """

    from_: str = "rest"
    file: str = ""
    vertices: Sequence[int] | None = None
    position: Sequence[float] | None = None
    untangle: bool = False

    def __post_init__(self) -> None:
        if self.from_ == "transfer":
            raise InputError(
                'seed.from "transfer" is a command of its own.', "`clothsim fit GARMENT --from BODY --to BODY` does it."
            )
        if self.from_ not in ("rest", "file"):
            raise InputError(f"seed.from is {self.from_!r}.", 'Known: "rest", "file".')
        if not self.file.isprintable():
            raise InputError(f"seed.file is {self.file!r}, which names no file.")
        if (self.from_ == "file") != bool(self.file):
            raise InputError('seed needs from = "file" and a file together.')
        if self.from_ == "rest" and (self.vertices is not None or self.position is not None):
            raise InputError("seed.vertices and seed.position belong to a seed file.", 'Give from = "file" and a file.')
