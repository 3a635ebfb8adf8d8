"""Bending models: derivatives, rigid motion, balance, definiteness, and agreement of both."""

from dataclasses import replace

import numpy as np
import pytest
from differences import dense_hessian, gradient_error, hessian_error, taylor_slopes
from effect_builders import bending
from meshes import UNIT, cloth, deformed, grid, irregular_grid, random_rotation, small_world

from clothsim.base.errors import InputError
from clothsim.base.linalg import kabsch
from clothsim.mesh.cloth import dihedral_angles
from clothsim.mesh.topology import border_edges
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off, Step
from clothsim.physics.energies.hessians import split
from clothsim.physics.energies.quadratic_bending import folded

MODELS = ["hinge", "quadratic", "midedge"]
SMALL = (1e-3, 5e-4, 2.5e-4)
"""Displacements [m] at which a remainder is its first term. From 2.5e-3 on, with short waves, the third-order term is
as large as the second-order one in some directions: slopes of 1.79 and 2.35, at these 1.98 and 2.05."""


def step_at(x):
    zero = np.zeros_like(x)
    return Step(time=0.0, dt=1.0, positions=x, velocities=zero, load=1.0, gradient=zero)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("seed", [0, 1])
def test_derivatives(model, curved, seed):
    world = small_world(seed, curved=curved)
    x = deformed(world, seed)
    energy = bending(world, model=model).begin(step_at(deformed(world, seed, amplitude=0.05)))
    assert gradient_error(energy, x) < 1e-7
    assert hessian_error(energy, x) < 1e-6
    first, second = taylor_slopes(energy, x, sizes=SMALL)
    assert abs(first - 2) < 0.15
    assert second > 2.85


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("curved", [False, True])
def test_rigid_motion_of_the_rest_shape_costs_nothing(model, curved):
    world = small_world(curved=curved)
    energy = bending(world, model=model)
    for seed in range(4):
        x = world.start() @ random_rotation(seed).T + np.array([1.0, -2.0, 3.0])
        bound = energy.begin(step_at(x))
        assert bound.value(x) < 1e-26
        assert np.abs(bound.gradient(x)).max() < 1e-11
    bent = world.start() + np.sin(3 * world.start()[:, :1]) * [0, 0, 0.1]
    assert energy.value(bent) > 1e-3


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("curved", [False, True])
def test_energy_is_invariant_and_force_turns_along(model, curved):
    world = small_world(curved=curved)
    energy, x, turn = bending(world, model=model), deformed(world), random_rotation(5)
    moved = x @ turn.T + 0.7
    here, there = energy.begin(step_at(x)), energy.begin(step_at(moved))
    assert there.value(moved) == pytest.approx(here.value(x), rel=1e-12)
    force = here.gradient(x)
    assert np.abs(there.gradient(moved) - force @ turn.T).max() < 1e-12 * np.abs(force).max()


@pytest.mark.parametrize(
    ("model", "curved"),
    [("hinge", False), ("hinge", True), ("quadratic", False), ("midedge", False), ("midedge", True)],
)
def test_force_and_torque_balance(model, curved):
    world = small_world(curved=curved)
    x = deformed(world)
    force = bending(world, model=model).gradient(x)
    largest = np.abs(force).max()
    assert largest > 0.1
    assert np.abs(force.sum(axis=0)).max() < 1e-13 * largest
    assert np.abs(np.cross(x, force).sum(axis=0)).max() < 1e-13 * largest


def test_quadratic_force_balances_on_a_curved_rest_shape_too():
    world = small_world(curved=True)
    x = deformed(world)
    force = bending(world, model="quadratic").begin(step_at(x)).gradient(x)
    assert np.abs(force.sum(axis=0)).max() < 1e-13 * np.abs(force).max()


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("curved", [False, True])
def test_projected_hessian_is_positive_semi_definite(model, curved):
    world = small_world(curved=curved)
    blocks = bending(world, model=model).hessian(deformed(world, amplitude=0.2), project=True).blocks
    lowest = np.linalg.eigvalsh(blocks)[:, 0]
    assert (lowest > -1e-13 * np.abs(blocks).max()).all()
    assert np.abs(blocks).max() > 1


def test_exact_hinge_hessian_is_indefinite_where_it_is_bent():
    world = small_world()
    energy, x = bending(world, model="hinge"), deformed(world, amplitude=0.2)
    exact = dense_hessian(energy, x)
    assert np.linalg.eigvalsh(exact)[0] < -1e-3 * np.abs(exact).max()
    assert np.abs(exact - dense_hessian(energy, x, project=True)).max() > 1e-3 * np.abs(exact).max()


def test_quadratic_hessian_is_constant_and_that_of_the_hinges_across_the_flat_sheet():
    world = small_world()
    hinge, quadratic = bending(world, model="hinge"), bending(world, model="quadratic")
    flat = world.start()
    constant = dense_hessian(quadratic, flat)
    assert np.array_equal(constant, dense_hessian(quadratic, deformed(world)))
    across = dense_hessian(hinge, flat)[2::3, 2::3]
    assert np.abs(constant[2::3, 2::3] - across).max() < 1e-13 * np.abs(across).max()


