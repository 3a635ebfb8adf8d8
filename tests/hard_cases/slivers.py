"""Sheets with slivers: the patch test of docs/results/validation.md, A1 must hold on them as on any other mesh."""

from collections.abc import Mapping

import numpy as np
from scipy.optimize import brentq

from clothsim.base.arrays import Floats, Ints
from clothsim.files.meshes.readers.obj import obj_text
from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients
from clothsim.geometry.kinematics.stretch import principal_stretches
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.generators.shapes import rectangle
from clothsim.run.results import Run
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from tests.hard_cases.case import MOST_NEWTON, Case, scene_of

STRETCH, LAM = 1.5, 1.5
"""Uniaxial stretch l1, and lam [N/m] for mu = 1 N/m: the figures of docs/results/validation.md, A1."""
CLOSE = 1e-8
TURN = rotation_matrix(np.array([0.4, -1.1, 0.7]))


def sheet(aspect: float, kinds: tuple[str, ...]) -> tuple[Floats, Floats, Ints]:
    """A square metre in which two triangles inside were cut in three: at rest, bent (n, 3) [m], and its triangles.

    A cap: by a point off the middle of an edge by a fraction 1/aspect; a needle: by a point so close to a corner. Bent:
    the corners of the grid are moved by up to .1 m, and such a point goes with the triangle that it lies in.
    """
    rest, triangles = rectangle((1.0, 1.0), (5, 5), "right")
    inside = np.flatnonzero((np.abs(rest[triangles]) < 0.49).all(axis=(1, 2)))
    bent = stretched(rest) + 0.1 * np.cos(np.pi * rest[:, :1]) * np.cos(np.pi * rest[:, 1:2])
    for kind, number in zip(kinds, inside[[0, -1]], strict=False):
        a, b, c = triangles[number]
        along = 0.5 if kind == "cap" else 1 / aspect
        rest, bent = (np.vstack([x, x[a] + along * (x[b] - x[a]) + (x[c] - x[a]) / aspect]) for x in (rest, bent))
        k = len(rest) - 1
        triangles = np.vstack([np.delete(triangles, number, axis=0), [[a, b, k], [b, c, k], [c, a, k]]])
    return rest, bent, triangles


def narrowing() -> float:
    """l2 of uniaxial tension: P2 = mu (l2 - 1/l2) + lam ln(l1 l2)/l2 = 0."""
    return float(brentq(lambda s: s - 1 / s + LAM * np.log(STRETCH * s) / s, 0.5, 1.0, xtol=1e-15))


def tension() -> float:
    """P1 = mu (l1 - 1/l1) + lam ln(l1 l2)/l1 [N/m]."""
    return STRETCH - 1 / STRETCH + LAM * np.log(STRETCH * narrowing()) / STRETCH


def stretched(rest: Floats) -> Floats:
    """The affine image (n, 3) [m], turned in space."""
    return rest * (STRETCH, narrowing(), 1.0) @ TURN.T


def files(aspect: float, kinds: tuple[str, ...]) -> Mapping[str, str]:
    """The sheet at rest, and its start: the border in its place, the inside bent out of it."""
    rest, bent, triangles = sheet(aspect, kinds)
    return {"sheet.obj": obj_text(rest, triangles), "bent.obj": obj_text(bent, triangles)}


def patch(small: bool) -> Scene:
    """The border held, nothing else: one equilibrium."""
    mu, lam = 1.0, LAM
    thickness, stiffness = 1e-3, 4 * mu * (lam + mu) / (lam + 2 * mu)
    return Scene(
        cloth={
            "mesh": "sheet.obj",
            "thickness": thickness,
            "youngs_modulus": stiffness / thickness,
            "poisson_ratio": lam / (lam + 2 * mu),
        },
        effects={"membrane": {}, "pins": {"select": "boundary"}},
        solver={"dt": 1.0, "tolerance": 1e-12, "max_iterations": MOST_NEWTON},
        run={"duration": 1.0, "frames_per_second": 1.0},
        seed={"from": "file", "file": "bent.obj"},
    )


def patch_holds(run: Run) -> str:
    """Every vertex in its affine place, every triangle at l1, l2, and the border pulls with P1 a metre."""
    built = build(scene_of(run))
    world, x = built.world, run.positions(-1)
    rest = world.cloths[0].rest_positions
    off = float(np.abs(x - stretched(rest)).max())
    F = deformation_gradients(x, world.triangles, world.rest_shape_inverses)
    strain = float(np.abs(principal_stretches(F) - (STRETCH, narrowing())).max())
    forces = built.energies["membrane"].gradient(x) @ TURN
    pull = float(forces[rest[:, 0] > 0.5 - 1e-9].sum(axis=0)[0])
    inner = float(np.abs(forces[(np.abs(rest) < 0.49).all(axis=1)]).max())
    faults = {
        f"a vertex is {off:.2g} m off the affine map": off > CLOSE,
        f"a principal stretch is {strain:.2g} off": strain > CLOSE,
        f"the border pulls with {pull:.10g} N, not {tension():.10g} N": abs(pull - tension()) > CLOSE,
        f"a force of {inner:.2g} N is left inside": inner > CLOSE,
    }
    return next((fault for fault, there in faults.items() if there), "")


def case(name: str, title: str, aspect: float, *kinds: str) -> Case:
    """The patch test of a sheet with slivers of such an aspect."""
    return Case(name, title, patch, patch_holds, files=lambda small: files(aspect, kinds))


CASES = (
    *(
        case(f"B16{letter}", f"patch test with slivers of aspect ratio 1e{power}", 10.0**power, "cap", "needle")
        for letter, power in zip("abcd", range(2, 6), strict=True)
    ),
    case("B16e", "patch test with a cap of aspect ratio 1e7", 1e7, "cap"),
    case("B16f", "patch test with a needle of aspect ratio 1e7", 1e7, "needle"),
)
