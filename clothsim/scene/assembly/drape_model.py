"""Learned models of drapes at rest: positions of a garment as a function of the varied keys of its scene.

A model is affine in the standardised inputs, which are clipped to the box of its training drapes: principal components
of the drapes, and a ridge regression to their coefficients, folded into one matrix. `clothsim learn` makes it. Every
prediction gets the exact test.
"""

import hashlib
import json
import zipfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clothsim.base.arrays import Floats, as_vector
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.base.file_writing import refuse_replacing, replacing
from clothsim.geometry.intersection.crossings import Crossing, crossings
from clothsim.mesh.generators.mannequin.generator import JOINTS, template
from clothsim.mesh.topology import components
from clothsim.mesh.winding import is_inside
from clothsim.scene import paths
from clothsim.scene.assembly.meshes import body_of, mesh_shape
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.assembly.shapes import placed
from clothsim.scene.named_files import by_content
from clothsim.scene.scene import Scene

FAMILY = ("cloth", "body", "rigid")
"""Sections that say what the garment and the body are."""


@dataclass(frozen=True, eq=False)
class DrapeModel:
    """Affine model of drapes.

    Attributes
    ----------
    family : str
        sha256 of garment and body without the varied keys.
    inputs : (p,) array of str
        Varied keys that are numbers.
    same, same_as : (s,) arrays of str
        Keys that have the value of another one, and that other.
    low, high, centre, scale : (p,) ndarray
        Box, mean and standard deviation of the inputs.
    weights : (1 + p, k) ndarray
        Coefficients of 1 and of the standardised inputs.
    mean : (3n,) ndarray [m]
    basis : (3n, k) ndarray
    """

    family: str
    inputs: NDArray[np.str_]
    same: NDArray[np.str_]
    same_as: NDArray[np.str_]
    low: Floats
    high: Floats
    centre: Floats
    scale: Floats
    weights: Floats
    mean: Floats
    basis: Floats

    @classmethod
    def of_scene(cls, scene: Scene, inputs: Sequence[str], same: Mapping[str, str], **arrays: Any) -> "DrapeModel":
        """The model of the garment and body of a scene; same: keys with the value of another, arrays: all others."""
        names = np.array(inputs), np.array([*same], np.str_), np.array([*same.values()], np.str_)
        return cls(family(scene, [*inputs, *same]), *names, **arrays)

    def positions(self, inputs: Sequence[float] | Floats) -> Floats:
        """Predicted positions (n, 3) [m]; inputs outside of the box are clipped to it."""
        clipped = np.clip(np.asarray(inputs, np.float64), self.low, self.high)
        features = np.concatenate([[1.0], (clipped - self.centre) / self.scale])
        return (self.mean + self.basis @ (features @ self.weights)).reshape(-1, 3)

    def write(self, path: Path, overwrite: bool = False) -> Path:
        """Write the model as .npz, for `read_model`. InputError where there is such a file, without `overwrite`."""
        refuse_replacing([path], overwrite)
        arrays: dict[str, Any] = {name: np.asarray(value) for name, value in asdict(self).items()}
        with replacing(path) as beside, beside.open("wb") as target:
            np.savez_compressed(target, **arrays)
        return path


def predicted(model: DrapeModel, scene: Scene) -> Floats:
    """The positions (n, 3) that a model predicts for a scene [m].

    InputError for another garment or body family than the model's, or without one of its inputs.
    """
    inputs, same, same_as = (names.tolist() for names in (model.inputs, model.same, model.same_as))
    varied = [*inputs, *same]
    if family(scene, varied) != model.family:
        raise InputError(
            f"seed.file {scene.seed_settings.file} is a model of another garment or body: they differ in more than "
            f"{', '.join(varied)}.",
            "Use the cloth and body of the farm's recipe, or learn a model of these.",
        )
    for key, other in zip(same, same_as, strict=True):
        if paths.get(scene, key) != paths.get(scene, other):
            raise InputError(f"{key} differs from {other}, which the model's drapes have alike.", f"Set {key} too.")
    return model.positions([_number(key, paths.get(scene, key)) for key in inputs])