@pytest.mark.parametrize("angle", [0.02, 0.2, -0.2])
def test_models_agree_on_an_isometric_fold(angle):
    positions, triangles = grid(2, 3)
    world = make_world([cloth(positions, triangles)])
    over = np.maximum(positions[:, :1] - 0.5, 0)
    x = np.where(over > 0, np.hstack([0.5 + over * np.cos(angle), positions[:, 1:2], -over * np.sin(angle)]), positions)
    exact = 0.5 * UNIT.bending_stiffness * angle**2 / 0.5
    assert bending(world, model="hinge").value(x) == pytest.approx(exact, rel=1e-12)
    assert bending(world, model="quadratic").value(x) == pytest.approx(exact * (2 * np.sin(angle / 2) / angle) ** 2)


def test_quadratic_rest_shape_is_the_mesh_s_own():
    world = small_world(curved=True)
    hinges = world.hinges
    rest = folded(hinges.corners, hinges.rest_angles)
    every = np.arange(4 * len(rest)).reshape(-1, 4)
    assert np.abs(dihedral_angles(rest.reshape(-1, 3), every) - hinges.rest_angles).max() < 1e-14
    frames, _ = kabsch(rest, world.start()[hinges.vertices])
    centred = world.start()[hinges.vertices] - world.start()[hinges.vertices].mean(axis=1, keepdims=True)
    carried = (rest - rest.mean(axis=1, keepdims=True)) @ np.swapaxes(frames, 1, 2)
    assert np.abs(carried - centred).max() < 1e-14
    assert np.abs(np.linalg.det(frames) - 1).max() < 1e-13


@pytest.mark.parametrize("flatten", [[1, 1, 0], [1, 0, 0], [0, 0, 0]])
def test_quadratic_targets_keep_their_length_where_the_cloth_is_flat_a_line_or_a_point(flatten):
    world = small_world(curved=True)
    energy = bending(world, model="quadratic")
    bound = energy.begin(step_at(world.start() * flatten))
    length = 2 * np.abs(np.sin(world.hinges.rest_angles / 2))
    assert np.abs(np.linalg.norm(bound.targets, axis=1) - length).max() < 1e-13


def test_quadratic_begins_with_a_copy_and_a_flat_one_with_itself():
    curved, flat = (bending(small_world(curved=c), model="quadratic") for c in (True, False))
    x = deformed(small_world(curved=True))
    before = curved.targets.copy()
    assert np.abs(curved.begin(step_at(x)).targets - before).max() > 0.01
    assert np.array_equal(curved.targets, before)
    assert flat.begin(step_at(x)) is flat


@pytest.mark.parametrize("rest_angle", [0.0, 1.5, -2.5])
def test_hinge_energy_is_smooth_up_to_the_closed_fold(rest_angle):
    """No wrapping: between -pi and pi the moment is linear in the angle, whatever the angle at rest."""
    corners = np.array([[0, 0], [1, 0], [0.4, 0.7], [0.5, -0.8]])
    angles = np.linspace(-3.14, 3.14, 41)
    rest = folded(corners[None], np.array([rest_angle]))[0]
    energy = bending(make_world([cloth(rest, np.array([[0, 1, 2], [1, 0, 3]]))]), model="hinge")
    values = np.array([energy.value(folded(corners[None], np.array([a]))[0]) for a in angles])
    exact = 0.5 * energy.stiffnesses[0] * (angles - rest_angle) ** 2
    assert np.abs(values - exact).max() < 1e-12 * exact.max()


@pytest.mark.parametrize("model", ["hinge", "midedge"])
def test_a_triangle_without_area_is_not_admissible_and_nothing_is_nan(model):
    world = small_world()
    x = world.start()
    x[world.triangles[0]] = x[world.triangles[0, 0]]
    energy = bending(world, model=model)
    assert energy.value(x) == np.inf
    assert np.isfinite(energy.gradient(x)).all()
    assert np.isfinite(dense_hessian(energy, x)).all()
    assert np.isfinite(bending(world, model="quadratic").value(x))


@pytest.mark.parametrize("model", MODELS)
def test_a_limp_cloth_drops_its_hinges_and_a_limp_world_the_effect(model):
    stiff = cloth(*irregular_grid(0), name="stiff")
    limp = cloth(*irregular_grid(1), fabric=replace(UNIT, bending_stiffness=0.0), name="limp")
    both, alone = make_world([limp, stiff]), make_world([stiff])
    energy = bending(both, model=model)
    assert len(energy.vertices) == len(alone.hinges.vertices)
    x = deformed(both)
    assert energy.value(x) == pytest.approx(
        bending(alone, model=model).value(x[both.cloth_slices[1]].copy()), rel=1e-12
    )
    assert not energy.gradient(x)[both.cloth_slices[0]].any()
    assert bending(make_world([limp]), model=model) == Off("bending stiffness is zero")


