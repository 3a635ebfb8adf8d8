"""Learned models of drapes at rest: positions of a garment as a function of the varied keys of its scene.

A model is affine in the standardised inputs, which are clipped to the box of its training drapes: principal components
of the drapes, and a ridge regression to their coefficients, folded into one matrix. `clothsim learn` makes it.
"""

import hashlib
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.file_writing import replacing
from clothsim.scene import paths
from clothsim.scene.content import by_content
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

    def write(self, path: Path) -> Path:
        """Write the model as .npz, for `read_model`."""
        arrays: dict[str, Any] = {name: np.asarray(value) for name, value in asdict(self).items()}
        with replacing(path) as beside, beside.open("wb") as target:
            np.savez_compressed(target, **arrays)
        return path


def predicted(model: DrapeModel, scene: Scene) -> Floats:
    """The positions (n, 3) that a model predicts for a scene [m].

    Raises
    ------
    InputError
        For another garment or body family than the model's, or without one of its inputs.
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


def read_model(path: Path) -> DrapeModel:
    """The model in a file of `DrapeModel.write`. InputError for another file."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            content = {name: arrays[name] for name in DrapeModel.__dataclass_fields__}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        raise InputError(f"{path} is no model of drapes.", "Make one: `clothsim learn DIR -o model.npz`.") from error
    return DrapeModel(**{**content, "family": str(content["family"])})


def _number(key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"The model needs {key}, which the scene has not as a number.", f"Write {key} in the scene.")
    return float(value)
