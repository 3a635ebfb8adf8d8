"""Drape pulled to where its pictures show it, while friction is off.

Friction holds a garment where it came to lie: how high trousers sit on the hips, and which way a leg hangs. That comes
from how it was put on, which is not known, and no number of the pattern or fabric can correct it: a fit that may not
move the garment on the body pays with its fabric. So the cloth is moved by its most probable displacement
(`placed_drape`), in a few short steps of the scene without friction: these keep contact and lengths. The run that
follows has friction again, and ends at rest.
"""

from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from clothsim.gradients.placed_drape import PlacedDrape, precision_of_displacements
from clothsim.gradients.run import traced
from clothsim.gradients.view_fit import Seen, ViewFit
from clothsim.keys.settings import Solver
from clothsim.scene import paths as keys_by_path
from clothsim.scene.scene import Scene

STEPS, STEP = 4, 0.01
"""Pulls, and the time that each takes [s]."""
PULL = 0.04
"""Largest displacement of a pull, over the size of the cloth."""


def pulled(fit: ViewFit, seen: Seen) -> Seen:
    """Return the run from a drape that was pulled to its pictures, or the given one where that has the lower sum."""
    scene = fit.scene_at(seen.at)
    if not seen.parts or not fit.held:
        return seen
    short = frictionless_step(scene)
    try:
        begun = pulled_positions(fit, seen, short)
    except ClothsimError:  # a view loses sight of the cloth, or a step fails: the drape stays
        return seen
    found = fit.seen(seen.at, begun)
    return found if found.parts and fit.total(found.parts, found.at) < fit.total(seen.parts, seen.at) else seen


def pulled_positions(fit: ViewFit, seen: Seen, scene: Scene) -> Floats:
    """Return the positions (n, 3) [m] of least sum among STEPS pulls in a scene. ClothsimError where one fails."""
    held = {name: kappa for name, kappa in fit.problem.stiffness.items() if name in scene.effects}
    x, parts = seen.positions, seen.parts
    best, least, farthest = fit.total(parts, seen.at), x, PULL * float(np.ptp(x, axis=0).max())
    for _ in range(STEPS):
        moved = PlacedDrape.of(parts, precision_of_displacements(x, fit.triangles)).displacement.reshape(-1, 3)
        longest = float(np.linalg.norm(moved, axis=1).max())
        velocity = moved * min(1.0, farthest / max(longest, 1e-12)) / STEP
        trace = traced(scene, held, 0, {"start": x, "velocity": velocity})
        x = trace.cloth_positions()
        parts = fit.residuals(x)
        total = fit.total(parts, seen.at)
        if total < best:
            best, least = total, x
    return least


def frictionless_step(scene: Scene) -> Scene:
    """Return the scene for one step of STEP without friction."""
    for key, value in (("run.duration", STEP), ("run.frames_per_second", 1 / STEP), ("run.until", "time")):
        scene = keys_by_path.replace(scene, key, value)
    scene = replace(scene, effects={name: each for name, each in scene.effects.items() if name != "friction"})
    solver = {key: value for key, value in scene.solver.as_table().items() if key != "error"} | {"dt": STEP}
    return replace(scene, solver=Solver(**solver))
