"""Learned models of drapes at rest: positions of a garment as a function of the varied keys of its scene.

A model is affine in the standardised inputs, which are clipped to the box of its training drapes: principal components
of the drapes, and a ridge regression to their coefficients, folded into one matrix. `clothsim learn` makes it. Every
prediction gets the exact test.
"""

import hashlib
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clothsim.base.arrays import Floats, as_vector, write_arrays
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.base.inputs import is_number, shown
from clothsim.scene import paths
from clothsim.scene.assembly.checked_garment import CheckedSurfaces, Prediction
from clothsim.scene.assembly.meshes import body_of, mesh_shape
from clothsim.scene.assembly.model_body import value_of
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.assembly.shapes import placed
from clothsim.scene.named_files import by_content
from clothsim.scene.scene import Scene
from transfer.errors import TransferError
from transfer.motion_model import MotionModel, motion_model

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
        return write_arrays(path, {name: np.asarray(value) for name, value in asdict(self).items()}, overwrite)


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
    refuse_unlike(scene, same, same_as)
    return model.positions([_number(key, value_of(scene, key)) for key in inputs])


def refuse_unlike(scene: Scene, same: Sequence[str], same_as: Sequence[str]) -> None:
    """InputError where a key has not the value of that which the garments of a model have alike."""
    for key, other in zip(same, same_as, strict=True):
        mine, its = value_of(scene, key), value_of(scene, other)
        if mine != its:
            raise InputError(
                f"{key} is {shown(mine)} and {other} {shown(its)}, which the model's garments have alike.",
                f"Write {key} = {shown(its)}, or change {other}.",
            )


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


def read_model(path: Path) -> DrapeModel | MotionModel:
    """The model of drapes or of motion in a file of `clothsim learn`. InputError for another file."""
    try:
        with zipfile.ZipFile(BytesIO(read_regular_file(path))) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > LARGEST_MODEL:
                raise ValueError(f"it unpacks to more than {LARGEST_MODEL:,} bytes")
        with np.load(path, allow_pickle=False) as arrays:
            if "kind" in arrays:
                return motion_model({name: arrays[name] for name in arrays.files})
            content = {name: arrays[name] for name in DrapeModel.__dataclass_fields__}
        k, components, coordinates = len(content["inputs"]), content["weights"].shape[1], content["mean"].size
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(("low", "high", "centre", "scale"), (k,))
        shapes |= {"weights": (1 + k, components), "mean": (coordinates,), "basis": (coordinates, components)}
        for name, shape in shapes.items():
            if content[name].shape != shape or not np.isfinite(content[name]).all():
                raise ValueError(f"{name} has the shape {content[name].shape}, or is not finite")
        if coordinates % 3 or not content["scale"].all() or len(content["same"]) != len(content["same_as"]):
            raise ValueError("its arrays do not fit together")
    except InputError:
        raise
    except TransferError as error:
        raise InputError(f"{path}: {error.sentence}", error.remedy) from error
    except Exception as error:  # zipfile, zlib and NumPy's header raise a dozen types of errors
        raise InputError(f"{path} is not a model of drapes.", "Make one: `clothsim learn DIR -o model.npz`.") from error
    return DrapeModel(**{**content, "family": str(content["family"])})


def _number(key: str, value: Any) -> float:
    if not is_number(value):
        raise InputError(f"The model needs {key}, which is not a number in the scene.", f"Write {key} in the scene.")
    return float(value)


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
    surfaces : CheckedSurfaces
    """

    model: DrapeModel
    file: Path
    scene: Scene
    surfaces: CheckedSurfaces

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
        if not isinstance(model, DrapeModel):
            raise InputError(f"{path} is a model of motion.", "Show it with --motion.")
        if scene.rigid_bodies:
            raise InputError("The preview shows cloths and bodies, the scene has rigid bodies.", "Leave [[rigid]] out.")
        middle = 0.5 * (model.low + model.high)
        draft = cls(model, path, scene, CheckedSurfaces((), (), False))
        at = draft.scene_of(middle)
        predicted(model, at)  # refuses another garment
        world = world_of(replace(at, seed={}))
        mannequin = bool(scene.bodies) and getattr(scene.bodies[0], "mesh", "") == "mannequin"
        return replace(draft, surfaces=CheckedSurfaces.of_world(world, mannequin))

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
        bodies = tuple(_body_at_start(scene, number) for number in range(len(self.surfaces.bodies)))
        return self.surfaces.check(cloth, bodies)

    def _varied(self, inputs: ArrayLike) -> Scene:
        """The scene with the values of all varied keys."""
        scene = self.scene
        for key, value in self.values(inputs).items():
            scene = paths.replace(scene, key, value)
        return scene


def _body_at_start(scene: Scene, number: int) -> Floats:
    """Positions of a body at the start."""
    keys: Any = scene.bodies[number]
    where = "body" if len(scene.bodies) == 1 else f"body[{number}]"
    if "mesh" not in keys:
        return body_of(keys, where, scene.directory)[0].positions
    return placed(keys, mesh_shape(keys, where, scene.directory).positions)
