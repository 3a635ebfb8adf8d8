"""The sheet and ball of the benchmark as a scene for peers."""

from dataclasses import replace

import numpy as np

from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from tests.benchmarks.bench.bench_cases import D_HAT, FRICTION, PEERS, RADIUS, sphere
from tests.benchmarks.peers.peer_scene import PeerScene

HEIGHT, DT = 0.05, 0.02
"""Height above the ball at which the sheet is released [m], and the step [s]."""


def released(cells: int, friction: float = FRICTION) -> Scene:
    """The sheet of `cells` x `cells`, at rest 5 cm above the ball: the scene of clothsim."""
    scene = sphere(cells, height=HEIGHT, fall=0.0)
    effects = {name: keys for name, keys in scene.effects.items() if name != "friction"}
    return replace(scene, effects={**effects, "friction": {"coefficient": friction}} if friction else effects)


def shared_sheet(cells: int, seconds: float, dt: float = DT, friction: float = FRICTION) -> PeerScene:
    """The same for peers: an isotropic sheet as stiff as the neo-Hookean one with hinges."""
    scene = released(cells)
    built = build(Scene(cloth=scene.cloth, body=scene.body, effects={**scene.effects, **PEERS}, solver=scene.solver))
    world = built.world
    mu, lam = (float(world.per_triangle(name)[0]) for name in ("shear_modulus", "lame_modulus"))
    poisson = lam / (2.0 * mu + lam)
    body = world.bodies[0]
    return PeerScene(
        cells=cells,
        positions=np.array(world.cloths[0].positions),
        triangles=np.array(world.cloths[0].triangles),
        ball_positions=np.array(body.positions),
        ball_triangles=np.array(body.triangles),
        radius=RADIUS,
        density=float(world.per_triangle("density")[0]),
        stretch=2.0 * mu * (1.0 + poisson),
        poisson=poisson,
        bending=float(world.hinges.stiffness[0]),
        gap=D_HAT,
        friction=friction,
        dt=dt,
        steps=round(seconds / dt),
    )