def family(scene: Scene, varied: Sequence[str]) -> str:
    """sha256 of garment and body without the varied keys, files by their content."""
    sections = {
        name: table for name, table in json.loads(scene.to_text(names_of_functions=True)).items() if name in FAMILY
    }
    for path in varied:
        if paths.parts_of(path)[0] not in FAMILY:
            continue
        section, number, (*keys, last) = paths.located(scene, path)
        inner = sections[section] if isinstance(sections[section], dict) else sections[section][number]
        for key in keys:
            inner = inner.get(key, {}) if isinstance(inner, dict) else inner[key]
        if isinstance(inner, dict):
            inner.pop(last, None)
    text = json.dumps(by_content(sections, scene.directory), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


LARGEST_MODEL = 1 << 30
"""Largest content of the file of a model [bytes]."""


def read_model(path: Path) -> DrapeModel:
    """The model in a file of `DrapeModel.write`. InputError for another file."""
    try:
        with zipfile.ZipFile(BytesIO(read_regular_file(path))) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > LARGEST_MODEL:
                raise ValueError(f"it unpacks to more than {LARGEST_MODEL:,} bytes")
        with np.load(path, allow_pickle=False) as arrays:
            content = {name: arrays[name] for name in DrapeModel.__dataclass_fields__}
        _refuse_other_shapes(content)
    except InputError:
        raise
    except Exception as error:  # zipfile, zlib and NumPy's header raise a dozen types of errors
        raise InputError(f"{path} is no model of drapes.", "Make one: `clothsim learn DIR -o model.npz`.") from error
    return DrapeModel(**{**content, "family": str(content["family"])})


def _refuse_other_shapes(content: Mapping[str, NDArray[Any]]) -> None:
    """ValueError for arrays that do not fit together, or hold numbers that are not finite."""
    k, components, coordinates = len(content["inputs"]), content["weights"].shape[1], content["mean"].size
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(("low", "high", "centre", "scale"), (k,))
    shapes |= {"weights": (1 + k, components), "mean": (coordinates,), "basis": (coordinates, components)}
    for name, shape in shapes.items():
        if content[name].shape != shape or not np.isfinite(content[name]).all():
            raise ValueError(f"{name} has the shape {content[name].shape}, or is not finite")
    if coordinates % 3 or not content["scale"].all() or len(content["same"]) != len(content["same_as"]):
        raise ValueError("its arrays do not fit together")


def _number(key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"The model needs {key}, which the scene has not as a number.", f"Write {key} in the scene.")
    return float(value)


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
    inside : int
        Number of vertices of pieces whose first vertex is inside a body.
    """

    cloth: Floats
    bodies: tuple[Floats, ...]
    crossings: tuple[Crossing, ...]
    place: str
    inside: int

    @property
    def clean(self) -> bool:
        """True where nothing intersects and no piece is inside a body."""
        return not self.crossings and not self.inside

    @property
    def pairs(self) -> int:
        """Number of pairs of triangles that intersect."""
        return sum(len(each.pairs) for each in self.crossings)

    @property
    def verdict(self) -> str:
        """Text: "free of intersections", or "12 pairs of triangles intersect, at the left upper arm"."""
        held = f"{self.inside:,} of {len(self.cloth):,} vertices are inside a body"
        if not self.crossings:
            return held if self.inside else "free of intersections"
        found = f"{self.pairs:,} {'pair' if self.pairs == 1 else 'pairs'} of triangles intersect, {self.place}"
        return f"{found}; {held}" if self.inside else found


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
        bodies = tuple(_body_at_start(scene, number) for number in range(len(self.bodies)))
        found = crossings(np.concatenate([cloth, *bodies]), [*self.cloths, *self.bodies])
        return Prediction(cloth, bodies, found, self._place(found), self._count_inside(cloth, bodies))

    def _count_inside(self, cloth: Floats, bodies: tuple[Floats, ...]) -> int:
        """Vertices of pieces inside a body: one vertex of a piece tells for it, where the two do not intersect."""
        pieces = components(np.concatenate([part.triangles for part in self.cloths]), len(cloth))
        held = {
            piece
            for piece, first in zip(*np.unique(pieces, return_index=True), strict=True)
            for part, points in zip(self.bodies, bodies, strict=True)
            if is_inside(cloth[first], points, part.triangles - int(part.triangles.min()))
        }
        return int(np.isin(pieces, list(held)).sum())

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


def _body_at_start(scene: Scene, number: int) -> Floats:
    """Positions of a body at the start."""
    keys: Any = scene.bodies[number]
    where = "body" if len(scene.bodies) == 1 else f"body[{number}]"
    if "mesh" not in keys:
        return body_of(keys, where, scene.directory)[0].positions
    return placed(keys, mesh_shape(keys, where, scene.directory).positions)
