"""Run that leaves nothing but its last positions."""

from clothsim.base.arrays import Floats
from clothsim.mesh.world import World
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.time_loop import steps


def last_positions(scene: Scene) -> tuple[World, Floats, str]:
    """Step a scene to its end without writing or checking anything.

    Returns
    -------
    world : World
    positions : (n, 3) float64
        Cloth vertices after the last step that was taken [m].
    reason : str
        Why it came to no end; empty where it did.
    """
    session = prepare(scene, build(scene))
    world, run = session.built.world, scene.run_settings
    state, reason = first_state(world, session.integrator.dt), ""
    for report in steps(session.integrator, state, run.duration, run.frames_per_second, run.until):
        if report.failure is not None:
            reason = report.failure.reason
            break
        state = report.state
    return world, state.positions[: world.n_cloth] + world.origin, reason
