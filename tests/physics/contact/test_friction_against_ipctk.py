"""Friction against ipctk's tangential collisions: the same pairs, normal forces, energy, gradient and Hessian.

ipctk leaves out edges that its mollifier weakens (nearly parallel ones, by the rest lengths); here they slide with the
force that the mollifier leaves them. Where such edges touch, the sets differ by exactly those pairs: they are removed
from ours before the comparison.

A vertex over the interior of a needle is the one case outside the bounds, and there ipctk is at fault: it solves normal
equations for the closest point, which squares their condition. Exact arithmetic decides that one.
"""

from dataclasses import replace
from fractions import Fraction

import ipctk
import numpy as np
import pytest
from contact_configurations import adversarial, at_random, close
from differences import dense_hessian
from effect_builders import friction
from ipctk_barrier import by_ipctk
from solving import step_at

from clothsim.base.vectors import four_points
from clothsim.physics.contact import barrier_kernels as kernels

POSES = {**at_random(), **adversarial(), **close()}
OVER_NEEDLES = "needles over needles, body"
"""Vertices 3e-7 m inside triangles 1e-6 m wide and 0.2 m long, and no contact within a layer that outweighs them."""
MU, EPS_V, DT = 0.4, 0.05, 0.01


def mollified(contact, x):
    """{rows} of the edge-edge pairs that the mollifier weakens."""
    pairs = contact.candidates.active(x)
    edges = range(pairs.n_points, len(pairs))
    found = [k for k in edges if kernels.cross_squared(four_points(x, pairs.elements, k)) < pairs.thresholds[k]]
    return {tuple(pairs.elements[k]) for k in found}


def lagged(pose):
    """Friction with the forces at the pose, without mollified edges; and the number of those.

    ipctk rubs the terms of negative weight too: they are added.
    """
    contact = pose.contact()
    made = friction(pose.world, coefficient=MU, eps_v=EPS_V, contacts=("contact",))
    step = replace(step_at(pose.x, dt=DT), time=1.0, bound={"contact": contact})
    bound = made.begin(step)
    elements, weights, differences, forces = contact.normal_forces(pose.x, contact.stiffness)
    assert np.array_equal(bound.limits, MU * forces[forces > 0])
    weak = mollified(contact, pose.x)
    others = np.array([tuple(rows) not in weak for rows in elements]) & (forces != 0)
    normals = differences / np.linalg.norm(differences, axis=1, keepdims=True)
    parts = {"elements": elements, "weights": weights, "normals": normals, "limits": MU * forces}
    none = np.zeros((len(forces), 3))
    parts |= {"slips": none, "turns": none, "slides": np.zeros(len(forces), bool)}
    return replace(bound, **{name: part[others] for name, part in parts.items()}), int((~others).sum())


class Oracle:
    """ipctk's friction of the same pose; it takes displacements, and eps_v dt in their unit."""

    def __init__(self, pose):
        contact = by_ipctk(pose.contact())
        self.candidates, self.start = contact.candidates, pose.x
        potential = ipctk.BarrierPotential(contact.d_hat, contact.stiffness, True)
        self.collisions = [ipctk.TangentialCollisions() for _ in range(2)]
        for tangential, normal in zip(self.collisions, self.candidates.collisions(pose.x), strict=True):
            tangential.build(self.candidates.mesh, self.candidates.rows_of(pose.x), normal, potential, MU)
        self.potential = ipctk.FrictionPotential(EPS_V * DT)

    def at(self, x):
        """Energy [J], gradient (N, 3) [N] and Hessian (3 N, 3 N) [N/m]."""
        asked = [(each, self.candidates.mesh, self.candidates.rows_of(x - self.start)) for each in self.collisions]
        hessian = sum(self.potential.hessian(*each).toarray() for each in asked)
        gradient = sum(self.potential.gradient(*each).reshape(-1, 3) for each in asked)
        return sum(self.potential(*each) for each in asked), gradient, hessian


@pytest.mark.parametrize("name", [name for name in POSES if name != OVER_NEEDLES])
def test_energy_gradient_and_hessian_against_ipctk(name):
    """Sticking and slipping contacts, both in one displacement."""
    pose = POSES[name]
    mine, _ = lagged(pose)
    oracle = Oracle(pose)
    rng = np.random.default_rng(0)
    for size in (0.1, 1.0, 10.0):
        x = pose.x + size * EPS_V * DT * rng.standard_normal(pose.x.shape)
        energy, gradient, hessian = oracle.at(x)
        assert energy > 0
        assert mine.value(x) == pytest.approx(energy, rel=1e-12)
        assert np.abs(mine.gradient(x) - gradient).max() <= 1e-10 * np.abs(gradient).max()
        assert np.abs(dense_hessian(mine, x) - hessian).max() <= 1e-8 * np.abs(hessian).max()


def exact_weights(p, a, b, c):
    """Weights of b and c at the foot of the perpendicular from p, in rational numbers."""
    p, a, b, c = (np.array([Fraction(float(each)) for each in point]) for point in (p, a, b, c))
    e, f, r = b - a, c - a, p - a
    determinant = (e @ e) * (f @ f) - (e @ f) ** 2
    return ((r @ e) * (f @ f) - (r @ f) * (e @ f)) / determinant, ((r @ f) * (e @ e) - (r @ e) * (e @ f)) / determinant


def error(found, exact):
    return max(abs(float(Fraction(float(one)) - true)) for one, true in zip(found, exact, strict=True))


def test_closest_points_over_needles_against_exact_arithmetic():
    pose = POSES[OVER_NEEDLES]
    mine, oracle = lagged(pose)[0], Oracle(pose)
    faces = oracle.candidates.mesh.faces
    of_ipctk = {}
    for each in oracle.collisions[0].fv_collisions:
        a, b, c = (int(row) for row in faces[each.face_id])
        v, w = each.closest_point
        point = int(each.vertex_ids(oracle.candidates.mesh.edges, faces)[0])
        of_ipctk[point, frozenset((a, b, c))] = {a: 1 - v - w, b: v, c: w}
    errors = []
    for rows, weights in zip(mine.elements, mine.weights, strict=True):
        if (weights[1:] < 0).all() and weights[0] == 1:
            theirs = of_ipctk[int(rows[0]), frozenset(map(int, rows[1:]))]
            exact = exact_weights(*pose.x[rows])
            errors.append([error(two, exact) for two in (-weights[2:], (theirs[rows[2]], theirs[rows[3]]))])
    worst = np.max(errors, axis=0)
    assert len(errors) > 20
    assert worst[0] < 1e-10
    assert worst[1] > 1e3 * worst[0]


def test_configurations_with_and_without_mollified_edges():
    left_out = {name: lagged(pose)[1] for name, pose in POSES.items()}
    assert left_out["edges nearly parallel, two cloths"] > 50
    assert sum(count == 0 for count in left_out.values()) > 5
