"""Training of the recurrent regressor: what it remembers, what validation chooses, what it needs."""

from dataclasses import replace

import numpy as np
import pytest

from transfer.drape_autoencoder import DistanceGrid
from transfer.errors import TransferError
from transfer.motion_model import MotionModel, motion_model
from transfer.motion_regressor import LearnedFrames, RegressorTraining, trained_recurrent
from transfer.subspace import metric_components, ridge

FRAMES = 16
SMALL = RegressorTraining(
    code_size=2, code_steps=300, components=3, state=12, penalty=1e-3, steps=(100, 400, 100), noise=0.0, rate=5e-3
)


def clip(random):
    """A garment of two vertices that follows the sign of its input slowly, on a curve in space."""
    inputs = np.repeat(random.choice([-1.0, 1.0], size=(FRAMES // 4, 3)), 4, axis=0)
    at, place = np.zeros(FRAMES), 0.0
    for k, row in enumerate(inputs):
        place += 0.25 * (row[0] - place)
        at[k] = place
    curve = np.stack([at, 0.3 * at**2, 0.1 * at, -at, at, np.zeros(FRAMES)], axis=1)
    return LearnedFrames(inputs, curve + 5.0, 2 if random.random() < 0.5 else 0)


@pytest.fixture(scope="module")
def learned():
    pytest.importorskip("jax")
    random = np.random.default_rng(0)
    clips = [clip(random) for _ in range(24)]
    clips[0] = replace(clips[0], inputs=clips[0].inputs[:-5], drapes=clips[0].drapes[:-5])  # clips may differ in length
    flat, inputs = (np.concatenate([getattr(c, name)[c.first :] for c in clips]) for name in ("drapes", "inputs"))
    space = metric_components(flat, 3)
    weights = ridge(inputs, space.coefficients(flat), 1e-3).weights
    linear = MotionModel(
        kind="ridge", family="f", free=(), same=(), same_as=(), rate=25.0, space=space, centre=inputs.mean(axis=0),
        scale=inputs.std(axis=0), low=inputs.min(axis=0), high=inputs.max(axis=0), reference=np.zeros((3, 3)),
        grid=DistanceGrid(np.zeros(3), 1.0, np.full((2, 2, 2), 9.0)),
        parts={"offset": weights[0], "weights": weights[1:]},
    )  # fmt: skip
    others = [clip(random) for _ in range(6)]
    seen = []

    def error(model):
        missed = [model.canonical(c.inputs).reshape(FRAMES, -1) - c.drapes for c in others]
        seen.append(float(np.sqrt(np.mean(np.square(missed)))))
        return seen[-1]

    made = trained_recurrent(linear, clips, error, SMALL)
    return clips, linear, made, error, tuple(seen)


def test_it_remembers_what_a_linear_map_of_a_frame_cannot_know(learned):
    _, linear, made, error, seen = learned
    assert len(seen) == len(SMALL.steps)
    assert error(made) == min(seen)
    assert error(made) < 0.4 * error(linear)


def test_it_is_one_of_the_kinds_that_a_file_has(learned):
    clips, _, made, *_ = learned
    assert made.kind == "recurrent"
    again = motion_model(made.arrays())
    assert np.array_equal(again.canonical(clips[1].inputs), made.canonical(clips[1].inputs))


def test_the_same_seed_and_steps_give_the_same_model(learned):
    *_, seen = learned
    assert seen[0] == seen[2] != seen[1]


def test_clips_are_needed(learned):
    with pytest.raises(TransferError, match="no clips"):
        trained_recurrent(learned[1], [], lambda _: 0.0)
