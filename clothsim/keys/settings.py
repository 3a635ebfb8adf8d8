"""The sections [solver], [contact], [run] and [seed]: plain numbers and names with their defaults."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from clothsim.base.errors import InputError
from clothsim.keys.key_table import KeyTable
from clothsim.keys.schema import Key, Vector

MOTION, CONVERGED = 0.3, 0.1
"""newton_error_fraction where none is given: of steps that end by their motion, and of converged ones, the largest that
held in six scenes with one solution (docs/notes/newton_stop.md)."""


@dataclass(frozen=True, kw_only=True)
class Solver(KeyTable):
    """Time step, tolerance, integrator and linear solver: the section [solver].

    Examples
    --------
    >>> import clothsim
    >>> clothsim.Solver(dt=0.02, threads=1).as_table()
    {'dt': 0.02, 'threads': 1}
    """

    section: ClassVar[str] = "solver"

    dt: Annotated[float, Key("Length of a time step", "s", above=0)] = 0.01
    newton_error_fraction: Annotated[
        float,
        Key("Newton's method stops when its error is below this fraction of the error of the time step", "1", above=0,
            most=1, shown="0.3; 0.1 with converge or error"),
    ] = 0.0  # fmt: skip
    converge: Annotated[
        bool,
        Key("Solve each step until forces balance and even the fastest vertex is within newton_error_fraction; "
            "otherwise the root mean square over each cloth and body decides"),
    ] = False  # fmt: skip
    tolerance: Annotated[
        float,
        Key("In place of newton_error_fraction: Newton's method stops when |dx|_inf / dt is below this", "m/s", above=0,
            shown="none: newton_error_fraction is used"),
    ] = 0.0  # fmt: skip
    integrator: Annotated[
        Literal["bdf2", "backward_euler"], Key("Time integrator; backward Euler is of first order and damps more")
    ] = "bdf2"
    linear: Annotated[
        Literal["auto", "mixed", "pardiso", "cholmod", "superlu"],
        Key(
            "Linear solver; auto is the fastest that is installed; mixed is PARDISO in single precision with refinement"
        ),
    ] = "auto"
    threads: Annotated[
        int,
        Key("Threads of a step; 0: one, or up to 4 from 20,000 vertices on; 1 gives identical results in every run",
            "1", least=0),
    ] = 0  # fmt: skip
    repeatable: Annotated[
        bool, Key("Results do not depend on the number of threads; a factorisation takes 1.05 to 1.2 times as long")
    ] = False
    max_iterations: Annotated[
        int, Key("Newton iterations of a step before dt is halved; without inertia ten times as many", "1", least=1)
    ] = 100
    unstable_equilibrium: Annotated[
        Literal["leave", "keep"],
        Key("Leave unstable equilibria along their lowest mode, or only record them"),
    ] = "leave"
    perturbation_seed: Annotated[
        int, Key("Side to which an unstable equilibrium is left; 2 k and 2 k + 1 take opposite sides", "1", least=0)
    ] = 0
    error: Annotated[
        float,
        Key("In place of dt: RMS error of the positions at the last frame; dt, cells of generated meshes, d_hat and "
            "tolerance are chosen for it", "m", above=0, shown="none: dt is fixed"),
    ] = 0.0  # fmt: skip
    estimate: Annotated[
        bool,
        Key("Estimate the error by two more runs, with dt, cells of generated meshes and d_hat coarser by 2 and 4"),
    ] = False
    budget: Annotated[float, Key("CPU time that all runs for error may take", "s", above=0)] = 600.0

    @property
    def longest_step(self) -> float:
        """dt [s]; inf if the steps are chosen by their error."""
        return math.inf if self.error else self.dt

    @property
    def stop_fraction(self) -> float:
        """Fraction of the time error at which Newton's method stops: that given, or MOTION or CONVERGED."""
        return self.newton_error_fraction or (CONVERGED if self.converge or self.error else MOTION)

    @property
    def balanced(self) -> bool:
        """True if Newton's method stops by the time error, False if a tolerance is given."""
        return not self.tolerance

    @classmethod
    def parsed(cls, where: str, given: Any) -> "Solver":
        """The section of a table, which has dt or error, and newton_error_fraction or tolerance."""
        solver = super().parsed(where, given)
        if {"dt", "error"} <= given.keys():
            raise InputError(f"{where} has dt and error.", "Give one of them: with error the steps are chosen.")
        if {"newton_error_fraction", "tolerance"} <= given.keys():
            why = "with a tolerance Newton's method stops there, whatever the time error"
            raise InputError(f"{where} has newton_error_fraction and tolerance.", f"Give one of them: {why}.")
        return solver


