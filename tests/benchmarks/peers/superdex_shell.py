"""SuperDex Physics: its experimental shell, implicit steps, compliant contact by penalties."""

from tests.benchmarks.peers.peer_scene import PeerScene, Simulation

PACKAGE, PIP = "superdex-physics", "superdex-physics (Python 3.12)"
CANNOT = "compliant contact: penalties let surfaces overlap; self contact between points of the sheet"
ITERATIONS = 10


def build(scene: PeerScene) -> Simulation:
    """The sheet as a shell of the same stiffness above a static sphere."""
    import numpy as np
    from superdex import physics

    if not physics.is_initialized():
        physics.initialize(num_worker_threads=0)
    real = np.float64 if physics.uses_double_precision() else np.float32
    world = physics.create_scene("sheet and ball")
    world.set_gravity([0.0, 0.0, -9.81])
    solver = world.get_solver_params()
    solver.integration_method = physics.IntegrationMethod.BACKWARD_EULER
    solver.non_linear_solver.max_iter = ITERATIONS
    world.set_solver_params(solver)
    young, thickness = scene.shell
    sheet = physics.experimental.ShellActorParams()
    sheet.name = "sheet"
    sheet.shape = physics.create_tri_mesh_shape(
        scene.positions.ravel().astype(real), scene.triangles.ravel().astype(np.int32)
    )
    sheet.material = physics.experimental.shell_material_params_from3d_isotropic(
        young, scene.poisson, scene.density / thickness, thickness
    )
    sheet.contact.penalty_threshold_default = scene.gap
    sheet.contact.penalty_smoothing_half_distance = scene.gap / 4
    sheet.contact.coulomb_friction_coefficient = scene.friction
    sheet.point_cloud_collider.radius = 0.5 / scene.cells
    sheet.point_cloud_collider.self_contact = True
    actor = physics.experimental.create_shell_actor(world, sheet)
    actor.register_query(physics.QueryType.NODE_POSITIONS)
    ball = physics.create_sphere_shape([0.0, 0.0, 0.0], scene.radius)
    world.create_rigid_actor(physics.RigidActorParams(name="ball", is_static=True, shape=ball))
    world.step(0.0)

    def step() -> None:
        world.step(scene.dt)

    def positions() -> np.ndarray:
        return np.asarray(actor.get_node_positions_local()).reshape(-1, 3)

    precision = "double" if real is np.float64 else "single"
    settings = f"dt {scene.dt} s, backward Euler, up to {ITERATIONS} iterations, {precision} precision, one thread"
    return Simulation(step, positions, settings)
