"""Models of drapes learned from a farm: principal components in the metric of areas, and ridge regression."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import diags_array

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.triangles import thirds_at_vertices, triangle_areas
from clothsim.engine import DrapeModel
from clothsim.study.farm.plan import Farm
from clothsim.study.farm.reading import positions_of, read_stored_mesh
from clothsim.study.farm.status import manifest
from clothsim.study.farm.verification import demand_verified
from transfer.subspace import metric_components, nearest, ridge

LEAST = 8
"""Least number of training drapes."""


@dataclass(frozen=True)
class Learned:
    """A model and its errors.

    Attributes
    ----------
    model : DrapeModel
    training, held_out, left_out : int
        Drapes; left out: usable, with another mesh than most.
    error, mean_error, nearest_error : float
        Root mean square distance of a vertex of held-out drapes to the prediction, to the mean of the training
        drapes, and to the nearest training drape [m]; nan without held-out drapes.
    """

    model: DrapeModel
    training: int
    held_out: int
    left_out: int
    error: float
    mean_error: float
    nearest_error: float


def learn(farm: Farm, held_out: float = 0.25, components: int = 16, penalty: float = 1e-3) -> Learned:
    """Learn the drapes of a farm as a function of its varied numbers.

    Parameters
    ----------
    farm : Farm
        Its usable drapes are taken in the order of the plan; the last ones are held out.
    held_out : float
        Fraction that is held out, from 0 to .9.
    components : int
        Number of principal components.
    penalty : float
        Of the ridge regression, on standardised inputs.

    Raises
    ------
    InputError
        For a farm of animated runs, without varied numbers, with too few drapes, or that is not what was verified.
    """
    if not 0 <= held_out <= 0.9:
        raise InputError(f"The fraction held out is {held_out:g}.", "Give a number from 0 to 0.9, such as 0.25.")
    if components < 1:
        raise InputError(f"{components} components were asked for.", "Give a whole number from 1.")
    settings = farm.settings
    inputs = list(settings["boxes"])
    others = [key for key in settings["varied"] if key not in inputs and key not in settings["same"]]
    if others or not inputs:
        raise InputError(
            f"A model takes numbers: {', '.join(others) or 'nothing'} varies.", "Make a farm that varies numbers alone."
        )
    if settings["frames"] != "last":
        raise InputError("The farm stores all frames.", 'A model is of drapes at rest: frames = "last".')
    demand_verified(farm)
    rows, areas, left_out = drapes_on_one_mesh(farm)
    training = len(rows) - round(held_out * len(rows))
    if training < LEAST:
        raise InputError(f"{training} drapes are too few to learn from.", f"Make at least {LEAST} usable drapes.")
    drapes = np.array([positions_of(farm.directory, row["id"]) for row in rows], np.float64)
    flat = drapes.reshape(len(rows), -1)
    values = np.array([[float(row["parameters"][key]) for key in inputs] for row in rows])
    space = metric_components(flat[:training], components, diags_array(np.repeat(areas, 3)))
    fitted = ridge(values[:training], space.coefficients(flat[:training]), penalty)
    same = farm.settings["same"]
    model = DrapeModel.of_scene(
        farm.scene, inputs, same, low=fitted.low, high=fitted.high, centre=fitted.centre, scale=fitted.scale,
        weights=fitted.weights, mean=space.mean, basis=space.basis,
    )  # fmt: skip
    held, asked = flat[training:], values[training:]
    closest = nearest(values[:training], flat[:training], asked) if len(held) else held
    return Learned(
        model, training, len(held), left_out,
        rms([model.positions(each).ravel() for each in asked], held), rms(space.mean, held), rms(closest, held),
    )  # fmt: skip


def drapes_on_one_mesh(farm: Farm) -> tuple[list[dict[str, Any]], Floats, int]:
    """Usable drapes with the mesh that most have, the areas of its vertices, and the number of others."""
    usable = [row for row in manifest(farm) if row["usable"]]
    if not usable:
        raise InputError("No drape of the farm is usable.", "`clothsim farm status DIR` names the causes.")
    meshes = []
    for row in usable:  # triangles of all its cloths one after the other, and the areas of their vertices at rest [m^2]
        triangles, areas_of, first = [], [], 0
        for digest in row["meshes"]["cloth"].values():
            arrays = read_stored_mesh(farm.directory, digest)
            faces, rest = arrays["triangles"], arrays["start"].astype(np.float64)
            areas_of.append(thirds_at_vertices(triangle_areas(rest[faces]), faces, len(rest)))
            triangles.append(faces + first)
            first += len(rest)
        meshes.append((np.concatenate(triangles), np.concatenate(areas_of)))
    keys = [each[0].tobytes() for each in meshes]
    most = Counter(keys).most_common(1)[0][0]
    chosen = [k for k, key in enumerate(keys) if key == most]
    areas = np.mean([meshes[k][1] for k in chosen], axis=0)
    return [usable[k] for k in chosen], areas, len(usable) - len(chosen)


def rms(predictions: Sequence[Floats] | Floats, drapes: Floats) -> float:
    """Root mean square distance of a vertex."""
    if not len(drapes):
        return float("nan")
    return float(np.sqrt(3 * np.mean((np.asarray(predictions) - drapes) ** 2)))
