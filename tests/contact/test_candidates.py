"""The cache of pairs never changes what is found; a step limit never lets anything through."""

from dataclasses import replace

import ipctk
import numpy as np
import pytest
from meshes import cloth, grid

from clothsim.contact.candidates import Candidates
from clothsim.contact.surface import cloth_body_surface
from clothsim.mesh.body import make_body
from clothsim.mesh.generate import GENERATORS
from clothsim.mesh.world import make_world

D_HAT = 0.05


def surface_of_ball_and_sheet(height=0.34):
    positions, triangles = grid(6, 6)
    sheet = replace(cloth(positions, triangles), positions=positions + np.array([-0.5, -0.5, height]))
    body = make_body("ball", *GENERATORS["sphere"](radius=0.3, subdivisions=2))
    world = make_world([sheet], [body])
    return cloth_body_surface(world), world.start()


def all_pairs(surface, x):
    """Distances of all pairs below d_hat, from fresh candidates with a generous margin."""
    candidates = ipctk.Candidates()
    candidates.build(surface.mesh, surface.rows(x), 0.2)
    return described(surface, x, candidates)


def described(surface, x, candidates):
    collisions = ipctk.NormalCollisions()
    collisions.use_area_weighting = True
    collisions.build(candidates, surface.mesh, surface.rows(x), D_HAT)
    return summary(surface, x, collisions)


def summary(surface, x, collisions):
    edges, faces = surface.mesh.edges, surface.mesh.faces
    pairs = []
    for k in range(len(collisions)):
        collision = collisions[k]
        vertices = [v for v in collision.vertex_ids(edges, faces) if v >= 0]
        pairs.append((tuple(sorted(vertices)), round(collision.weight, 12)))
    return sorted(pairs)


@pytest.mark.parametrize("reach", [1e-9, 0.01, 0.1])
def test_the_pairs_are_all_pairs_wherever_the_cache_comes_from(reach):
    surface, x = surface_of_ball_and_sheet()
    candidates = Candidates(surface, D_HAT, reach)
    rng = np.random.default_rng(0)
    found = 0
    for _ in range(5):
        dx = 0.02 * rng.standard_normal(x.shape)
        candidates.step_limit(x, dx)
        for fraction in (0.0, 1.0):
            y = x + fraction * dx
            pairs = summary(surface, y, candidates.collisions(y))
            assert pairs == all_pairs(surface, y)
            found += len(pairs)
        x = x + 0.3 * dx
    assert found > 20


def test_the_cache_is_used_and_forgotten():
    surface, x = surface_of_ball_and_sheet()
    candidates = Candidates(surface, D_HAT, reach=0.05)
    candidates.collisions(x)
    candidates.collisions(x + 0.01)
    candidates.collisions(x - 0.01)
    assert candidates.builds == 1
    candidates.collisions(x + 0.1)
    assert candidates.builds == 2
    candidates.forget()
    candidates.collisions(x + 0.1)
    assert candidates.builds == 3
    assert candidates.pairs == len(candidates.collisions(x + 0.1))


def test_the_step_limit_stops_before_the_first_touch():
    surface, x = surface_of_ball_and_sheet(height=0.4)
    dx = np.zeros_like(x)
    dx[: surface.n_cloth, 2] = -0.5
    limit = Candidates(surface, D_HAT, D_HAT).step_limit(x, dx)
    assert 0.1 < limit < 0.2  # the ball's top is 0.1 below
    assert not surface.intersects(x + limit * dx)
    assert surface.intersects(x + 2 * limit * dx)


@pytest.mark.parametrize("seed", range(6))
def test_no_step_within_its_limit_intersects(seed):
    surface, x = surface_of_ball_and_sheet()
    rng = np.random.default_rng(seed)
    dx = rng.standard_normal(x.shape) * 0.2
    dx[: surface.n_cloth, 2] -= 0.5
    candidates = Candidates(surface, D_HAT, D_HAT)
    limit = candidates.step_limit(x, dx)
    assert 0 < limit < 1
    assert candidates.ccd_calls == 1
    for fraction in np.linspace(0, limit, 9):
        assert not surface.intersects(x + fraction * dx)


def test_a_free_step_is_not_limited():
    surface, x = surface_of_ball_and_sheet()
    dx = np.zeros_like(x)
    dx[: surface.n_cloth, 2] = 7.0
    assert Candidates(surface, D_HAT, D_HAT).step_limit(x, dx) == 1.0


@pytest.mark.parametrize("speed", [1.0, 100.0, 1e4])
def test_nothing_tunnels_at_any_speed(speed):
    surface, x = surface_of_ball_and_sheet(height=0.5)
    dx = np.zeros_like(x)
    dx[: surface.n_cloth, 2] = -speed
    limit = Candidates(surface, D_HAT, D_HAT).step_limit(x, dx)
    assert 0.15 < limit * speed < 0.2