def test_the_implicit_hessian_is_0_for_a_translation():
    world = small_world()
    x = deformed(world)
    _, implicit = split([bending(world, model="midedge").hessian(x, project=False)])
    assert len(implicit) == 1
    largest = np.abs(implicit[0].apply(np.random.default_rng(3).standard_normal(x.shape))).max()
    for axis in np.eye(3):
        assert np.abs(implicit[0].apply(np.tile(axis, (len(x), 1)))).max() < 1e-13 * largest


def test_no_interior_edge_is_off():
    world = make_world([cloth(np.eye(3), np.array([[0, 1, 2]]))])
    assert bending(world, model="hinge") == Off("the cloth has no interior edge")


@pytest.mark.parametrize(
    ("model", "words"), [("hinges", "'hinge'"), ("quadratik", "'quadratic'"), ("midegde", "'midedge'")]
)
def test_unknown_models_are_refused_by_name(model, words):
    with pytest.raises(InputError, match=words) as refusal:
        bending(small_world(), model=model)
    assert repr(model) in str(refusal.value)


# --- short waves ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("curved", [False, True])
def test_derivatives_and_balance_with_short_waves(curved):
    world = small_world(0, curved=curved)
    x = deformed(world, 0)
    energy = bending(world, short_waves=1.3)
    assert gradient_error(energy, x) < 1e-7
    assert hessian_error(energy, x) < 1e-6
    first, second = taylor_slopes(energy, x, sizes=SMALL)
    assert abs(first - 2) < 0.15
    assert second > 2.85
    assert np.linalg.eigvalsh(dense_hessian(energy, x, project=True)).min() > -1e-9
    assert np.abs(energy.gradient(x).sum(axis=0)).max() < 1e-10 * np.abs(energy.gradient(x)).max()
    assert energy.value(x) > bending(world).value(x)
    rotation = random_rotation(np.random.default_rng(2))
    assert energy.value(x @ rotation.T + 1.0) == pytest.approx(energy.value(x), rel=1e-9)


def test_springs_bound_the_short_waves_too():
    world = small_world(0)
    energy, flat = bending(world, short_waves=5.0), world.start()
    apart = dense_hessian(energy, flat, project=True) - dense_hessian(energy, flat)
    assert np.linalg.eigvalsh(apart)[0] > -1e-9 * np.abs(apart).max()


@pytest.mark.parametrize("weight", [-0.1, 10.1, 1e300])
def test_a_weight_that_no_mesh_needs_is_refused(weight):
    with pytest.raises(InputError, match=r"effects\.bending\.short_waves"):
        bending(small_world(0), short_waves=weight)


def test_moving_vertices_alone_have_the_forces_of_all():
    world = make_world([cloth(*grid(8, 8))])
    x, moving = deformed(world, 0, 0.01), np.arange(world.n_cloth) < 9
    energy = bending(world, short_waves=1.0)
    part = energy.restricted_to(moving, x)
    assert len(part.elements) < len(energy.elements)
    assert part.gradient(x)[moving] == pytest.approx(energy.gradient(x)[moving], rel=1e-12)


def test_short_waves_of_a_quadratic_surface_have_no_force():
    positions, triangles = grid(16, 16)
    side = np.ptp(positions[:, 0])
    inside = ~np.isin(np.arange(len(positions)), border_edges(triangles)[0])
    positions[inside, :2] += side / 80 * np.random.default_rng(0).uniform(-1, 1, (int(inside.sum()), 2))
    world = make_world([cloth(positions, triangles)])
    x = world.start()
    x[:, 2] = 1e-6 * (x[:, 0] ** 2 + x[:, 0] * x[:, 1]) / side
    far = np.abs(positions[:, :2] - positions[:, :2].mean(axis=0)).max(axis=1) < 0.15 * side
    force = np.linalg.norm(bending(world, short_waves=10.0).gradient(x), axis=1)
    assert far.sum() > 8
    assert force[far].max() < 1e-6 * force.max()


@pytest.mark.parametrize(("cells", "left"), [(10, 0.15), (6, 0.25), (4, 0.45)])
def test_short_waves_restore_the_energy_of_waves(cells, left):
    positions, triangles = grid(8 * cells, 8 * cells)
    world = make_world([cloth(positions, triangles)])
    x = world.start()
    size = np.ptp(x[:, 0])
    q = 16 * np.pi / size
    x[:, 2] = 1e-6 * size * np.sin(q * x[:, 0])
    exact = world.per_triangle("bending_stiffness") @ world.rest_areas / 4 * (1e-6 * size * q * q) ** 2
    without, restored = (bending(world, short_waves=f).value(x) / exact - 1 for f in (0.0, 1.0))
    assert without < -0.09 * (2 * np.pi / cells) ** 2
    assert abs(restored) < left * abs(without)


@pytest.mark.parametrize("model", ["hinge", "quadratic"])
def test_short_waves_are_of_midedge(model):
    with pytest.raises(InputError, match="short_waves"):
        bending(small_world(0), model=model, short_waves=0.5)
    assert not isinstance(bending(small_world(0), model=model, short_waves=0.0), Off)
