"""Newton's vertex block descent (SolverVBD) on the CPU."""

from tests.benchmarks.peers import newton_sheet
from tests.benchmarks.peers.peer_scene import PeerScene, Simulation

PACKAGE, PIP = "newton", "newton"
CANNOT = "a fixed number of iterations: no tolerance"
ITERATIONS = 10


def build(scene: PeerScene) -> Simulation:
    """The sheet as triangles with the same Lame parameters and hinges, with self contact at the gap."""
    import newton
    import warp

    mu, lam = scene.lame
    edge = 1.0 / scene.cells
    builder = newton.ModelBuilder()
    builder.add_cloth_mesh(
        pos=warp.vec3(0.0),
        rot=warp.quat_identity(),
        scale=1.0,
        vel=warp.vec3(0.0),
        vertices=[warp.vec3(*point) for point in scene.positions],
        indices=scene.triangles.ravel().tolist(),
        density=scene.density,
        tri_ke=mu,
        tri_ka=lam,
        tri_kd=0.0,
        edge_ke=3.0 * scene.bending / edge,  # its hinge: k L angle^2 / 2
        edge_kd=0.0,
        particle_radius=scene.gap,
    )
    builder.color(include_bending=True)
    model = newton_sheet.finished(builder, scene)
    solver = newton.solvers.SolverVBD(
        model,
        iterations=ITERATIONS,
        particle_enable_self_contact=True,
        particle_self_contact_margin=scene.gap,
        particle_self_contact_gap=scene.gap / 2,
    )
    return newton_sheet.simulation(model, solver, scene, f"{ITERATIONS} iterations a substep, self contact")
