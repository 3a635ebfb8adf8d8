"""Newton's Style3D solver (projective dynamics) on the CPU."""

from tests.benchmarks.peers import newton_sheet
from tests.benchmarks.peers.peer_scene import PeerScene, Simulation

PACKAGE, PIP = "newton", "newton"
CANNOT = "a fixed number of iterations: no tolerance; self contact at 3 mm, its own"
ITERATIONS = 4


def build(scene: PeerScene) -> Simulation:
    """The sheet with the same stiffness along warp, weft and in shear."""
    import newton
    import warp
    from newton.solvers import style3d

    mu, _ = scene.lame
    builder = newton.ModelBuilder()
    newton.solvers.SolverStyle3D.register_custom_attributes(builder)
    style3d.add_cloth_mesh(
        builder,
        pos=warp.vec3(0.0),
        rot=warp.quat_identity(),
        vel=warp.vec3(0.0),
        vertices=[warp.vec3(*point) for point in scene.positions],
        indices=scene.triangles.ravel().tolist(),
        density=scene.density,
        tri_aniso_ke=warp.vec3(scene.stretch, scene.stretch, mu),
        edge_aniso_ke=warp.vec3(scene.bending),
        particle_radius=scene.gap,
    )
    model = newton_sheet.finished(builder, scene)
    config = newton.solvers.SolverStyle3D.Config(iterations=ITERATIONS)
    solver = newton.solvers.SolverStyle3D(model, config=config)
    return newton_sheet.simulation(model, solver, scene, f"{ITERATIONS} iterations a substep")
