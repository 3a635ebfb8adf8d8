"""Models of a garment on moving bodies, learned from a farm of clips and tested on motions and bodies it has not seen.

The clips of a farm are divided by what they show, never by frames:

* held out are all clips of one kind of motion, and all clips on some bodies;
* of the rest some motions are for validation: they choose the penalty of ridge regression and the best model;
* the others are for training. A clip with a motion of the training on a held-out body is left out: its motion is known.

Every model is learned on the same frames in the same subspace; the errors are distances in the scene, of a vertex.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import diags_array

from clothsim.base.arrays import Floats, write_arrays
from clothsim.base.errors import InputError
from clothsim.base.inputs import refuse_unknown
from clothsim.engine import MovingGarment
from clothsim.study.farm.plan import Farm
from clothsim.study.farm.reading import positions_of
from clothsim.study.farm.verification import demand_verified
from clothsim.study.learned_drapes import drapes_on_one_mesh
from transfer.drape_autoencoder import distance_grid
from transfer.errors import TransferError
from transfer.motion_model import MotionModel
from transfer.motion_regressor import LearnedFrames, RegressorTraining, trained_recurrent
from transfer.signed_distance import body_surface
from transfer.subspace import Subspace, metric_components, ridge

LEAST = 3
"""Least number of training clips."""
SETTLED = 0.25
"""Time from which on frames are learned [s]: before it the garment falls from where it was placed onto the body."""
PENALTIES = (1e-3, 1e-2, 1e-1, 1.0)
"""Penalties of ridge regression, of which validation chooses one."""
NEAREST_COMPONENTS = 12
"""Principal components of the inputs in which the nearest frame is sought."""
SPACING = 0.0125
"""Of the grid of distances that keeps predictions out of the body [m]."""
EVERY = 8
"""Of so many frames one is tested for vertices inside the body."""
SETS = ("validation", "new motion", "new body")
"""Sets of clips on which errors are reported."""


@dataclass(frozen=True, eq=False)
class MovingClip:
    """A clip of a farm: a garment on a body in a motion.

    Attributes
    ----------
    id : str
        Of the farm.
    body, motion, kind : str
        Ids of the body's shape and of the motion, and the kind of the motion: "squat" of "squat:3".
    garment : MovingGarment
    times : (f,) ndarray [s]
    positions : (f, k, 3) ndarray
        Of all cloths [m].
    canonical : (f, 3k) ndarray [m]
    inputs : (f, p) ndarray
    """

    id: str
    body: str
    motion: str
    kind: str
    garment: MovingGarment
    times: Floats
    positions: Floats
    canonical: Floats
    inputs: Floats

    @property
    def settled(self) -> Any:
        """The frames that are learned and checked, a slice."""
        return slice(int(np.searchsorted(self.times, SETTLED - 1e-9)), None)

    @property
    def velocities(self) -> Floats:
        """Of the cloths, by central differences, (f, k, 3) [m/s]."""
        return np.asarray(np.gradient(self.positions, self.times, axis=0), np.float64)


@dataclass(frozen=True)
class ClipSplit:
    """Sets of clips by their rows: what is held out has no motion of the others and, of a new body, no body of theirs.

    Attributes
    ----------
    training, validation, new_motion, new_body, left_out : tuple of int
    kind : str
        Of motion that is held out.
    bodies : tuple of str
        That are held out.
    """

    training: tuple[int, ...]
    validation: tuple[int, ...]
    new_motion: tuple[int, ...]
    new_body: tuple[int, ...]
    left_out: tuple[int, ...]
    kind: str
    bodies: tuple[str, ...]

    def rows(self, name: str) -> tuple[int, ...]:
        """The rows of one of SETS."""
        found: tuple[int, ...] = getattr(self, name.replace(" ", "_"))
        return found


def division(
    labels: Sequence[tuple[str, str, str]], kind: str | None = None, bodies: int = 2, seed: int = 0
) -> ClipSplit:
    """Divide clips by their labels.

    Parameters
    ----------
    labels : sequence of (body, motion, kind)
        Ids of each clip.
    kind : str, optional
        Of motion that is held out; None: one that is drawn.
    bodies : int
        Number of bodies that are held out.
    seed : int
        Of what is drawn.

    Raises
    ------
    InputError
        For an unknown kind, or where too few clips are left to learn from.

    Examples
    --------
    >>> made = division([(f"b{k % 3}", f"{kind}:{k}", kind) for k in range(9) for kind in ("squat", "jump")], "jump", 1)
    >>> len(made.new_motion), len(made.new_body), len(made.validation), len(made.training)
    (9, 3, 1, 5)
    """
    random = np.random.default_rng(seed)
    kinds, shapes = sorted({label[2] for label in labels}), sorted({label[0] for label in labels})
    if kind is not None and kind not in kinds:
        raise InputError(f"No clip has a motion of the kind {kind!r}.", f"They have {', '.join(kinds)}.")
    held_kind = kind or str(random.choice(kinds))
    held = tuple(sorted(random.permutation(shapes)[: min(bodies, len(shapes) - 1)].tolist()))
    motions = sorted({motion for body, motion, own in labels if own != held_kind and body not in held})
    drawn = random.permutation(motions).tolist()
    count = max(1, round(0.2 * len(drawn)))
    checked, known = set(drawn[:count]), set(drawn[count:])
    rows: dict[str, list[int]] = {name: [] for name in ("training", "validation", "new_motion", "new_body", "left_out")}
    for k, (body, motion, own) in enumerate(labels):
        if own == held_kind:
            name = "new_motion"
        elif body in held:
            name = "left_out" if motion in known | checked else "new_body"
        else:
            name = "validation" if motion in checked else "training"
        rows[name].append(k)
    if len(rows["training"]) < LEAST:
        raise InputError(
            f"{len(rows['training'])} of {len(labels)} clips are left to learn from: the kind {held_kind} and "
            f"{len(held)} bodies are held out.",
            "Make more clips, of more kinds and bodies, or hold out fewer: --held-bodies 1.",
        )
    return ClipSplit(**{name: tuple(found) for name, found in rows.items()}, kind=held_kind, bodies=held)


def clips_of(farm: Farm) -> list[MovingClip]:
    """The usable clips of a farm with the mesh that most have, beside the rest pose of its base scene's body.

    Raises
    ------
    InputError
        For a farm of drapes at rest, of scenes without a moving body model, or that is not what was verified.
    """
    if farm.settings["frames"] != "all":
        raise InputError(
            "The farm stores the last frame of each drape, and no motion.",
            'Write frames = "all" and until = "time" in its recipe, or learn drapes: without --motion.',
        )
    models = [body for body in farm.scene.bodies if "model" in body]
    if len(models) != 1 or not models[0].get("motion"):
        raise InputError(
            "The farm's scene has no body model that moves.",
            'Write [body] model = "mannequin" and motion = "walk", or vary "body.motion.clip".',
        )
    demand_verified(farm)
    rows, _, _ = drapes_on_one_mesh(farm)
    jobs = {job.id: job for job in farm.jobs}
    reference = MovingGarment.of_scene(farm.scene).reference
    clips = []
    for name in (row["id"] for row in rows):
        scene = farm.scene_of(jobs[name])
        positions = positions_of(farm.directory, name).astype(np.float64)
        rate, end = scene.run_settings.frames_per_second, scene.run_settings.duration
        times = np.minimum(np.arange(len(positions)) / rate, end)
        garment = MovingGarment.of_scene(scene)
        frames = zip(times, positions, strict=True)
        shapes = np.array([garment.unposed(points, float(time), reference).ravel() for time, points in frames])
        keys = next(body for body in scene.bodies if "model" in body)
        motion = keys["motion"]
        clip = motion if isinstance(motion, str) else str(motion["clip"])
        body = json.dumps({key: keys.get(key) for key in ("model", "shape")}, sort_keys=True, default=str)
        kind = clip.partition(":")[0]
        clips.append(MovingClip(name, body, clip, kind, garment, times, positions, shapes, garment.inputs(times)))
    return clips


@dataclass(frozen=True, eq=False)
class LearnedMotion:
    """Models of one garment in motion, and their errors.

    Attributes
    ----------
    models : dict of str to MotionModel
        By kind.
    best : str
        The kind with the least error in validation.
    division : ClipSplit
    errors : dict of str to dict of str to float
        Root mean square distance of a vertex by the kind of model and the set [m]; nan where the set is empty.
    inside : dict of str to dict of str to float
        Fraction of the vertices that are inside the body.
    """

    models: Mapping[str, MotionModel]
    best: str
    division: ClipSplit
    errors: Mapping[str, Mapping[str, float]]
    inside: Mapping[str, Mapping[str, float]]

    def write(self, path: Path, kind: str | None = None, overwrite: bool = False) -> Path:
        """Write the best model, or that of a kind, as .npz. InputError for another kind, or where there is a file."""
        if kind is not None:
            refuse_unknown("The kind of model", [kind], self.models)
        return write_arrays(path, self.models[kind or self.best].arrays(), overwrite)


def learn_motion(
    farm: Farm,
    kind: str | None = None,
    bodies: int = 2,
    components: int = 48,
    seed: int = 0,
    recurrent: RegressorTraining | None = None,
    clips: Sequence[MovingClip] | None = None,
) -> LearnedMotion:
    """Learn models of the garment of a farm of clips.

    Parameters
    ----------
    farm : Farm
        With all frames of scenes with one moving body model.
    kind, bodies, seed
        What is held out (`division`).
    components : int
        Dimension of the subspace.
    recurrent : RegressorTraining, optional
        Training of a recurrent model too, of which `penalty` is that of the ridge regression.
    clips : sequence of MovingClip, optional
        Those of `clips_of`, where they are known.

    Raises
    ------
    InputError
        For a farm that has no such clips, or too few; for a recurrent model without JAX.
    """
    if components < 1:
        raise InputError(f"{components} components were asked for.", "Give a whole number from 1.")
    found = clips_of(farm) if clips is None else clips
    sets = division([(clip.body, clip.motion, clip.kind) for clip in found], kind, bodies, seed)
    training = [found[k] for k in sets.training]
    _, areas, _ = drapes_on_one_mesh(farm)
    flat, inputs = (
        np.concatenate([getattr(clip, name)[clip.settled] for clip in training]) for name in ("canonical", "inputs")
    )
    space = metric_components(flat, components, diags_array(np.repeat(areas, 3)))
    skinned = _model_of(farm, found[0], space, inputs, flat)
    validation = [found[k] for k in sets.validation]
    given = skinned.standard(inputs)
    projection = metric_components(given, NEAREST_COMPONENTS).basis
    parts = {"projection": projection, "inputs": given @ projection, "coefficients": skinned.space.coefficients(flat)}
    models = {"skinned": skinned, "nearest": replace(skinned, kind="nearest", parts=parts)}
    fitted = {}
    for penalty in PENALTIES:
        weights = ridge(given, skinned.space.coefficients(flat), penalty).weights
        fitted[penalty] = replace(skinned, kind="ridge", parts={"offset": weights[0], "weights": weights[1:]})
    penalty = min(PENALTIES, key=lambda penalty: error_of(fitted[penalty], validation))
    models["ridge"] = fitted[penalty]
    if recurrent is not None:
        frames = [LearnedFrames(clip.inputs, clip.canonical, clip.settled.start) for clip in training]
        asked = replace(recurrent, penalty=penalty)
        try:
            models["recurrent"] = trained_recurrent(skinned, frames, lambda made: error_of(made, validation), asked)
        except TransferError as error:
            raise InputError(error.sentence, error.remedy) from error
    measured = {part: _measured(models, [found[k] for k in sets.rows(part)]) for part in SETS}
    errors, inside = ({name: {part: measured[part][name][k] for part in SETS} for name in models} for k in (0, 1))
    best = min(models, key=lambda name: errors[name]["validation"])
    return LearnedMotion(models, best, sets, errors, inside)


def _model_of(farm: Farm, clip: MovingClip, space: Subspace, inputs: Floats, flat: Floats) -> MotionModel:
    """The model of the mean garment."""
    same = farm.settings["same"]
    moved = ("motion", "shape", "pose")
    free = [key for key in farm.settings["varied"] if key not in same and not any(f".{k}" in key for k in moved)]
    scale, base = inputs.std(axis=0), MovingGarment.of_scene(farm.scene)
    body = body_surface(base.reference, base.made.character.triangles)
    return MotionModel(
        kind="skinned",
        family=clip.garment.family([*free, *same]),
        free=tuple(free),
        same=tuple(same),
        same_as=tuple(same.values()),
        rate=float(farm.scene.run_settings.frames_per_second),
        space=space,
        centre=inputs.mean(axis=0),
        scale=np.where(scale > 1e-9, scale, 1.0),
        low=inputs.min(axis=0),
        high=inputs.max(axis=0),
        reference=base.reference,
        grid=distance_grid(body, flat.reshape(-1, 3), SPACING),
        parts={"components": np.array(space.basis.shape[1])},
    )


def predictions(model: MotionModel, clip: MovingClip) -> Floats:
    """The garment of each frame of a clip as a model predicts it, (f, k, 3) [m]."""
    try:
        canonical = model.canonical(clip.inputs)
    except TransferError as error:
        raise InputError(error.sentence, error.remedy) from error
    pairs = zip(canonical, clip.times, strict=True)
    return np.array([clip.garment.posed(shape, float(time), model.reference) for shape, time in pairs])


def error_of(model: MotionModel, clips: Sequence[MovingClip]) -> float:
    """Root mean square distance of a vertex of settled frames [m]; nan without clips."""
    missed = [_squares(predictions(model, clip), clip) for clip in clips]
    return float(np.sqrt(np.concatenate(missed).mean())) if missed else float("nan")


def _squares(found: Floats, clip: MovingClip) -> Floats:
    """Mean square distance of a vertex in each settled frame [m2]."""
    return np.asarray(((found - clip.positions)[clip.settled] ** 2).sum(axis=2).mean(axis=1), np.float64)


def _measured(models: Mapping[str, MotionModel], clips: Sequence[MovingClip]) -> dict[str, tuple[float, float]]:
    """Error as of `error_of`, and fraction of the vertices inside the body in some frames, by the kind of model."""
    missed: dict[str, list[Floats]] = {name: [] for name in models}
    inside: dict[str, list[float]] = {name: [] for name in models}
    for clip in clips:
        found = {name: predictions(model, clip) for name, model in models.items()}
        for name, points in found.items():
            missed[name].append(_squares(points, clip))
        for k in range(len(clip.times))[clip.settled][::EVERY]:
            made = clip.garment.made
            body = body_surface(made.vertices(float(clip.times[k])), made.character.triangles)
            for name, points in found.items():
                inside[name].append(float(body.closest(points[k]).inside.mean()))
    if not clips:
        return dict.fromkeys(models, (float("nan"), float("nan")))
    return {
        name: (float(np.sqrt(np.concatenate(missed[name]).mean())), float(np.mean(inside[name]))) for name in models
    }
