"""A12, sheets run as scenes: point loads on a plate and a membrane, a strip on the bias, a deep beam that tips over."""

from collections.abc import Mapping
from functools import lru_cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from clothsim import Cloth, Scene, simulate
from clothsim.base.arrays import Floats
from clothsim.mesh.generators.shapes import disk, rectangle
from tests.known_answers.elastica import deep_beam
from tests.known_answers.row import ANY_ORDER, Outcome, Row
from tests.known_answers.scene_runs import AT_ONCE, ELASTIC, PAPER, WEIGHT, ended, on_meshes

RADIUS = 0.1
"""Of the discs [m]."""
IN_FOUR = {"dt": 0.25}
"""A solver section: the load in four steps."""


def disc_scene(
    cells: int, hub: float, height: float, effects: Mapping[str, Any], clamp: bool, **fabric: float
) -> Scene:
    """A disc held at its border whose vertices within `hub` RADIUS of its centre are lifted by `height` RADIUS."""
    points, _ = disk(RADIUS, cells)
    inner = np.flatnonzero(np.linalg.norm(points, axis=1) <= hub * RADIUS + 1e-9).tolist()
    lifted = {"select": inner, "motion": {"velocity": [0, 0, height * RADIUS]}}
    groups = [{"select": "boundary", "clamp": clamp}, lifted]
    cloth = {"mesh": "disk", "radius": RADIUS, "cells": cells, **PAPER, **fabric}
    return Scene(cloth=cloth, effects={**effects, "pins": {"group": groups}}, run=AT_ONCE, solver=IN_FOUR)


def _plate() -> Outcome:
    """w = P a^2/(16 pi D) under a point load (Timoshenko & Woinowsky-Krieger 1959, art. 19)."""
    height, stiffness, modulus = 1e-3, 1e-3, 100.0

    def deflection(cells: int) -> float:
        fabric = {"poisson_ratio": 0.3, "youngs_modulus": modulus / PAPER["thickness"], "bending_stiffness": stiffness}
        run = ended(disc_scene(cells, 0.0, height, ELASTIC, True, **fabric))
        return float(height * RADIUS * stiffness / (run.pins["pins.group[1]"][2] * RADIUS**2))

    return on_meshes(deflection, (8, 16, 32), 1 / (16 * np.pi), 1e-2, (1.6, 2.5))


HUB, LIFT, SCHWERIN_NU = 1 / 8, 0.01, 1 / 3


def schwerin(lift: float, hub: float) -> float:
    """P/(E2 a) of a clamped membrane whose stiff hub of radius `hub` a is lifted by `lift` a, nu = 1/3.

    w = K (1 - (r/a)^(2/3)), with P = pi/3 E2 K^3/a^2 (Schwerin 1929, Z. tech. Phys. 10): at this nu no point of the
    membrane moves along its radius, so that a hub changes nothing outside of it.
    """
    return float(np.pi / 3 * (lift / (1 - hub ** (2 / 3))) ** 3)


def _membrane() -> Outcome:
    """At a lift of a hundredth what a large deflection adds is .02 % (1.7 lift^2, measured)."""
    modulus = 1000.0

    def force(cells: int) -> float:
        fabric = {"poisson_ratio": SCHWERIN_NU, "youngs_modulus": modulus / PAPER["thickness"]}
        run = ended(disc_scene(cells, HUB, LIFT, {"membrane": {}}, False, **fabric))
        return float(run.pins["pins.group[1]"][2] / (modulus * RADIUS) / schwerin(LIFT, HUB))

    return on_meshes(force, (8, 16, 32), 1.0, 5e-3, (1.5, 2.5))


# --- a strip cut on the bias ----------------------------------------------------------------------------------------

WARP, SHEAR = 5000.0, 100.0
"""Stiffness of warp and weft, and in shear [N/m]."""
PULL, BIAS_LENGTH = 1e-3, 0.2
"""Strain of the strip; its length [m]."""


def bias_stiffness() -> Floats:
    """Stiffness of that cloth at 45 degrees to its threads, for eps_x, eps_y, gamma_xy (3, 3) [N/m]."""
    turned = np.array([[0.5, 0.5, 0.5], [0.5, 0.5, -0.5], [-1.0, 1.0, 0.0]])
    return turned.T @ np.diag([WARP, WARP, SHEAR]) @ turned


