"""Transfer seed on the same mesh, with a moved body, and between meshes."""

import numpy as np
from fitting_cases import capsule_figure, tube_garment, wider

from clothsim.garments.fit.transfer_seed import transferred

FIGURE, GARMENT = capsule_figure(), tube_garment(0.115)


def test_the_same_body_gives_the_garment_back():
    seed = transferred(GARMENT, FIGURE, FIGURE)
    np.testing.assert_allclose(seed.positions, GARMENT.positions, atol=1e-9)
    assert "share their mesh" in seed.description


def test_a_wider_body_widens_the_garment_with_it():
    wide = wider(FIGURE, 1.3)
    seed = transferred(GARMENT, FIGURE, wide)
    assert seed.body is wide.positions
    radius = np.linalg.norm(seed.positions[:, :2], axis=1)
    assert radius.min() > 1.3 * 0.1
    np.testing.assert_allclose(radius, radius.mean(), rtol=0.02)
    np.testing.assert_allclose(np.ptp(seed.positions[:, 2]), 0.3, rtol=0.05)


def test_another_mesh_is_laid_over_first():
    other = capsule_figure(radius=0.12, segments=20, name="other")
    seed = transferred(GARMENT, FIGURE, other)
    assert len(seed.body) == len(FIGURE.positions)
    assert "capsule" in seed.description
    assert "other" in seed.description
    radius = np.linalg.norm(seed.positions[:, :2], axis=1)
    assert 0.115 < radius.mean() < 0.16
