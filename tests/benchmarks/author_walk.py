"""A shirt on a walking body whose clip is authored: the scene of `tests.benchmarks.author --walk`, and its edits."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

import clothsim
from clothsim import Scene
from clothsim.base.arrays import Floats
from clothsim.garments.floor import scene_of_arrays

YOUNG, BENDING = 8.21e5, 9.2e-6
"""Of the shirt, cotton [Pa], [N m]."""
HEM, SHOULDERS, FRONT = 0.84, 1.484, -0.132
"""Heights of the lower and the upper end of the shirt at rest, and y of its front [m]."""


@dataclass(frozen=True)
class WalkingShirt:
    """A shirt on the mannequin, which walks: edge of the mesh [m], duration [s], frames that are keys."""

    edge: float = 0.04
    duration: float = 1.04
    keys: tuple[int, ...] = (17, 35)

    def scene(self, stiffer: float = 1.0, draped: bool = True) -> Scene:
        """The shirt and the mannequin; stiffer: factor on the fabric; draped: it begins as it hangs on the body."""
        shirt = {
            "name": "shirt",
            "mesh": "shirt",
            "ease": 0.022,
            "edge": self.edge,
            "density": 0.15,
            "youngs_modulus": stiffer * YOUNG,
            "bending_stiffness": stiffer * BENDING,
        }
        motion = {"clip": "walk", "loop": True, "lead_in": 0.3}
        effects = {name: {} for name in ("inertia", "membrane", "bending", "gravity", "body_contact", "self_contact")}
        effects |= {"damping": {"rate": 3.0}, "friction": {"coefficient": 0.3}}
        solver = {"dt": 0.02, "threads": 1, "tolerance": 1e-4}
        body = {"name": "mannequin", "model": "mannequin", "motion": motion}
        run = {"duration": self.duration, "frames_per_second": 50}
        scene = Scene(shirt, body, effects, solver, contact={"pinch": "carry"}, run=run)
        return scene_of_arrays(scene, starts=[_draped(self)]) if draped else scene

    def longer_hem(self) -> Scene:
        """The rest shape 5 % wider at the hem, the change within its lowest quarter."""
        scene = self.scene()
        arrays = scene.cloths[0].mesh
        rest, quarter = arrays.rest.copy(), (SHOULDERS - HEM) / 4
        rest[:, :2] *= 1 + 0.05 * np.clip((HEM + quarter - rest[:, 2:]) / quarter, 0, 1)
        return replace(scene, cloth=[{**scene.cloths[0], "mesh": replace(arrays, rest=rest)}])

    def pleat(self) -> Scene:
        """Two creases of the front from the hem to half its height."""
        scene = self.scene()
        lines = [((2 * k - 1) * self.edge, angle) for k, angle in enumerate((100.0, -100.0))]
        up = HEM + 0.5 * (SHOULDERS - HEM)
        creases = [{"through": [[x, FRONT, HEM], [x, FRONT, up]], "angle_degrees": angle} for x, angle in lines]
        return replace(scene, effects={**scene.effects, "rest_angle": {"crease": creases}})


@cache
def _draped(clip: WalkingShirt) -> Floats:
    """The shirt after 0.6 s on the body that stands, (n, 3) [m]."""
    scene = clip.scene(draped=False)
    effects = {**scene.effects, "damping": {"rate": 10.0}}
    body = [{"name": "mannequin", "model": "mannequin"}]
    stands = replace(scene, body=body, effects=effects, run={"duration": 0.6, "frames_per_second": 50})
    return clothsim.simulate(stands).positions(-1)
