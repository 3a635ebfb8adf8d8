"""Recurrent regressor of a garment on a moving body (Santesteban et al. 2021, section 5): its training.

The subspace is the decoder of an auto-encoder that was trained with the collision term on random codes
(`transfer.drape_autoencoder`). A code is predicted from the inputs x of a frame, standardised, and those before it:

    z = shift + x linear + h out,  h the state of a gated recurrent unit over the frames

The linear part is ridge regression to the codes of the training drapes; the unit, which sees the principal components
of the inputs, learns what that leaves. Loss of a step, over the frames of a few clips that are learned, the decoder
held: smooth L1 of the code + |decoder(z) - c|^2. The inputs get noise that is drawn for each clip and step, without
which the unit learns a few clips by heart. Of several numbers of steps the clips for validation choose one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from transfer.drape_autoencoder import DrapeAutoencoder, Training, trained_autoencoder
from transfer.errors import TransferError
from transfer.motion_model import MotionModel, unit_step
from transfer.networks import jax_module, layer_arrays, minimised_each, network
from transfer.subspace import metric_components, ridge
from transfer.triangle_surface import Floats


@dataclass(frozen=True, kw_only=True)
class RegressorTraining:
    """Sizes, weights and steps of a training.

    Attributes
    ----------
    code_size, code_steps : int
        Of the auto-encoder; a code of 24, as in the paper, loses .7 mm of 17 on clips for validation.
    components, state : int
        Principal components of the inputs, and numbers of the gated unit.
    penalty : float
        Of the ridge regression to the codes.
    steps : tuple of int
        Steps of Adam's method, of which validation chooses one.
    batch : int
        Clips of a step.
    rate : float
        Of the first step.
    noise : float
        Standard deviation of what is added to the standardised components of the inputs.
    seed : int
    """

    code_size: int = 48
    code_steps: int = 3000
    components: int = 32
    state: int = 64
    penalty: float = 0.1
    steps: tuple[int, ...] = (100, 300, 900)
    batch: int = 8
    rate: float = 2e-3
    noise: float = 1.0
    seed: int = 0


@dataclass(frozen=True, eq=False)
class LearnedFrames:
    """Frames of a clip.

    Attributes
    ----------
    inputs : (f, p) ndarray
        Of all frames from time 0 on.
    drapes : (f, m) ndarray
        Canonical garments [m].
    first : int
        Frame from which on the garment is learned.
    """

    inputs: Floats
    drapes: Floats
    first: int


def trained_recurrent(
    model: MotionModel,
    clips: Sequence[LearnedFrames],
    error: Callable[[MotionModel], float],
    training: RegressorTraining | None = None,
) -> MotionModel:
    """Train a recurrent model.

    Parameters
    ----------
    model : MotionModel
        Of another kind: what is not of the kind is taken from it.
    clips : sequence of LearnedFrames
    error : callable
        Of a model on the clips for validation.
    training : RegressorTraining, optional

    Raises
    ------
    TransferError
        JAX is not installed, or there are no clips.
    """
    jax_module()
    if not clips:
        raise TransferError("There are no clips to learn from.", "Give at least one.")
    given = training or RegressorTraining()
    subspace = Training(code_size=given.code_size, steps=given.code_steps, regressor_steps=0, seed=given.seed)
    flat, inputs = (np.concatenate([getattr(clip, name)[clip.first :] for clip in clips]) for name in _LEARNED)
    shapes = trained_autoencoder(model.space, flat, inputs, model.grid, subspace)
    linear = ridge(model.standard(inputs), shapes.codes(flat), given.penalty).weights
    space = metric_components(model.standard(inputs), given.components)
    projection = np.asarray(space.basis / np.sqrt(space.variances))
    start = {"shift": linear[0], "linear": linear[1:], "unit": np.array(shapes.unit)}
    start |= layer_arrays("decoder", shapes.decoder)
    units = _trained_units(model, clips, shapes, linear, projection, given)
    made = [replace(model, kind="recurrent", parts=start | unit) for unit in units]
    return min(made, key=error)


_LEARNED = ("drapes", "inputs")


def _trained_units(
    model: MotionModel,
    clips: Sequence[LearnedFrames],
    shapes: DrapeAutoencoder,
    linear: Floats,
    projection: Floats,
    given: RegressorTraining,
) -> list[dict[str, Floats]]:
    """Arrays of the gated unit and its output after each number of steps."""
    longest = max(len(clip.inputs) for clip in clips)
    standard = [_padded(model.standard(clip.inputs), longest) for clip in clips]
    rows = [_padded(clip.drapes, longest) for clip in clips]
    learned = [(np.arange(longest) >= clip.first) & (np.arange(longest) < len(clip.inputs)) for clip in clips]
    single = jax_module().numpy.asarray
    frames = {
        "seen": np.array(standard) @ projection,
        "linear": linear[0] + np.array(standard) @ linear[1:],
        "codes": np.array([shapes.codes(each) for each in rows]),
        "coefficients": np.array([model.space.coefficients(each) for each in rows]) / shapes.unit,
        "learned": np.array(learned),
    }
    loss = _loss({name: single(each, "float32") for name, each in frames.items()}, shapes.decoder, given.noise)
    # before its training the output of the unit is 0: then the model is its linear part
    random, state = np.random.default_rng(given.seed), given.state
    into, again = (random.standard_normal((n, 3 * state)) / np.sqrt(n) for n in (projection.shape[1], state))
    start = {"into": into, "again": again, "bias": np.zeros(3 * state), "out": np.zeros((state, shapes.code_size))}
    first = {name: np.asarray(each, np.float32) for name, each in start.items()}
    found = minimised_each(first, loss, given.steps, given.rate, given.batch, len(clips), given.seed)
    plain = [{name: np.asarray(each, np.float64) for name, each in unit.items()} for unit in found]
    return [unit | {"into": projection @ unit["into"]} for unit in plain]


def _padded(values: ArrayLike, count: int) -> Floats:
    """Rows and, up to a count, the last one again: frames that are not learned."""
    given = np.asarray(values, np.float64)
    return np.concatenate([given, np.repeat(given[-1:], count - len(given), axis=0)])


def _loss(frames: dict[str, Any], decoder: Any, noise: float) -> Callable[..., Any]:
    """Loss of a gated unit for rows of clips and a key."""
    jax = jax_module()
    np_ = jax.numpy
    held = tuple((np_.asarray(weights, "float32"), np_.asarray(biases, "float32")) for weights, biases in decoder)

    def loss(unit: Any, rows: Any, key: Any) -> Any:
        seen = frames["seen"][rows]
        of_clip, of_frame = jax.random.split(key)
        seen += noise * jax.random.normal(of_clip, (len(rows), 1, seen.shape[2]))
        seen += 0.3 * noise * jax.random.normal(of_frame, seen.shape)
        driven = (seen @ unit["into"] + unit["bias"]).swapaxes(0, 1)

        def step(state: Any, row: Any) -> Any:
            following = unit_step(unit["again"], state, row, np_)
            return following, following

        _, states = jax.lax.scan(step, np_.zeros((len(rows), unit["again"].shape[0])), driven)
        codes = frames["linear"][rows] + states.swapaxes(0, 1) @ unit["out"]
        miss = np_.abs(codes - frames["codes"][rows])
        smooth = np_.where(miss < 1, 0.5 * miss**2, miss - 0.5).mean(axis=2)
        off = network(held, codes, np_.tanh) - frames["coefficients"][rows]
        share = frames["learned"][rows]
        return ((smooth + (off**2).sum(axis=2)) * share).sum() / share.sum()

    return loss
