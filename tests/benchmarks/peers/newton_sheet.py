"""What the solvers of Newton share: the ball, the loop of substeps, contact of particles with the ball."""

from typing import Any

from tests.benchmarks.peers.peer_scene import GRAVITY, PeerScene, Simulation

SUBSTEPS = 10
CONTACT_STIFFNESS, CONTACT_DAMPING = 1e4, 1e-2


def finished(builder: Any, scene: PeerScene) -> Any:
    """The model of a builder that holds the sheet, with the ball."""
    import newton
    import warp

    builder.add_shape_sphere(-1, radius=scene.radius, cfg=newton.ModelBuilder.ShapeConfig(mu=scene.friction))
    model = builder.finalize(device="cpu")
    model.soft_contact_ke, model.soft_contact_kd = CONTACT_STIFFNESS, CONTACT_DAMPING
    model.soft_contact_mu = scene.friction
    model.set_gravity(warp.vec3(0.0, 0.0, -GRAVITY))
    return model


def simulation(model: Any, solver: Any, scene: PeerScene, settings: str) -> Simulation:
    """The loop of substeps of a step."""
    import newton

    pipeline = newton.CollisionPipeline(model)
    contacts, control = pipeline.contacts(), model.control()
    states = [model.state(), model.state()]

    def step() -> None:
        for _ in range(SUBSTEPS):
            states[0].clear_forces()
            pipeline.collide(states[0], contacts)
            solver.step(states[0], states[1], control, contacts, scene.dt / SUBSTEPS)
            states.reverse()

    def positions() -> Any:
        return states[0].particle_q.numpy()  # the states change places

    def velocities() -> Any:
        return states[0].particle_qd.numpy()

    shown = f"{settings}, {SUBSTEPS} substeps of {scene.dt} s, CPU"
    return Simulation(step, positions, shown, velocities, model.particle_mass.numpy())