def pulled_elastic(cells: int, width: float, stiffness: Floats) -> float:
    """Force a width and strain of a sheet 1 x width whose ends are drawn apart: scikit-fem, P2, small strains."""
    import skfem as fem
    from skfem.helpers import sym_grad

    mesh = fem.MeshTri.init_tensor(np.linspace(0, 1, cells + 1), np.linspace(0, width, round(cells * width) + 1))
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementTriP2()))

    @fem.BilinearForm
    def form(u: Any, v: Any, _: Any) -> Any:
        u, v = ([e[0, 0], e[1, 1], 2 * e[0, 1]] for e in (sym_grad(u), sym_grad(v)))
        return sum(stiffness[i, j] * u[i] * v[j] for i in range(3) for j in range(3))

    matrix, x = form.assemble(basis), basis.zeros()
    left, right = (basis.get_dofs(lambda p, end=end: np.abs(p[0] - end) < 1e-9) for end in (0.0, 1.0))
    x[right.all(["u^1"])] = 1.0
    x = fem.solve(*fem.condense(matrix, x=x, D=np.concatenate([left.all(), right.all()])))
    return float(x @ (matrix @ x) / width)


@lru_cache
def bias_modulus(width: float, cells: int = 32) -> float:
    """That of the bias strip, extrapolated from three meshes (Aitken): the corners of the clamps are singular."""
    first, second, third = (pulled_elastic(cells * 2**k, width, bias_stiffness()) for k in range(3))
    return float(third - (third - second) ** 2 / (third - 2 * second + first))


def _bias(width: float) -> Outcome:
    """Held flat by a large bending stiffness: by its own it would wrinkle."""

    def modulus(cells: int) -> float:
        fabric = {"density": 0.15, "warp_stiffness": WARP, "weft_stiffness": WARP, "shear_stiffness": SHEAR}
        fabric |= {"thread_poisson_ratio": 0.0, "bending_stiffness": 1e-2}
        size, count = [BIAS_LENGTH, width * BIAS_LENGTH], [cells, round(cells * width)]
        pulled = {"select": "right", "motion": {"velocity": [PULL * BIAS_LENGTH, 0, 0]}}
        effects = {"membrane": {"angle_degrees": 45.0}, "bending": {}, "pins": {"group": [{"select": "left"}, pulled]}}
        cloth = {"mesh": "rectangle", "size": size, "cells": count, **fabric}
        run = ended(Scene(cloth=cloth, effects=effects, run=AT_ONCE, solver={"dt": 1.0}))
        return float(run.pins["pins.group[1]"][0] / (width * BIAS_LENGTH * PULL))

    return on_meshes(modulus, (32, 64, 128), bias_modulus(width), 1e-2, (0.7, 2.0))


# --- a deep beam tips over ------------------------------------------------------------------------------------------

LENGTH, STIFF = 0.2, 1e9
"""Length of the beam [m]; Young's modulus: one that sags in its plane buckles later, by 2 % with that of PAPER."""
LOADS = 1.1, 1.15
"""Weights, over the critical one of a beam of no width, at which the growth of the flat state is read."""


def deep_beam_scene(load: float, width: float, across: int, **solver: Any) -> Scene:
    """A cantilever in its own plane, `width` LENGTH high, with `load` of its critical weight."""
    stiffness = WEIGHT * LENGTH**3 / (load * deep_beam(0.0))
    size, count = [LENGTH, width * LENGTH], [round(across / (2 * width)), across]
    cloth = {"mesh": "rectangle", "size": size, "cells": count, "rotation_degrees": [90, 0, 0], **PAPER}
    effects = {**ELASTIC, "gravity": {}, "pins": {"select": "left", "clamp": True}}
    return Scene(
        cloth={**cloth, "bending_stiffness": stiffness, "youngs_modulus": STIFF},
        effects=effects,
        run=AT_ONCE,
        solver={"dt": 0.5, **solver},
    )


def growth_of(scene: Scene) -> float:
    """Square of the growth rate of the unstable state that a run keeps [1/s2], as its certificate says."""
    with TemporaryDirectory() as folder:
        run = simulate(scene, Path(folder) / "run")
        return float(run.summary["certificate"]["unstable_equilibria"]["growth_rate"] ** 2)