@dataclass(frozen=True, kw_only=True)
class Contact(KeyTable):
    """Implementation of contact, and what happens in a pinch: the section [contact]."""

    section: ClassVar[str] = "contact"

    backend: Annotated[
        Literal["auto", "numba", "ipctk"],
        Key("Contact implementation; every value uses numba, and ipctk is deprecated"),
    ] = "auto"
    pinch: Annotated[
        Literal["stop", "carry"],
        Key("Cloth between two closing parts of bodies: the run stops, or one of them carries it until they open"),
    ] = "stop"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.backend == "ipctk":
            why = "the package's own contact is taken, to which ipctk is the oracle of the tests"
            warnings.warn(f'contact.backend = "ipctk" is deprecated: {why}.', DeprecationWarning, stacklevel=3)


FieldName: TypeAlias = Literal[
    "deformation_gradient", "rotation", "right_stretch", "principal_stretches", "principal_directions", "compression",
    "thickness", "vertex_frames", "stress", "energy_density", "contact_pressure",
    "contact_force", "body_force", "body_pressure",
]  # fmt: skip
"""Names of the fields that a run can write; `clothsim.run.fields.FIELDS` has their formulas."""


@dataclass(frozen=True, kw_only=True)
class RunSettings(KeyTable):
    """Duration or end at rest, frame rate and fields of the frames: the section [run].

    Examples
    --------
    >>> import clothsim
    >>> clothsim.RunSettings(duration=0.5, fields=["thickness", "stress"]).as_table()
    {'duration': 0.5, 'fields': ('thickness', 'stress')}
    """

    section: ClassVar[str] = "run"

    duration: Annotated[
        float, Key("Simulated time; a quasi-static run steps its loads over it", "s", above=0)
    ] = 2.0  # fmt: skip
    frames_per_second: Annotated[float, Key("Frames written for each simulated second", "1/s", above=0)] = 25.0
    until: Annotated[
        Literal["time", "rest"], Key("End of the run: the duration, or the first frame at rest, if that is earlier")
    ] = "time"
    rest_speed: Annotated[
        float,
        Key("Limit for rest: for 10 steps no vertex is faster, nor farther from equilibrium than this times 1 s", "m/s",
            above=0),
    ] = 1e-3  # fmt: skip
    fields: Annotated[
        Sequence[FieldName],
        Key("Fields written with each frame, in addition to the positions and the principal stretches"),
    ] = ()
    forces: Annotated[
        bool, Key("Record at each step the contact force on each body and the reaction of each group of pins")
    ] = False
    budget: Annotated[
        float | None,
        Key("CPU time of the steps after which a run ends as failed, with a checkpoint to resume from", "s", above=0,
            shown="none"),
    ] = None  # fmt: skip
    allow_inside: Annotated[
        bool, Key("Allow cloth that starts wholly inside a body, where contact holds it; else it is refused")
    ] = False


@dataclass(frozen=True, kw_only=True)
class Seed(KeyTable):
    """Initial positions of the cloths: the section [seed]."""

    section: ClassVar[str] = "seed"

    from_: Annotated[
        Literal["rest", "file", "model", "transfer"],
        Key(
            "Source of the initial positions: the rest shape as placed, a file, or the prediction of `clothsim learn`; "
            "`clothsim fit` transfers garments"
        ),
    ] = "rest"
    file: Annotated[
        str, Key("Mesh file with a position for each vertex of the cloths before welding, or a learned model")
    ] = ""
    vertices: Annotated[
        Sequence[int] | None, Key("Range [lo, hi) of the file's vertices", "1", least=0, length=2, shown="all")
    ] = None
    position: Annotated[Vector | None, Key("Displacement of the file's vertices", "m", length=3, shown="none")] = None
    untangle: Annotated[
        bool, Key("Move vertices at intersections and in collapsed triangles until the start is free of them")
    ] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.from_ == "transfer":
            raise InputError(
                'seed.from "transfer" is a command of its own.',
                "`clothsim fit GARMENT --made-for BODY --to BODY` does it.",
            )
        if (self.from_ in ("file", "model")) != bool(self.file):
            raise InputError('seed needs from = "file" and a file together.', 'Write from = "file" and file = "PATH".')
        if self.from_ != "file" and (self.vertices is not None or self.position is not None):
            raise InputError("seed.vertices and seed.position belong to a seed file.", 'Give from = "file" and a file.')
