"""Models of a garment in motion: kinds, one form of arrays, what is refused, the gated unit."""

import numpy as np
import pytest

from transfer.drape_autoencoder import DistanceGrid
from transfer.errors import TransferError
from transfer.motion_model import KINDS, MotionModel, gated_unit, motion_model
from transfer.networks import layer_arrays
from transfer.subspace import metric_components

RANDOM = np.random.default_rng(0)
COUNT, COMPONENTS, STATE, CODE = 4, 3, 5, 2


def parts_of(kind):
    layers = [(RANDOM.normal(size=(CODE, 6)), np.zeros(6)), (RANDOM.normal(size=(6, COMPONENTS)), np.zeros(3))]
    unit = {
        "into": RANDOM.normal(size=(COUNT, 3 * STATE)),
        "again": RANDOM.normal(size=(STATE, 3 * STATE)),
        "bias": np.zeros(3 * STATE),
        "out": RANDOM.normal(size=(STATE, CODE)),
        "shift": np.zeros(CODE),
        "linear": RANDOM.normal(size=(COUNT, CODE)),
        "unit": np.array(0.1),
    }
    return {
        "skinned": {"components": np.array(COMPONENTS)},
        "nearest": {
            "projection": np.eye(COUNT)[:, :2],
            "inputs": RANDOM.normal(size=(7, 2)),
            "coefficients": RANDOM.normal(size=(7, COMPONENTS)),
        },
        "ridge": {"offset": np.ones(COMPONENTS), "weights": RANDOM.normal(size=(COUNT, COMPONENTS))},
        "recurrent": unit | layer_arrays("decoder", layers),
    }[kind]


def model(kind):
    space = metric_components(RANDOM.normal(size=(9, 12)) + 5.0, COMPONENTS)
    grid = DistanceGrid(np.zeros(3), 1.0, np.full((2, 2, 2), 9.0))
    box = {"low": np.full(COUNT, -2.0), "high": np.full(COUNT, 2.0)}
    return MotionModel(
        kind=kind, family="f", free=("cloth.fabric",), same=("a",), same_as=("b",), rate=25.0, space=space,
        centre=np.zeros(COUNT), scale=np.ones(COUNT), **box, reference=np.zeros((6, 3)), grid=grid,
        parts=parts_of(kind),
    )  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_one_form_of_arrays(kind, tmp_path):
    made, inputs = model(kind), RANDOM.normal(size=(6, COUNT))
    np.savez(tmp_path / "model.npz", **made.arrays())
    with np.load(tmp_path / "model.npz", allow_pickle=False) as arrays:
        again = motion_model(dict(arrays))
    assert (again.kind, again.free, again.same, again.same_as, again.rate) == (
        kind,
        ("cloth.fabric",),
        ("a",),
        ("b",),
        25,
    )
    assert made.canonical(inputs).shape == (6, 4, 3)
    assert np.array_equal(again.canonical(inputs), made.canonical(inputs))
    assert np.array_equal(made.canonical(inputs + 9.0), made.canonical(inputs + 99.0))  # clipped to the box


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("kind", np.array("deep")),
        ("scale", np.zeros(COUNT)),
        ("low", np.zeros(3)),
        ("part.weights", np.zeros((2, 3))),
        ("part.offset", np.full(3, np.nan)),
        ("grid.values", np.zeros(3)),
        ("rate", np.array(0.0)),
        ("reference", None),
    ],
)
def test_arrays_that_do_not_fit_are_refused(name, array):
    arrays = model("ridge").arrays() | {name: array}
    if array is None:
        del arrays[name]
    with pytest.raises(TransferError):
        motion_model(arrays)


def test_inputs_of_another_skeleton_are_refused():
    with pytest.raises(TransferError, match="skeleton"):
        model("ridge").canonical(np.zeros((2, COUNT + 1)))


def test_the_gated_unit_is_its_formula():
    parts, inputs = parts_of("recurrent"), RANDOM.normal(size=(3, COUNT))
    state = np.zeros(STATE)
    for row, found in zip(inputs, gated_unit(parts, inputs), strict=True):
        driven = row @ parts["into"]
        update, reset = 1 / (1 + np.exp(-(driven[: 2 * STATE] + state @ parts["again"][:, : 2 * STATE]))).reshape(2, -1)
        fresh = np.tanh(driven[2 * STATE :] + (reset * state) @ parts["again"][:, 2 * STATE :])
        state = update * state + (1 - update) * fresh
        np.testing.assert_allclose(found, state, atol=1e-12)
