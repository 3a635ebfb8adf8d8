"""Resolutions of a scene: steps of a frame, factor of the cells, factor of d_hat."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

from clothsim import Scene, engine
from clothsim.base.errors import InputError
from clothsim.engine import build, with_cells
from clothsim.study.parameters import CELLS, D_HAT, TIME, d_hats, with_explicit_lengths

COARSEST_STEP = 0.01
"""Longest step of the first pilot run [s]. With 20 ms a strip under compression buckled to the other side."""
FEWEST_CELLS = 2
"""Cells along a side below which no pilot run goes."""


@dataclass(frozen=True)
class Resolution:
    """Numerical resolution of a run.

    Parameters
    ----------
    steps : int
        Steps of a frame.
    cells : Fraction
        Factor of the scene's cells.
    d_hat : Fraction
        Factor of the scene's d_hat.
    """

    steps: int
    cells: Fraction = Fraction(1)
    d_hat: Fraction = Fraction(1)


@dataclass(frozen=True)
class Resolvable:
    """A scene without solver.error and what can be refined of it.

    Parameters
    ----------
    scene : Scene
        Scene with its lengths written out.
    frame : float
        Duration of a frame [s].
    coarsest : Resolution
        Resolution of the first pilot run.
    parameters : tuple of str
        What is refined: TIME, CELLS, D_HAT.
    fixed : mapping
        Reason for each that is not.
    """

    scene: Scene
    frame: float
    coarsest: Resolution
    parameters: tuple[str, ...]
    fixed: Mapping[str, str]

    def sizes(self, resolution: Resolution) -> dict[str, float]:
        """Size of each parameter relative to the coarsest."""
        coarsest = self.coarsest
        sizes = {
            TIME: coarsest.steps / resolution.steps,
            CELLS: float(coarsest.cells / resolution.cells),
            D_HAT: float(resolution.d_hat / coarsest.d_hat),
        }
        return {name: sizes[name] for name in self.parameters}

    def refined(self, resolution: Resolution, parameters: Collection[str]) -> Resolution:
        """A resolution with some parameters refined by two; those that the scene has not stay."""
        both = [name for name in parameters if name in self.parameters]
        return Resolution(
            resolution.steps * (2 if TIME in both else 1),
            resolution.cells * (2 if CELLS in both else 1),
            resolution.d_hat / (2 if D_HAT in both else 1),
        )

    def whole(self, factor: Fraction) -> bool:
        """True where the cells of every cloth times a factor are whole numbers."""
        return all((count * factor).denominator == 1 for count in _counts(self.scene))

    def text(self, resolution: Resolution) -> str:
        """A resolution for people: "dt 5 ms, cells x 2, d_hat x 1/2"."""
        parts = [f"dt {1e3 * self.dt(resolution):.3g} ms"]
        parts += [f"cells x {resolution.cells}"] if CELLS in self.parameters else []
        parts += [f"d_hat x {resolution.d_hat}"] if D_HAT in self.parameters else []
        return ", ".join(parts)

    def dt(self, resolution: Resolution) -> float:
        """Time step [s]."""
        return self.frame / resolution.steps

    def at(self, resolution: Resolution, newton_error_fraction: float) -> Scene:
        """The scene at a resolution; a tolerance of its own stays."""
        scene = engine.replace(self.scene, "solver.dt", self.dt(resolution))
        if "tolerance" not in scene.solver:
            scene = engine.replace(scene, "solver.newton_error_fraction", newton_error_fraction)
        for name, d_hat in d_hats(self.scene).items():
            scene = engine.replace(scene, f"effects.{name}.d_hat", d_hat * float(resolution.d_hat))
        return scene if resolution.cells == 1 else with_cells(scene, resolution.cells)


def resolvable(given: Scene) -> Resolvable:
    """What can be refined of a scene; it takes BDF2 unless the scene names its integrator.

    With solver.error every step is converged.
    """
    threads = given.solver_settings.threads
    solver = {key: value for key, value in given.solver.items() if key != "error"}
    if given.solver_settings.error and "tolerance" not in solver:
        solver["converge"] = True
    scene = replace(given, solver={"integrator": "bdf2", **solver})
    scene = engine.replace(with_explicit_lengths(scene, build(scene).energies), "solver.threads", threads)
    run, missing = scene.run_settings, {}
    frame = min(1 / run.frames_per_second, run.duration)
    steps = max(1, -int(-frame // COARSEST_STEP))
    parameters = [TIME]
    cells = Fraction(1)
    try:
        with_cells(scene, Fraction(2))
        parameters.append(CELLS)
        cells = Fraction(1, 2) if has_cells_for(scene, 2) else cells
    except InputError as error:
        missing[CELLS] = error.sentence.rstrip(".")
    if d_hats(scene):
        parameters.append(D_HAT)
    return Resolvable(scene, frame, Resolution(steps, cells), tuple(parameters), missing)


def has_cells_for(scene: Scene, factor: int, fewest: int = FEWEST_CELLS) -> bool:
    """True where every cloth's cells over a factor are whole numbers, `fewest` or more."""
    if any(count % factor or count < factor * fewest for count in _counts(scene)):
        return False
    try:
        with_cells(scene, Fraction(1, factor))
    except InputError:
        return False
    return True


def _counts(scene: Scene) -> list[int]:
    """Cells along each side of each cloth."""
    counts = [keys["cells"] for keys in with_cells(scene, Fraction(1)).cloths]
    return [count for each in counts for count in (each if isinstance(each, list | tuple) else [each])]
