"""Differentiable runs of small scenes, and central differences of whole runs."""

from dataclasses import replace

import numpy as np
from small_scenes import BALL, SHEET

from clothsim import Scene
from clothsim.gradients.backward_pass import backward_pass
from clothsim.gradients.differentiable_session import bound_to, differentiable_session, recorded
from clothsim.gradients.losses import Custom
from clothsim.gradients.parameters import value_at, with_value
from clothsim.gradients.run import Trace
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.stepping import advance

KAPPA = 300.0
"""Stiffness of contact that is held [Pa]."""

FALLING = SHEET | {
    "cells": [5, 5],
    "position": [0.013, 0.007, 0.305],
    "rotation_degrees": [3.0, 2.0, 11.0],
    "velocity": [0.3, 0.1, -1.0],
    "fabric": "cotton",
    "youngs_modulus": 1e5,
    "bending_stiffness": 1e-5,
}
ELASTIC = {"inertia": {}, "membrane": {}, "bending": {"model": "hinge"}, "gravity": {}}
CONTACT = {"body_contact": {"stiffness": KAPPA}, "self_contact": {"stiffness": KAPPA}}
FRICTION = {"friction": {"eps_v": 2e-2, "coefficient": 0.3}}
STEADY, VARYING = (0.02,) * 6, (0.02, 0.013, 0.02, 0.011, 0.016, 0.02)


def falling_scene(effects=ELASTIC | CONTACT, cloth=FALLING, body=BALL, **solver):
    solver = {"dt": 0.02, "threads": 1, "tolerance": 1e-5, "unstable_equilibrium": "keep"} | solver
    run = {"duration": 0.12, "frames_per_second": 25}
    return Scene(cloth=cloth, body=body, effects=effects, solver=solver, run=run)


def differentiable(scene, polish=8):
    return differentiable_session(prepare(scene, build(scene)), polish)


def stepped(integrator, state, lengths):
    """Records of steps of given lengths [s]."""
    records = []
    for h in lengths:
        report = advance(integrator, replace(state, dt=1.01 * h), state.time + h, retries=False)
        assert report.converged, report.failures
        records.append(recorded(state, report))
        state = report.state
    return records


class Chain:
    """Steps of a scene from its start, a random linear loss of the end, and its adjoints."""

    def __init__(self, scene, lengths=STEADY, seed=0, system=None):
        self.session, self.lengths = differentiable(scene), lengths
        self.integrator = self.session.integrator
        self.start = first_state(self.session.built.world, lengths[0])
        self.records = stepped(self.integrator, self.start, lengths)
        n = self.session.built.world.n_cloth
        self.n, rng = n, np.random.default_rng(seed)
        self.by_x, self.by_v = np.zeros_like(self.start.positions), np.zeros_like(self.start.positions)
        self.by_x[:n] = rng.standard_normal((n, 3))
        if "inertia" in self.integrator.potential.energies:
            self.by_v[:n] = 0.02 * rng.standard_normal((n, 3))

    def adjoints(self):
        last = len(self.records)
        return backward_pass(self.integrator, self.records, {last: self.by_x}, {last: self.by_v})

    def loss(self, start=None, integrator=None):
        records = stepped(integrator or self.integrator, start or self.start, self.lengths)
        end = records[-1].end
        return float(np.vdot(self.by_x, end.positions) + np.vdot(self.by_v, end.velocities))

    def along(self, gradient, how):
        """A direction with largest entry 1: random, or that of the gradient."""
        d = np.zeros_like(gradient)
        d[: self.n] = np.random.default_rng(5).standard_normal((self.n, 3)) if how == "random" else gradient[: self.n]
        return d / np.abs(d).max()

    def start_error(self, adjoints, name, how="random", sizes=(3e-7, 3e-8, 3e-9), integrator=None):
        """Relative error of the derivative by the start, against the best of three central differences of the run."""
        gradient = adjoints.start if name == "positions" else adjoints.velocities
        d = self.along(gradient, how)
        return best_error(
            float(np.vdot(gradient, d)),
            lambda h: self.loss(replace(self.start, **{name: getattr(self.start, name) + h * d}), integrator),
            sizes,
        )


