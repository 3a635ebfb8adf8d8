"""A shirt on a walking body whose clip is authored: the scene of `tests.benchmarks.author --walk`, and its edits."""

from dataclasses import dataclass, replace

import numpy as np

from clothsim import Scene
from clothsim.garments.authoring.arrays import scene_of_arrays

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

    def scene(self, stiffer: float = 1.0) -> Scene:
        """The shirt and the mannequin; stiffer: factor on the fabric."""
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
        return Scene(
            shirt,
            {"name": "mannequin", "model": "mannequin", "motion": motion},
            effects,
            solver,
            contact={"pinch": "carry"},
            run={"duration": self.duration, "frames_per_second": 50},
        )

    def longer_hem(self) -> Scene:
        """The rest shape 5 % wider at the hem, the change within its lowest quarter."""
        scene = scene_of_arrays(self.scene())
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
