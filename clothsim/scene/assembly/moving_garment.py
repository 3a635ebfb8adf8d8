"""Garment on a moving body of a scene: the motion as inputs of a model, canonical garments, predictions, verdicts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.mesh.world import World
from clothsim.scene.assembly.checked_garment import CheckedSurfaces, Prediction
from clothsim.scene.assembly.drape_model import family, predicted, read_model, refuse_unlike
from clothsim.scene.assembly.model_body import MANNEQUIN, PlacedCharacter, character_of_scene
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.scene import Scene
from transfer.canonical import kernel_average
from transfer.errors import TransferError
from transfer.motion_model import MotionModel

STEP = 0.04
"""Step of the backward differences that give velocities and accelerations [s]."""
PAST = (4, 7)
"""Steps before the present at which a model sees the joints too."""
MOVED = ("motion", "pose", "shape", "position", "rotation_degrees")
"""Keys of the body that a model takes as inputs, or that change nothing for it."""
PROPERTIES = ("density", "stiffness_along_warp", "stiffness_along_weft", "bending_along_warp", "bending_along_weft")
"""Properties of the fabric that a model takes, by their logarithms."""


@dataclass(frozen=True, eq=False)
class MovingGarment:
    """The cloths of a scene on its only body model.

    Attributes
    ----------
    scene : Scene
    world : World
        Cloths and bodies at the start.
    made : PlacedCharacter
    name : str
        Of the body.
    """

    scene: Scene
    world: World
    made: PlacedCharacter
    name: str

    @classmethod
    def of_scene(cls, scene: Scene) -> "MovingGarment":
        """The cloths of a scene on its only body model.

        Raises
        ------
        InputError
            The scene has no cloth, no body model or several, or rigid bodies.
        """
        if scene.rigid_bodies:
            raise InputError("A garment that moves with a body has no rigid bodies.", "Leave [[rigid]] out.")
        made, name = character_of_scene(scene)
        world = world_of(replace(scene, seed={}))
        if not world.cloths:
            raise InputError("The scene has no cloth.", "Write [[cloth]].")
        return cls(scene, world, made, name)

    @property
    def reference(self) -> Floats:
        """The body's own vertices in its rest pose, (n, 3) [m]."""
        return self.made.character.positions

    @property
    def start(self) -> Floats:
        """Positions of all cloths at time 0, as the scene places them, (k, 3) [m]."""
        return self.world.start()[: self.world.n_cloth] + self.world.origin

    @cached_property
    def rows(self) -> Any:
        """Averages of the body's vertices at those of the garment at time 0, a csr_array (k, n)."""
        return kernel_average(self.made.vertices(0.0), self.made.character.triangles).averaging(self.start)

    @cached_property
    def surfaces(self) -> CheckedSurfaces:
        """The surfaces that are checked."""
        number = [body.name for body in self.world.bodies].index(self.name)
        mannequin = number == 0 and getattr(self.scene.bodies[0], "model", "") == MANNEQUIN
        return CheckedSurfaces.of_world(self.world, mannequin)

    def bodies(self, time: float) -> tuple[Floats, ...]:
        """Positions of all bodies at a time [s], each (b, 3) [m]."""
        return tuple(np.asarray(body.at(time) + self.world.origin) for body in self.world.bodies)

    def family(self, varied: Sequence[str]) -> str:
        """sha256 of the garment and the body, without varied keys and without what moves the body."""
        number = next(k for k, body in enumerate(self.world.bodies) if body.name == self.name)
        body = "body" if len(self.world.bodies) == 1 else f"body[{number}]"
        return family(self.scene, [*varied, *(f"{body}.{key}" for key in MOVED)])

    def inputs(self, times: Sequence[float] | Floats) -> Floats:
        """Inputs of a model in frames at `times` (f,) [s], (f, p).

        Seen from the root joint: the joints now and PAST steps before, their velocities and accelerations, the
        direction of gravity; then the joints and girths of the body at rest, and the logarithms of PROPERTIES of each
        cloth.
        """
        skeleton, joints = self.made.character.skeleton, dict[float, Floats]()
        rest, character = skeleton.rest_positions(), self.made.character
        apart = np.linalg.norm(character.positions[:, None, :] - rest[character.joints][None], axis=2)
        weight = character.weights / np.maximum(character.weights.sum(axis=0), 1e-12)
        girths = (weight * apart).sum(axis=0)  # mean distance from each joint of the vertices that follow it
        of_cloths = [np.mean(cloth.per_triangle(name)) for cloth in self.world.cloths for name in PROPERTIES]
        fabrics = np.log(np.maximum(of_cloths, 1e-12))
        constant, found = np.concatenate([(rest - rest[0]).ravel(), girths, fabrics]), []
        for time in times:
            ago = [round(float(time) - steps * STEP, 9) for steps in (0, 1, 2, *PAST)]
            joints |= {at: skeleton.transforms(self.made.pose(at)) for at in ago if at not in joints}
            found.append(np.concatenate([self._motion([joints[at] for at in ago]), constant]))
        return np.array(found)

    def _motion(self, at: Sequence[Floats]) -> Floats:
        """What changes with time of the inputs: of the joints (j, 4, 4) now, in steps before, and at PAST."""
        root = at[0][0]
        axes = root[:3, :3] / np.linalg.norm(root[:3, :3], axis=0)
        now, before, earlier, *past = ((each[:, :3, 3] - root[:3, 3]) @ axes for each in at)
        velocity, acceleration = (now - before) / STEP, (now - 2 * before + earlier) / STEP**2
        down = axes.T @ self.made.linear.T @ np.array([0.0, 0.0, -1.0])
        parts = (now, *past, velocity, acceleration, down / np.linalg.norm(down))
        return np.concatenate([np.ravel(part) for part in parts])

    def unposed(self, points: Floats, time: float, reference: Floats) -> Floats:
        """Canonical positions (k, 3) [m], beside a reference body, of posed ones at a time [s]."""
        return self.made.skinning(time, reference).unposed(points, self.rows)

    def posed(self, canonical: Floats, time: float, reference: Floats) -> Floats:
        """Posed positions (k, 3) [m] of canonical ones at a time [s]."""
        return self.made.skinning(time, reference).posed(canonical, self.rows)

    def canonical(self, model: MotionModel, times: Sequence[float] | Floats) -> Floats:
        """The canonical garments that a model predicts in frames at its rate from time 0 on, (f, k, 3) [m].

        Raises
        ------
        InputError
            For a model of another garment or body.
        """
        self.refuse_other(model)
        try:
            found = model.canonical(self.inputs(times))
        except TransferError as error:
            raise InputError(error.sentence, error.remedy) from error
        if found.shape[1] != self.world.n_cloth:
            raise InputError(
                f"The model is of a garment of {found.shape[1]} vertices, the scene's has {self.world.n_cloth}.",
                "Learn a model of this garment.",
            )
        return found

    def model_in(self, file: Path) -> MotionModel:
        """The model of motion in a file. InputError for another file, or a model of another garment or body."""
        model = read_model(file)
        if not isinstance(model, MotionModel):
            raise InputError(f"{file} is a model of drapes at rest.", "Learn one of motion: `clothsim learn --motion`.")
        self.refuse_other(model)
        return model

    def refuse_other(self, model: MotionModel) -> None:
        """InputError for a model of another garment or body."""
        if self.reference.shape != model.reference.shape:
            raise InputError(
                f"The model is of a body of {len(model.reference)} vertices, the scene's has {len(self.reference)}.",
                "Use the body of the farm's recipe, or learn a model of this one.",
            )
        if self.family([*model.free, *model.same]) != model.family:
            raise InputError(
                "The model is of another garment or body: they differ in more than the motion, the shape of the body "
                f"and {', '.join([*model.free, *model.same]) or 'nothing else'}.",
                "Use the cloth and body of the farm's recipe, or learn a model of these.",
            )
        refuse_unlike(self.scene, model.same, model.same_as)

    def predicted(self, model: MotionModel, time: float) -> Floats:
        """The positions of all cloths that a model predicts at one time [s], (k, 3) [m]."""
        times = np.append(np.arange(0.0, time, 1.0 / model.rate), time)
        return self.posed(self.canonical(model, times)[-1], time, model.reference)

    def checked(self, cloth: Floats, time: float) -> Prediction:
        """The verdict on positions of all cloths (k, 3) [m] at a time [s]."""
        return self.surfaces.check(cloth, self.bodies(time))


def positions_of_model(file: Path, scene: Scene) -> Floats:
    """The positions of all cloths at time 0, (k, 3) [m], that the model in a file predicts for a scene.

    InputError for another file, or a model of another garment or body.
    """
    model = read_model(file)
    if not isinstance(model, MotionModel):
        return predicted(model, scene)
    return MovingGarment.of_scene(scene).predicted(model, 0.0)
