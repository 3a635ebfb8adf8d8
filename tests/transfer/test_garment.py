"""Garment transfer: exact for global motion of the body, close for local deformation."""

import numpy as np
import pytest
from capsule_bodies import person
from real_data import DATA, needs_data

from clothsim.mesh.generators.table import GENERATORS
from transfer.errors import TransferError
from transfer.garment import garment_transfer, pairs_with_body, transfer_garment
from transfer.signed_distance import body_surface
from transfer.triangle_surface import largest_component, vertex_components, vertex_normals

FOLDER = DATA / "dress_on_body"

BODY, TRIANGLES = person(0.04)
TURN = np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]])


def shirt(gap=0.02):
    """The trunk and upper arms of the body, moved outward by `gap` [m]: positions, triangles."""
    middle = BODY[TRIANGLES].mean(axis=1)
    chosen = TRIANGLES[(middle[:, 1] > 0.9) & (middle[:, 1] < 1.38) & (np.abs(middle[:, 0]) < 0.35)]
    labels = vertex_components(chosen, len(BODY))
    chosen = chosen[labels[chosen[:, 0]] == largest_component(chosen, labels)]
    used, triangles = np.unique(chosen, return_inverse=True)
    return (BODY + gap * vertex_normals(BODY, TRIANGLES))[used], triangles.reshape(-1, 3)


SHIRT, SHIRT_TRIANGLES = shirt()


def stouter(points):
    """Everything wider by the height: a smooth change of shape."""
    width = 1 + 0.25 * np.exp(-((points[:, 1] - 1.0) ** 2) / 0.1)
    return points * np.column_stack([width, np.ones(len(points)), width])


@pytest.mark.parametrize("scale", [1.0, 0.4, 3.0])
def test_a_similarity_of_the_body_is_that_of_the_garment(scale):
    moved = transfer_garment(SHIRT, SHIRT_TRIANGLES, BODY, scale * BODY @ TURN.T + [1, 2, 3], TRIANGLES)
    assert np.abs(moved - (scale * SHIRT @ TURN.T + [1, 2, 3])).max() < 1e-9 * scale * 1.7


def test_the_same_body_leaves_the_garment():
    assert np.abs(transfer_garment(SHIRT, SHIRT_TRIANGLES, BODY, BODY, TRIANGLES) - SHIRT).max() < 1e-9


@pytest.mark.parametrize("winding", [1, -1])
def test_on_another_shape_it_sits_as_it_sat(winding):
    """Also when the garment is wound the other way."""
    triangles = SHIRT_TRIANGLES[:, ::winding]
    other = stouter(BODY)
    moved = transfer_garment(SHIRT, triangles, BODY, other, TRIANGLES)
    assert np.abs(moved - SHIRT).max() > 0.03
    gap = body_surface(other, TRIANGLES).closest(moved).signed_distance
    was = body_surface(BODY, TRIANGLES).closest(SHIRT).signed_distance
    assert np.abs(gap - was).mean() < 3e-3
    assert (gap < 0).sum() <= (was < 0).sum() + 0.01 * len(SHIRT)
    np.testing.assert_allclose(moved, stouter(SHIRT), atol=0.01)


def test_each_panel_finds_its_own_place():
    left = SHIRT_TRIANGLES[(SHIRT[SHIRT_TRIANGLES] < 0)[:, :, 0].all(axis=1)]
    right = SHIRT_TRIANGLES[(SHIRT[SHIRT_TRIANGLES] >= 0)[:, :, 0].all(axis=1)]
    panels = np.vstack([left, right])
    moved = transfer_garment(SHIRT, panels, BODY, stouter(BODY), TRIANGLES)
    np.testing.assert_allclose(moved, stouter(SHIRT), atol=0.02)


def test_a_garment_triangle_follows_triangles_that_face_its_way_with_weights_of_sum_one():
    pairs, weights = pairs_with_body((SHIRT, SHIRT_TRIANGLES), (BODY, TRIANGLES))
    np.testing.assert_allclose(np.bincount(pairs[:, 1], weights), 1, atol=1e-12)
    assert (weights > 0).all()
    assert len(np.unique(pairs[:, 1])) == len(SHIRT_TRIANGLES)


def test_cloth_by_the_trunk_does_not_go_with_the_arm_beside_it():
    """Two plates face one another with a cloth between them, nearer to the far plate, wound with the near one."""
    flat, faces = GENERATORS["rectangle"](size=(1.0, 1.0), cells=(10, 10))
    plates = np.vstack([flat, flat + np.array([0, 0, 0.1])])
    both = np.vstack([faces, faces[:, ::-1] + len(flat)])
    patch = GENERATORS["rectangle"](size=(0.6, 0.6), cells=(6, 6))
    cloth = (
        np.vstack([patch[0] + [0, 0, 0.02], patch[0] * 0.1 + [0, 0, 0.06]]),
        np.vstack([patch[1], patch[1] + len(patch[0])]),
    )
    apart = plates + np.where(np.arange(len(plates)) < len(flat), 0.0, 1.0)[:, None] * [0, 0, 1.0]
    moved = transfer_garment(*cloth, plates, apart, both)
    near = slice(0, len(patch[0]))
    np.testing.assert_allclose(moved[near], cloth[0][near], atol=1e-9)


def test_flat_triangles_of_the_body_are_passed_over_and_those_of_the_garment_named():
    flat = np.vstack([[[0, 1, 1]], TRIANGLES])
    moved = transfer_garment(SHIRT, SHIRT_TRIANGLES, BODY, stouter(BODY), flat)
    np.testing.assert_allclose(moved, transfer_garment(SHIRT, SHIRT_TRIANGLES, BODY, stouter(BODY), TRIANGLES))
    with pytest.raises(TransferError, match=r"triangle 0\b.*target"):
        transfer_garment(SHIRT, np.vstack([[[0, 1, 1]], SHIRT_TRIANGLES]), BODY, BODY, TRIANGLES)
    with pytest.raises(TransferError, match="triangle"):
        transfer_garment(SHIRT, SHIRT_TRIANGLES, BODY, BODY, flat[:1])


def test_one_transfer_serves_many_bodies():
    follower = garment_transfer(SHIRT, SHIRT_TRIANGLES, BODY, TRIANGLES)
    for other in (stouter(BODY), BODY @ TURN.T):
        once = transfer_garment(SHIRT, SHIRT_TRIANGLES, BODY, other, TRIANGLES)
        np.testing.assert_array_equal(follower.pose(BODY, TRIANGLES, other), once)


@needs_data
def test_a_real_dress_goes_along_with_a_kick_and_almost_stays_outside():
    """Transfer alone left 3 % and 6 mm in the literature's form; anchors and means leave .2 % and 1 mm."""
    from clothsim.files.meshes.mesh_file import read_mesh

    dress = read_mesh(FOLDER / "dress_knife_drape.obj", vertices=(0, 15656))
    before, after = (read_mesh(FOLDER / "kick" / f"shell{frame:03d}.obj") for frame in (0, 10))
    worn = dress.positions + np.array([0, 0.75, 0])  # the frames stand that much higher than the draped body
    assert np.abs(after.positions - before.positions).max() > 0.3
    half = dress.triangles[worn[dress.triangles][:, 0, 0] < 0]  # of the leg that moves
    moved = transfer_garment(worn, half, before.positions, after.positions, before.triangles)
    moved = moved[np.unique(half)]
    found = body_surface(after.positions, after.triangles).penetration(moved)
    assert found.count < 0.005 * len(moved)
    assert found.depth < 2e-3
