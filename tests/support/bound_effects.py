"""Each effect of THE table on a small world, with a step to bind it to."""

from dataclasses import replace

import numpy as np
from effect_builders import built
from meshes import cloth, deformed, irregular_grid

from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Constraint, Energy, Past, Step
from clothsim.scene.effects import EFFECTS

KEYS = {"friction": {"coefficient": 0.7, "eps_v": 0.3}}


def table_world():
    """A bent cloth at 0.25 m over one large triangle, all numbers of order one."""
    positions, triangles = irregular_grid(0)
    positions[:, 2] = 0.2 * np.sin(2 * positions[:, 0]) + 0.1 * positions[:, 1] ** 2
    sheet = cloth(positions, triangles)
    sheet = replace(sheet, positions=positions + np.array([0.0, 0.0, 0.25]))
    floor = make_body("floor", np.array([[-1.0, -1, 0], [3, -1, 0], [-1, 3, 0]]), np.array([[0, 1, 2]]))
    return make_world([sheet], [floor])


def unbound(name, keys=None, **bending):
    """The effect on the table world, with bending of these keys, a step to bind it to, and positions at its end.

    None for a constraint.
    """
    world = table_world()
    filled = {"contacts": ("body_contact",), "built": {"bending": built("bending", world, **bending)}}
    keys = keys or KEYS.get(name, EFFECTS[name].example().keys)
    energy = built(name, world, **keys, **filled)
    if isinstance(energy, tuple):
        assert isinstance(energy[1], Constraint)
        return None
    assert isinstance(energy, Energy)
    rng = np.random.default_rng(7)
    x = world.start()
    velocities, before = rng.standard_normal((2, *x.shape))
    contact = built("body_contact", world, **EFFECTS["body_contact"].example().keys)
    past = Past(x + 0.05 * before, velocities + 0.3 * before, 0.7 * 0.8)  # BDF2 with r = 1/3, b = .8
    bound = {"body_contact": contact}
    step = Step(0.3, 0.7, x, velocities, 0.6, np.zeros_like(x), bound=bound, multistep_past=past)
    return energy, step, deformed(world, seed=3, amplitude=0.04)
