"""Loss of a scene as a function of the logarithms of some of its numbers, each evaluation a run with its gradient."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.adjoint.gradient import Gradient
from clothsim.adjoint.losses import Loss
from clothsim.adjoint.run import Trace, traced
from clothsim.adjoint.scene_values import value_at, with_value
from clothsim.arrays import Floats
from clothsim.build.meshes import FABRIC
from clothsim.errors import ClothsimError, InputError
from clothsim.intersection.crossings import crossings
from clothsim.io.run_surfaces import world_surfaces
from clothsim.scene.scene import Scene


@dataclass(frozen=True)
class Evaluation:
    """A run of a minimisation.

    Parameters
    ----------
    values : mapping
        Its numbers by path.
    loss : float
        inf where the run cannot be taken.
    slope : (k,) float64
        Derivative of the loss by the logarithms of the numbers.
    newton_error : float
        What the loss would change by if the run were solved exactly.
    intersecting_pairs : int
        Intersecting triangles in the last state, by the exact test.
    failure : str
        Why it cannot be taken; empty where it was.
    """

    values: Mapping[str, float]
    loss: float
    slope: Floats
    newton_error: float = float("nan")
    intersecting_pairs: int = 0
    failure: str = ""


@dataclass(frozen=True)
class Problem:
    """A loss over the logarithms of numbers at paths.

    Parameters
    ----------
    scene : Scene
        The scene, whose numbers are the first start.
    loss : Loss
        Of its run.
    paths : tuple of str
        The numbers.
    origin : (k,) float64
        Logarithms of the scene's numbers.
    stiffness : mapping
        Contact stiffnesses that are held [Pa], by effect.
    first : Evaluation
        The run of the scene itself.
    """

    scene: Scene
    loss: Loss
    paths: tuple[str, ...]
    origin: Floats
    stiffness: Mapping[str, float]
    first: Evaluation

    def values(self, logarithms: Floats) -> dict[str, float]:
        """Return the numbers by path."""
        return dict(zip(self.paths, np.exp(logarithms).tolist(), strict=True))

    def scene_at(self, logarithms: Floats) -> Scene:
        """Return the scene with other numbers."""
        scene = self.scene
        for path, value in self.values(logarithms).items():
            scene = with_value(scene, path, np.array(value))
        return scene

    def evaluated(self, logarithms: Floats) -> Evaluation:
        """Take a run with its gradient; a failed one is an evaluation too."""
        values = self.values(logarithms)
        try:
            trace = traced(self.scene_at(logarithms), self.stiffness)
            return evaluation(values, trace, trace.gradient(self.loss))
        except InputError:
            raise
        except ClothsimError as error:
            return Evaluation(values, float("inf"), np.zeros(len(values)), failure=error.sentence)


def evaluation(values: Mapping[str, float], trace: Trace, gradient: Gradient) -> Evaluation:
    """Return what a run tells of its numbers."""
    slope = np.array([float(gradient[path]) * value for path, value in values.items()])
    world = trace.session.built.world
    found = crossings(trace.steps[-1].end.positions, world_surfaces(world))
    return Evaluation(values, gradient.value, slope, gradient.newton_error, sum(len(each.pairs) for each in found))


def full_path(name: str) -> str:
    """Return the path of a number; a key of a fabric is meant of the cloth."""
    return f"cloth.{name}" if name in FABRIC else name


def problem_of(scene: Scene, loss: Loss, free: Sequence[str]) -> Problem:
    """Run a scene once, and return the loss of its numbers.

    Raises
    ------
    InputError
        For a path that names no positive number, or a scene that has no gradient.
    ClothsimError
        Where the run fails.
    """
    paths = tuple(dict.fromkeys(full_path(name) for name in free))
    if not paths:
        raise InputError("There is no number to vary.", "Name some, as youngs_modulus,bending_stiffness.")
    trace = traced(scene)
    values = dict[str, float]()
    for path in paths:
        value = value_at(scene, trace.session.built.world, path)
        if value.shape or not value > 0:
            raise InputError(f"{path} is {value}; positive numbers can be recovered.", "Name another, or a component.")
        values[path] = float(value)
    first = evaluation(values, trace, trace.gradient(loss))
    return Problem(scene, loss, paths, np.log(list(values.values())), trace.stiffness, first)
