"""Motion-invariant codes: windows of motions, linear networks, arrays, and training where JAX is installed."""

import numpy as np
import pytest

from transfer.errors import TransferError
from transfer.motion_encoding import MotionEncoding, motion_encoding, motion_windows
from transfer.networks import blended_network, leaky, relu6, shares_of
from transfer.subspace import metric_components

FABRICS, FRAMES = 6, 24
PHASES = np.linspace(0, 2 * np.pi, FRAMES, endpoint=False)
MOTIONS = np.column_stack([np.cos(PHASES), np.sin(PHASES)])


def swings():
    """Drapes (FABRICS * FRAMES, 12) of fabrics that swing the further, the softer they are; and their fabrics."""
    random = np.random.default_rng(2)
    rest, modes, cut = random.standard_normal(12), random.standard_normal((2, 12)), random.standard_normal(12)
    softness = np.linspace(0.5, 1.5, FABRICS)
    drapes = rest + softness[:, None, None] * (MOTIONS @ modes + cut)
    return drapes.reshape(-1, 12), np.repeat(np.arange(FABRICS), FRAMES)


def linear():
    """An encoding of one layer each, with two maps: the code is the latent vector times 1 or 2 by the motion's sign."""
    drapes, _ = swings()
    space = metric_components(drapes, 3)
    eye, none = np.eye(3), np.zeros(3)
    maps = np.zeros((2, 3))
    return MotionEncoding(
        space, 2.0, np.zeros(1), np.ones(1), ((eye, none),), ((eye, none),),
        ((np.array([[40.0, -40.0]]), np.zeros(2)),),
        ((np.array([eye, 2 * eye]), maps),), ((np.array([eye, 0.5 * eye]), maps),),
    )  # fmt: skip


def test_blended_layers_are_means_of_layers():
    weights, biases = np.array([[[2.0]], [[4.0]]]), np.array([[1.0], [3.0]])
    shares = np.array([[1.0, 0.0], [0.25, 0.75]])
    made = blended_network([(weights, biases), (weights, biases)], shares, np.array([[-1.0], [1.0]]), leaky)
    assert made[:, 0] == pytest.approx([2 * (-1 / 4) + 1, 3.5 * 6 + 2.5])
    assert np.array_equal(relu6(np.array([-1.0, 2.0, 9.0])), [0, 2, 6])
    assert np.array_equal(shares_of(np.array([[1.0, 3.0], [0.0, 0.0]])).round(9), [[0.25, 0.75], [0, 0]])


def test_codes_and_drapes_of_linear_networks():
    drapes, _ = swings()
    made, up, down = linear(), np.full((len(drapes), 1), 1.0), np.full((len(drapes), 1), -1.0)
    codes = made.space.coefficients(drapes) / 2
    assert np.allclose(made.codes(drapes, up), codes, atol=1e-9)
    assert np.allclose(made.codes(drapes, down), 2 * codes, atol=1e-9)
    for motion in (up, down):
        assert np.allclose(made.drapes(made.codes(drapes, motion), motion), drapes, atol=1e-9)


def test_it_is_read_as_it_was_written(tmp_path):
    drapes, _ = swings()
    made, motion = linear(), np.ones((len(drapes), 1))
    np.savez(tmp_path / "model.npz", **made.arrays())
    with np.load(tmp_path / "model.npz") as arrays:
        again = motion_encoding(arrays)
    assert np.array_equal(again.codes(drapes, motion), made.codes(drapes, motion))
    with pytest.raises(TransferError):
        motion_encoding({name: each for name, each in made.arrays().items() if name != "into.0.biases"})
    with pytest.raises(TransferError):
        motion_encoding({})


def test_a_window_does_not_change_when_the_whole_motion_is_moved_and_turned():
    random = np.random.default_rng(0)
    joints = random.standard_normal((5, 3, 3))
    roots = np.linalg.qr(random.standard_normal((5, 3, 3)))[0]
    turn = np.linalg.qr(random.standard_normal((3, 3)))[0]
    seen = motion_windows(joints, roots, window=4)
    assert seen.shape == (5, 36)
    assert np.allclose(motion_windows(joints @ turn.T + [1.0, 2.0, 3.0], turn @ roots, window=4), seen, atol=1e-12)
    assert np.allclose(seen[:, -9:-6], 0)  # the root, from itself
    assert not np.allclose(motion_windows(joints[::-1], roots, window=4), seen)
    with pytest.raises(TransferError):
        motion_windows(joints, roots[:4])


def test_a_training_finds_codes_that_motion_does_not_change():
    pytest.importorskip("jax")
    from transfer.motion_encoding import MotionTraining, trained_motion_encoding

    drapes, fabrics = swings()
    motions = np.tile(MOTIONS, (FABRICS, 1))
    given = MotionTraining(
        latent_size=4, hidden=24, code_size=8, motion=(16, 16, 4), steps=1500, code_steps=1500, rate=5e-3
    )
    known = fabrics != 3
    space = metric_components(drapes[known], 3)
    made = trained_motion_encoding(space, drapes[known], motions[known], fabrics[known], given)
    codes = made.codes(drapes, motions).reshape(FABRICS, FRAMES, -1)
    within, between = codes.std(axis=1).mean(), codes.mean(axis=1).std(axis=0).mean()
    assert within < 0.3 * between
    # frames of a fabric that was not trained, from one of them
    wanted = drapes.reshape(FABRICS, FRAMES, -1)[3]
    found = made.drapes(np.tile(codes[3, 5], (FRAMES, 1)), MOTIONS)
    spread = np.sqrt(((drapes - drapes.mean(axis=0)) ** 2).sum(axis=1).mean())
    assert np.sqrt(((found - wanted) ** 2).sum(axis=1).mean()) < 0.2 * spread
    with pytest.raises(TransferError):
        trained_motion_encoding(space, drapes[:3], motions[:3], [0, 1, 1], given)
