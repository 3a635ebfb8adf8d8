"""Losses against central differences, and known values."""

import numpy as np
import pytest
from differences import _relative

from clothsim.base.errors import InputError
from clothsim.gradients.losses import Custom, Distance, Girth, Height, Scan, Silhouette, as_loss


def surface():
    rng = np.random.default_rng(0)
    i, j = np.meshgrid(np.arange(6.0), np.arange(6.0), indexing="ij")
    points = np.stack([i, j, 0.3 * np.sin(1.3 * i) + 0.2 * j], axis=2).reshape(-1, 3)
    first = (6 * np.arange(5)[:, None] + np.arange(5)).ravel()[:, None]
    triangles = np.concatenate([first + np.array(corners) for corners in ((0, 6, 7), (0, 7, 1))])
    return points + 0.1 * rng.standard_normal(points.shape), triangles


X, TRIANGLES = surface()
LOSSES = [
    Distance(X + 0.1),
    Scan(X[:10] + np.array([0.3, 0.2, 0.5])),
    Scan(X[:10] + np.array([0.3, 0.2, 0.5]), normals=np.tile([0.0, 0.1, 1.0], (10, 1))),
    Height((1, 4)),
    Height(),
    Girth(0.4),
    Silhouette(),
    Silhouette((0.6, 0.0, 0.8)),
    Custom(lambda x: (float((x**4).sum()), 4 * x**3)),
]


@pytest.mark.parametrize("loss", LOSSES, ids=lambda loss: type(loss).__name__)
def test_derivatives(loss):
    derivative = loss.evaluate(X, TRIANGLES)[1]
    directions = np.random.default_rng(1).standard_normal((4, *X.shape))
    numeric = [
        (loss.evaluate(X + 1e-6 * d, TRIANGLES)[0] - loss.evaluate(X - 1e-6 * d, TRIANGLES)[0]) / 2e-6
        for d in directions
    ]
    assert _relative("loss", np.array([np.vdot(derivative, d) for d in directions]), np.array(numeric)) < 1e-7


def test_values():
    square = np.array([[0.0, 0, 0], [2, 0, 0], [2, 3, 1], [0, 3, 1]])
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    assert Silhouette().evaluate(square, halves)[0] == pytest.approx(6.0)
    assert Girth(0.25).evaluate(square, halves)[0] == pytest.approx(2.0)
    assert Height().evaluate(square, halves)[0] == pytest.approx(0.5)
    assert Distance(square + np.array([0, 0, 2.0])).evaluate(square, halves)[0] == pytest.approx(4.0)
    above = square[:1] + np.array([1.0, 0.5, 0.5 / 3 + 1.0])
    assert Scan(above).evaluate(square, halves)[0] == pytest.approx(0.9)  # 1 m over a slope of 1 in 3


def test_what_is_no_loss():
    for loss in (Distance(X[:3]), Height((99,)), Girth(50.0), Custom(lambda x: 1.0), Custom(lambda x: (1.0, x[:2]))):
        with pytest.raises(InputError):
            loss.evaluate(X, TRIANGLES)
    with pytest.raises(InputError):
        as_loss(3.0)


def test_points_of_another_layer_do_not_count():
    square = np.array([[0.0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0]])
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    points, normals = np.array([[0.5, 1, 0.1], [1.5, 1, 0.3]]), np.array([[0, 0.1, 2.0], [0, 0, -1.0]])
    assert Scan(points).evaluate(square, halves)[0] == pytest.approx(0.05)
    value, derivative = Scan(points, normals=normals).evaluate(square, halves)
    assert value == pytest.approx(0.01)
    assert derivative.sum(axis=0) == pytest.approx([0, 0, -0.2])
    for wrong in (-normals[:1].repeat(2, axis=0), normals[:1]):
        with pytest.raises(InputError):
            Scan(points, normals=wrong).evaluate(square, halves)
