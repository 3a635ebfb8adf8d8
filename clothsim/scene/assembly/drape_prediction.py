"""Prediction of a model of drapes for any values of its inputs, with the exact test of every prediction."""

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.arrays import Floats, as_vector
from clothsim.base.errors import InputError
from clothsim.geometry.intersection.crossings import Crossing, crossings
from clothsim.mesh.generators.mannequin.generator import JOINTS, template
from clothsim.scene import paths
from clothsim.scene.assembly.drape_model import DrapeModel, predicted, read_model
from clothsim.scene.assembly.meshes import body_of, mesh_shape
from clothsim.scene.assembly.placement import placed
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted garment on its body.

    Attributes
    ----------
    cloth : (n, 3) ndarray
        All cloths one after the other [m].
    bodies : tuple of (b, 3) ndarray
        [m].
    crossings : tuple of Crossing
        All intersections, by the exact test.
    place : str
        Where most of the pairs are; "" without intersections.
    """

    cloth: Floats
    bodies: tuple[Floats, ...]
    crossings: tuple[Crossing, ...]
    place: str

    @property
    def pairs(self) -> int:
        """Number of pairs of triangles that intersect."""
        return sum(len(each.pairs) for each in self.crossings)

    @property
    def verdict(self) -> str:
        """Text: "free of intersections", or "12 pairs of triangles intersect, at the left upper arm"."""
        if not self.crossings:
            return "free of intersections"
        return f"{self.pairs:,} {'pair' if self.pairs == 1 else 'pairs'} of triangles intersect, {self.place}"


@dataclass(frozen=True, eq=False)
class Predictor:
    """A model of drapes with the scene of its farm.

    Attributes
    ----------
    model : DrapeModel
    file : Path
        Of the model.
    scene : Scene
        Its cloth and body without the varied keys; every varied key may have any value.
    cloths, bodies : tuple of SimpleNamespace
        Name, role, and triangles as rows of the positions of all cloths and bodies.
    """

    model: DrapeModel
    file: Path
    scene: Scene
    cloths: tuple[Any, ...]
    bodies: tuple[Any, ...]

    @classmethod
    def of_model(cls, scene: Scene, file: str | Path) -> "Predictor":
        """The predictor of a model in the scene of its farm.

        Parameters
        ----------
        scene : Scene
            Of the farm that the model was learned from.
        file : path
            Of the model.

        Raises
        ------
        InputError
            For another garment or body family than the model's, or a varied key that is of no cloth and body.
        """
        path = Path(file)
        model = read_model(path)
        if scene.rigid_bodies:
            raise InputError("The preview shows cloths and bodies, the scene has rigid bodies.", "Leave [[rigid]] out.")
        middle = 0.5 * (model.low + model.high)
        draft = cls(model, path, scene, (), ())
        at = draft.scene_of(middle)
        predicted(model, at)  # refuses another garment
        world = world_of(replace(at, seed={}))
        surfaces: list[Any] = [*world.cloths, *world.bodies]
        roles = ["cloth"] * len(world.cloths) + ["body"] * len(world.bodies)
        begins = np.cumsum([0, *(len(each.positions) for each in surfaces)])
        parts = [
            SimpleNamespace(name=each.name, role=role, triangles=each.triangles + first)
            for each, role, first in zip(surfaces, roles, begins, strict=False)
        ]
        return replace(draft, cloths=tuple(parts[: len(world.cloths)]), bodies=tuple(parts[len(world.cloths) :]))

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """The joint that moves each vertex of the first body most; () where it is no mannequin."""
        if getattr(self.scene.bodies[0], "mesh", "") != "mannequin":
            return ()

        return tuple(JOINTS[j].replace("_", " ") for j in template().weights.argmax(axis=1))

    def values(self, inputs: ArrayLike) -> dict[str, float]:
        """Values of all varied keys, those that are the same too."""
        given = dict(zip(self.model.inputs.tolist(), np.asarray(inputs, np.float64).tolist(), strict=True))
        return given | {
            str(key): given[str(other)] for key, other in zip(self.model.same, self.model.same_as, strict=True)
        }

    def scene_of(self, inputs: ArrayLike) -> Scene:
        """The scene that starts from the prediction, untangled."""
        return replace(self._varied(inputs), seed={"from": "model", "file": str(self.file.resolve()), "untangle": True})

    def predicted(self, inputs: ArrayLike) -> Prediction:
        """The prediction for the values of the model's inputs. InputError for other than a finite number for each."""
        given = as_vector("inputs", inputs, len(self.model.inputs))
        cloth = self.model.positions(given)
        scene = self._varied(given)
        bodies = tuple(_body(scene, number) for number in range(len(self.bodies)))
        found = crossings(np.concatenate([cloth, *bodies]), [*self.cloths, *self.bodies])
        return Prediction(cloth, bodies, found, self._place(found))

    def _varied(self, inputs: ArrayLike) -> Scene:
        """The scene with the values of all varied keys."""
        scene = self.scene
        for key, value in self.values(inputs).items():
            scene = paths.replace(scene, key, value)
        return scene

    def _place(self, found: tuple[Crossing, ...]) -> str:
        """Where most pairs are: the part of the first body that has most, else the first point."""
        if not found:
            return ""
        most = max(found, key=lambda each: len(each.pairs))
        if self.joints and most.role == "body" and most.second == self.bodies[0].name:
            begin = int(self.bodies[0].triangles.min())
            corners = self.bodies[0].triangles[most.pairs[:, 1], 0] - begin
            return f"at the {Counter(self.joints[k] for k in corners).most_common(1)[0][0]}"
        return f"near ({', '.join(f'{value:.2f}' for value in most.position)}) m"


def _body(scene: Scene, number: int) -> Floats:
    """Positions of a body at the start."""
    keys: Any = scene.bodies[number]
    where = "body" if len(scene.bodies) == 1 else f"body[{number}]"
    if "mesh" not in keys:
        return body_of(keys, where, scene.directory)[0].positions
    return placed(keys, mesh_shape(keys, where, scene.directory).positions)