@lru_cache
def tipping(width: float, across: int) -> float:
    """Critical weight over that of a beam of no width, where the growth vanishes, which is linear in the load."""
    first, second = (growth_of(deep_beam_scene(load, width, across, unstable_equilibrium="keep")) for load in LOADS)
    return float(LOADS[0] - first * (LOADS[1] - LOADS[0]) / (second - first))


def _deep_beam() -> Outcome:
    """Of two widths, extrapolated to none: what the clamp adds is proportional to the width (A3t).

    What is left of it, the square of the width, hides the order of the mesh.
    """

    def gamma(across: int) -> float:
        return 12.853763 * (2 * tipping(0.05, across) - tipping(0.1, across))

    return on_meshes(gamma, (4, 8, 16), deep_beam(0.0) / np.sqrt(2), 5e-3, ANY_ORDER, printed="12.853763")


# --- wrinkles of a stretched sheet ----------------------------------------------------------------------------------

SPAN, WAVE, WAVES, TENSION, NARROWED = 0.2, 0.05, 8, 60.0, 6e-4
"""Length of the sheet, wavelength by theory [m]; waves across; tension [N/m]; part by which the ends are narrowed.

It is twice the critical one: far beyond that shorter waves grow first, and stay.
"""


def wavelength(cells: int) -> float:
    """Wavelength at half of its length, over WAVE, of a stretched sheet whose ends are narrowed; cells: of a wave.

    lambda = 2 pi^(1/2) (B/T)^(1/4) L^(1/2) (Cerda & Mahadevan 2003, Phys. Rev. Lett. 90, 074302): with sin(pi x/L) the
    compression B k^2 + T (pi/L)^2/k^2 that a wave k takes is least for k^4 = T (pi/L)^2/B.
    """
    stiffness = TENSION * (WAVE / (2 * np.sqrt(np.pi))) ** 4 / SPAN**2
    flat, triangles = rectangle((SPAN, WAVES * WAVE), (2 * cells, WAVES * cells), "alternating")
    stretched = 1 + TENSION / (PAPER["youngs_modulus"] * PAPER["thickness"])
    start = flat * [stretched, 1 - NARROWED, 1.0]
    ends = np.flatnonzero(np.abs(flat[:, 0]) > SPAN / 2 - 1e-9)
    start[:, 2] = 1e-5 * np.random.default_rng(0).standard_normal(len(flat))
    start[ends, 2] = 0.0
    cloth = Cloth(start, triangles, rest=flat[:, :2], **{**PAPER, "bending_stiffness": stiffness})
    effects = {**ELASTIC, "pins": {"select": ends.tolist()}}
    run = ended(Scene(cloth=cloth, effects=effects, run=AT_ONCE, solver={"dt": 1.0}))
    middle = np.flatnonzero(np.abs(flat[:, 0]) < 1e-9)
    middle = middle[np.argsort(flat[middle, 1])]
    y, z = flat[middle, 1], run.last[middle, 2]
    before = np.flatnonzero(z[:-1] * z[1:] < 0)
    zeros = y[before] - z[before] * (y[before + 1] - y[before]) / (z[before + 1] - z[before])
    inner = zeros[np.abs(zeros) < 0.375 * WAVES * WAVE]
    return float(2 * np.diff(inner).mean() / WAVE)


def _wrinkles() -> Outcome:
    """The bar is half a wave more or less on the sheet, whose number of waves is a whole one."""
    return on_meshes(wavelength, (8, 12, 16), 1.0, 0.5 / WAVES, ANY_ORDER)


ROWS = (
    Row("A12a", "clamped plate, point load, nu = 0.3: w D/(P a^2)", _plate),
    Row("A12b", "clamped membrane, load on a hub of radius a/8, nu = 1/3: P / P of Schwerin", _membrane),
    Row("A12c", "strip cut on the bias, width / length = 0.25: force / (width strain) [N/m]", partial(_bias, 0.25)),
    Row("A12d", "the same, width / length = 0.5", partial(_bias, 0.5)),
    Row("A12e", "the same, width / length = 1", partial(_bias, 1.0)),
    Row("A12f", "deep beam that tips over: Gamma / sqrt(2/(1 + nu))", _deep_beam),
    Row("A12g", "wrinkles of a stretched sheet: wavelength / that of Cerda and Mahadevan", _wrinkles),
)