def best_error(derivative, loss, sizes, enough=1e-6):
    """Smallest relative difference to central differences of `loss`, a function of a displacement, over some sizes.

    The first below `enough`, the tightest bound of the tests, is taken: the runs of the other sizes would change none.
    """
    assert derivative != 0.0
    least = np.inf
    for h in sizes:
        least = min(least, abs((loss(h) - loss(-h)) / (2 * h) - derivative) / abs(derivative))
        if least < enough:
            break
    return least


def stacked_scene(effects=ELASTIC | CONTACT | FRICTION, turn=0.5, shift=(0.021, 0.013), body=(), **solver):
    """Two sheets with nearly parallel edges, one falling on the other, which hangs from its corners."""
    sheet = {key: FALLING[key] for key in ("mesh", "fabric", "youngs_modulus", "bending_stiffness")}
    sheet |= {"size": [0.4, 0.4], "cells": [3, 3]}
    lower = sheet | {"name": "lower", "velocity": [0.0, 0.0, 0.5]}
    upper = sheet | {"name": "upper", "position": [*shift, 0.012], "rotation_degrees": [0.3, 0.2, turn]}
    upper |= {"velocity": [0.2, 0.1, -1.0]}
    effects = effects | {"pins": {"select": [0, 3, 12, 15]}}
    solver = {"dt": 0.01, "threads": 1, "tolerance": 1e-5, "unstable_equilibrium": "keep"} | solver
    run = {"duration": 0.1, "frames_per_second": 25}
    return Scene(cloth=[lower, upper], body=body, effects=effects, solver=solver, run=run)


def mollified_pairs(chain):
    """Largest number of active pairs of nearly parallel edges in a step."""
    counts = []
    for record in chain.records:
        contact = bound_to(chain.integrator, record)[1].energies["self_contact"]
        pairs, x = contact.distinct(record.solution), record.solution
        a, b, c, d = (x[pairs.elements[:, k]] for k in range(4))
        crossed = (np.cross(b - a, d - c) ** 2).sum(axis=1)
        counts.append(int(((pairs.thresholds > 0) & (crossed < pairs.thresholds)).sum()))
    return max(counts)


class Case:
    """A chain with its gradient, and runs of the same steps with other scenes."""

    def __init__(self, scene, **settings):
        self.scene = scene
        self.chain = Chain(scene, **settings)
        self.chain.by_v[:] = 0.0
        session, records = self.chain.session, tuple(self.chain.records)
        ends = [replace(each.end, frame=each.end.step) for each in records]
        starts = [records[0].start, *ends[:-1]]
        steps = tuple(replace(r, start=s, end=e) for r, s, e in zip(records, starts, ends, strict=True))
        self.run = Trace(session, steps)
        by_x = self.chain.by_x[: self.chain.n]
        self.gradient = self.run.gradient(Custom(lambda x: (float(np.vdot(by_x, x)), by_x)))

    def loss(self, scene=None, built=None):
        session = differentiable(scene or self.scene)
        integrator = session.integrator
        if built is not None:
            potential = replace(integrator.potential, energies=built.energies)
            integrator = replace(integrator, world=built.world, constraints=built.constraints, potential=potential)
        start = first_state(integrator.world, self.chain.lengths[0])
        end = stepped(integrator, start, self.chain.lengths)[-1].end.positions[: self.chain.n]
        return float(np.vdot(self.chain.by_x[: self.chain.n], end + integrator.world.origin))

    def error(self, path, sizes=(1e-4, 1e-5)):
        value = value_at(self.scene, self.run.session.built.world, path)
        direction = np.ones(value.shape) if not value.shape else np.random.default_rng(2).standard_normal(value.shape)
        scale = float(np.abs(value).max()) or 0.1
        return best_error(
            float(np.vdot(self.gradient[path], direction)),
            lambda h: self.loss(with_value(self.scene, path, value + h * direction)),
            [size * scale for size in sizes],
        )


def halved_errors(derivative, loss, h):
    """Relative differences of a derivative to the central differences of `loss` with h and with h/2."""
    assert derivative != 0.0
    return [abs((loss(each) - loss(-each)) / (2 * each) - derivative) / abs(derivative) for each in (h, h / 2)]
