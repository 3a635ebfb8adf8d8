"""MuJoCo 4 with its flag `ipc`: a flex of triangles, contact by an augmented Lagrangian with CCD."""

from typing import Any

from tests.benchmarks.peers.peer_scene import PeerScene, Simulation

PACKAGE, PIP = "mujoco", "mujoco>=4"
CANNOT = "no friction in contact of the flag `ipc`"
ITERATIONS = 400

_MODEL = """
<mujoco>
  <option timestep="{dt}" integrator="discrete" solver="CG" iterations="{iterations}"><flag ipc="enable"/></option>
  <worldbody>
    <geom type="sphere" size="{radius}"/>
    <flexcomp name="sheet" type="direct" dim="2" radius="{half_gap}" mass="{mass}"
              point="{points}" element="{elements}">
      <edge equality="false"/>
      <contact selfcollide="auto"/>
      <elasticity young="{young}" poisson="{poisson}" thickness="{thickness}" elastic2d="both" damping="0"/>
    </flexcomp>
  </worldbody>
</mujoco>
"""


def build(scene: PeerScene) -> Simulation:
    """The sheet as a flex of the same stiffness, thick by the gap, over a sphere."""
    import mujoco

    young, thickness = scene.shell
    model = mujoco.MjModel.from_xml_string(
        _MODEL.format(
            dt=scene.dt,
            iterations=ITERATIONS,
            radius=scene.radius,
            half_gap=scene.gap / 2,
            mass=scene.density,
            points=" ".join(f"{number:.9g}" for number in scene.positions.ravel()),
            elements=" ".join(map(str, scene.triangles.ravel())),
            young=young,
            poisson=scene.poisson,
            thickness=thickness,
        )
    )
    data = mujoco.MjData(model)

    limited = [0]

    def step() -> None:
        mujoco.mj_step(model, data)
        limited[0] += int(max(data.solver_niter) >= ITERATIONS)

    def positions() -> Any:
        mujoco.mj_kinematics(model, data)  # mj_step leaves the positions of the step before
        mujoco.mj_flex(model, data)
        return data.flexvert_xpos

    return Simulation(
        step,
        positions,
        f"dt {scene.dt} s, discrete integrator, CG, up to {ITERATIONS} iterations",
        lambda: data.qvel.reshape(-1, 3),
        model.body_mass[1:],
        lambda: f"{limited[0]} steps stop at {ITERATIONS} iterations",
    )
