"""Drape pulled to where its pictures show it, while friction is off.

Friction holds a garment where it came to lie: how high trousers sit on the hips, and which way a leg hangs. That comes
from how it was put on, which is not known, and no number of the pattern or fabric can correct it: a fit that may not
move the garment on the body pays with its fabric. So the cloth is moved by the displacement u that reduces the sum over
the pictures most, with a weak bound on u and on its differences between neighbours, in a few short steps of the scene
without friction: these keep contact and lengths. The run that follows has friction again, and ends at rest.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array, kron
from scipy.sparse.linalg import splu

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError
from clothsim.base.triangles import unique_edges
from clothsim.gradients.picture_loss import Residuals
from clothsim.gradients.run import traced
from clothsim.gradients.view_fit import Seen, ViewFit
from clothsim.keys.settings import Solver
from clothsim.scene import paths as keys_by_path
from clothsim.scene.scene import Scene

STEPS, STEP = 4, 0.01
"""Pulls, and the time that each takes [s]."""
PULL = 0.04
"""Largest displacement of a pull, and the standard deviation of displacements, over the size of the cloth."""
SMOOTHNESS = 4.0
"""Weight of the squared difference of two neighbours, over that of a displacement."""


def pulled(fit: ViewFit, seen: Seen) -> Seen:
    """Return the run from a drape that was pulled to its pictures, or the given one where that has the lower sum."""
    scene = fit.problem.scene_at(seen.at)
    if not seen.parts or not {"inertia", "friction"} <= scene.effects.keys():
        return seen
    short = frictionless_step(scene)
    try:
        begun = pulled_positions(fit, seen, short)
    except ClothsimError:  # a view loses sight of the cloth, or a step fails: the drape stays
        return seen
    found = fit.seen(seen.at, begun)
    return found if found.total < seen.total else seen


def pulled_positions(fit: ViewFit, seen: Seen, scene: Scene) -> Floats:
    """Return the positions (n, 3) [m] of least sum among STEPS pulls in a scene. ClothsimError where one fails."""
    held = {name: kappa for name, kappa in fit.problem.stiffness.items() if name in scene.effects}
    best, x, parts = seen.total, seen.positions, seen.parts
    least = x
    for _ in range(STEPS):
        velocity = pull_displacement(parts, x, fit.triangles) / STEP
        trace = traced(scene, held, 0, {"start": x, "velocity": velocity})
        x = trace.cloth_positions()
        parts = fit.residuals(x)
        total = fit.total(parts, seen.at)
        if total < best:
            best, least = total, x
    return least


def pull_displacement(parts: Sequence[Residuals], positions: Floats, triangles: Ints) -> Floats:
    """Return the displacement (n, 3) [m] of the vertices that reduces the sum of `Residuals` most, weakly bound.

    With their Jacobian J, weights W and residuals r it solves (J'WJ + B) u = -J'W r, and is scaled down to PULL.
    """
    n, size = len(positions), float(np.ptp(positions, axis=0).max())
    ends = unique_edges(triangles)
    entries = np.tile([1.0, -1.0], len(ends)), (np.repeat(np.arange(len(ends)), 2), ends.ravel())
    between = csr_array(coo_array(entries, shape=(len(ends), n)))
    bound = (eye_array(n) + SMOOTHNESS * (between.T @ between)) / (PULL * size) ** 2
    matrix, slope = kron(bound, eye_array(3)), np.zeros(3 * n)
    for each in parts:
        weighted = each.jacobian.multiply(each.curvatures[:, None])
        matrix = matrix + each.jacobian.T @ weighted
        slope += each.jacobian.T @ (each.weights * each.slopes)
    found = splu(matrix.tocsc()).solve(-slope).reshape(-1, 3)
    return np.asarray(found * min(1.0, PULL * size / max(float(np.linalg.norm(found, axis=1).max()), 1e-12)))


def frictionless_step(scene: Scene) -> Scene:
    """Return the scene for one step of STEP without friction."""
    for key, value in (("run.duration", STEP), ("run.frames_per_second", 1 / STEP), ("run.until", "time")):
        scene = keys_by_path.replace(scene, key, value)
    scene = replace(scene, effects={name: each for name, each in scene.effects.items() if name != "friction"})
    solver = {key: value for key, value in scene.solver.as_table().items() if key != "error"} | {"dt": STEP}
    return replace(scene, solver=Solver(**solver))
