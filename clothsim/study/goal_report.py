"""Goal of a study: its difference between the scene and the finest run, by triangles, in numbers and a picture."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim import Loss, Scene
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.engine import World
from clothsim.gradients import StateAtRest
from clothsim.study.evaluation import Gatherer, at_points_of, nearest_weights, world_material
from clothsim.study.pictures import draw_goal
from clothsim.study.points import BASE, Bench, point

# Goal-oriented error: the triangles that make the error of one number of a drape at rest.
#
# The goal J is a function of the positions, such as the height of a hem. The run on the mesh h ends at x_h, a
# minimum of
# E_h; that on the finer mesh, of which each vertex of h is a vertex, at x_f, a minimum of E_f. With R x_f its positions
# at the vertices of h, j the derivative of J, H that of G_h = dE_h/dx, both means over the two states, and the adjoint
#
#     H lambda = j on the free rows:    J(R x_f) - J(x_h) = lambda . G_h(R x_f) + O(|R x_f - x_h|^3),
#
# as G_h(x_h) = 0: the dual-weighted residual (Becker & Rannacher 2001) of the finer solution on h. As G_f(x_f) = 0 too,
#
#     J(R x_f) - J(x_h) = sum over elements of h of lambda . g_e(R x_f) - sum over elements of the finer mesh of
#                         (P lambda) . g_e(x_f),
#
# with P the linear interpolation in the material. Both sums have one term for each piece of cloth, and their difference
# there is what the coarse elements get wrong (the relative truncation error of multigrid, Brandt 1977, weighted as by
# Venditti & Darmofal 2002). Without the second sum the forces between neighbours, which cancel, hide it. What
# the solves
# left of G_h(x_h) and G_f(x_f) is subtracted vertex by vertex: it is not an error of the mesh.

Goal = Callable[[World], Loss]
"""Makes the loss of a scene's world."""
EFFECTIVE = 0.5, 2.0
"""Estimated over true difference, between which the triangles are believed."""


@dataclass(frozen=True)
class GoalError:
    """Difference of a goal between a run and a finer one, by vertices and triangles.

    Parameters
    ----------
    coarse, fine : float
        J(x_h) and J(R x_f).
    by_vertex : (n,) float64
        Parts of the estimate of J(R x_f) - J(x_h), signed.
    positions : (n, 3) float64
        x_h of all cloths [m].
    triangles : (m, 3) int64
        Of all cloths.
    areas : (m,) float64
        Of the triangles at rest [m2].
    """

    coarse: float
    fine: float
    by_vertex: Floats
    positions: Floats
    triangles: Ints
    areas: Floats

    @property
    def true(self) -> float:
        """J(R x_f) - J(x_h)."""
        return self.fine - self.coarse

    @property
    def estimated(self) -> float:
        """The sum of all parts."""
        return float(self.by_vertex.sum())

    @property
    def effectivity(self) -> float:
        """Estimated over true difference; nan where there is none."""
        return self.estimated / self.true if self.true else float("nan")

    @property
    def by_triangle(self) -> Floats:
        """|eta_K| (m,): each vertex's part shared among its triangles by their areas."""
        around = np.bincount(self.triangles.ravel(), np.repeat(self.areas, 3), len(self.by_vertex))
        density = np.where(around > 0.0, self.by_vertex / np.where(around > 0.0, around, 1.0), 0.0)
        return np.abs(density[self.triangles].sum(axis=1) * self.areas)

    def area_of(self, fraction: float) -> float:
        """Return the smallest fraction of the area whose triangles make `fraction` of the sum of |eta_K|."""
        eta = self.by_triangle
        order = np.argsort(-eta / self.areas)
        count = int(np.searchsorted(np.cumsum(eta[order]), fraction * eta.sum())) + 1
        return float(self.areas[order[:count]].sum() / self.areas.sum())


def goal_error(scene: Scene, positions: Floats, finer: Scene, finer_positions: Floats, goal: Goal) -> GoalError:
    """Attribute the difference of a goal between two meshes to the triangles of the coarser one.

    Parameters
    ----------
    scene, finer : Scene
        Quasi-static; each vertex of `scene` is a vertex of `finer`.
    positions, finer_positions : (n, 3), (k, 3) float64
        Where their runs ended [m].
    goal : callable
        Makes the loss of the coarser world.

    Returns
    -------
    GoalError

    Raises
    ------
    InputError
        For a scene that `StateAtRest.refuse_history` refuses, and for runs that end in different shapes.

    Examples
    --------
    The hem of a sheet that hangs from an edge: the estimate is the difference.

    >>> import clothsim
    >>> from clothsim.gradients.losses import hem_loss
    >>> def scene(cells):
    ...     cloth = {"mesh": "rectangle", "size": [0.1, 0.2], "cells": cells, "rotation_degrees": [90, 0, 0]}
    ...     effects = [clothsim.Membrane(), clothsim.Bending(), clothsim.Gravity(), clothsim.Pins(select="top")]
    ...     run = {"duration": 0.2, "frames_per_second": 25}
    ...     return clothsim.Scene(cloth | {"youngs_modulus": 2e4}, effects=effects, run=run)
    >>> coarse, fine = scene([2, 4]), scene([4, 8])
    >>> ends = [clothsim.simulate(each).positions(-1) for each in (coarse, fine)]
    >>> found = goal_error(coarse, ends[0], fine, ends[1], hem_loss)
    >>> round(found.effectivity, 2)
    1.0
    """
    coarse, fine = StateAtRest.of_scene(scene, positions), StateAtRest.of_scene(finer, finer_positions)
    sampled = at_points_of(world_material(coarse.world), world_material(fine.world), finer_positions)
    loss, triangles = goal(coarse.world), coarse.world.triangles
    states = coarse.x, coarse.with_cloth(sampled)
    if not np.isfinite(coarse.potential.value(states[1])):
        raise InputError(
            "The finer solution, on the coarse mesh, goes through a body or the cloth: no error by triangles.",
            "Use finer cells, or a larger d_hat.",
        )
    values, slopes = zip(*(loss.evaluate(each, triangles) for each in (positions, sampled)), strict=True)
    forces = np.zeros_like(coarse.x)
    forces[: len(positions)] = 0.5 * (slopes[0] + slopes[1])
    adjoint = coarse.adjoint(states, forces)
    if adjoint is None:
        raise InputError(
            "The two meshes end in different folds, or not at rest: no error by triangles.",
            "Use finer cells, or a smaller dt.",
        )
    by_vertex = coarse.powers(states[1], adjoint, len(positions)) - coarse.unfinished(adjoint)
    # less the powers of the finer elements with the interpolated adjoint, taken to the coarse vertices by its weights
    world, out = coarse.world, np.zeros(coarse.world.n_cloth)
    interpolated, corners, weights = np.zeros_like(fine.x), list[Ints](), list[Floats]()
    first = 0
    for points, cloth in zip(world_material(fine.world).rest, world.cloths, strict=True):
        nearest, own = nearest_weights(points, cloth.rest_positions, cloth.triangles)
        corners.append(cloth.triangles[nearest] + first)
        weights.append(own)
        first += len(cloth.rest_positions)
    rows, coordinates = np.concatenate(corners), np.concatenate(weights)
    interpolated[: len(rows)] = np.einsum("ij,ijk->ik", coordinates, adjoint[rows])
    interpolated[fine.fixed] = 0.0
    parts = fine.powers(fine.x, interpolated, len(rows)) - fine.unfinished(interpolated)
    np.add.at(out, rows.ravel(), (coordinates * parts[:, None]).ravel())
    by_vertex -= out
    return GoalError(values[0], values[1], by_vertex, positions, triangles, coarse.world.rest_areas)


PICTURE_NAME, ARRAYS_NAME = "goal.png", "goal.npz"


@dataclass(frozen=True)
class NamedGoal:
    """A goal of a study.

    Parameters
    ----------
    name : str
        For the reports, as "hem".
    loss : callable
        Makes it from the world of the scene.
    """

    name: str
    loss: Goal


def refuse_goal(bench: Bench) -> None:
    """InputError for a study of which no goal can be attributed to triangles."""
    if "cells" not in bench.parameters:
        raise InputError(
            "The error of a goal by triangles needs finer cells, and they are not a parameter of this study."
        )


def goal_report(gatherer: Gatherer, goal: NamedGoal) -> dict[str, Any]:
    """Return the entry "goal" of study.json, and write its arrays and picture to the directory of the study.

    Its key "failed" holds the reason where there is no attribution.
    """
    swept = [where for where in gatherer.outcomes if gatherer.good(where) and where == point(dict(where.levels))]
    swept = [where for where in swept if dict(where.levels).keys() == {"cells"} and where.level("cells") > 0]
    finer = max(swept, key=lambda where: where.level("cells"), default=None)
    if finer is None:
        return {"name": goal.name, "failed": "no run with finer cells came to its end"}
    bench = gatherer.bench
    ends = [gatherer.own_positions(where) for where in (BASE, finer)]
    try:
        found = goal_error(bench.scene(BASE), ends[0], bench.scene(finer), ends[1], goal.loss)
    except InputError as error:
        return {"name": goal.name, "failed": error.sentence.rstrip(".")}
    np.savez(
        gatherer.directory / ARRAYS_NAME,
        positions=found.positions,
        triangles=found.triangles,
        by_vertex=found.by_vertex,
        by_triangle=found.by_triangle,
    )
    draw_goal(found, goal.name, gatherer.directory / PICTURE_NAME)
    low, high = EFFECTIVE
    return {
        "name": goal.name,
        "value": found.coarse,
        "finer": found.fine,
        "cells": bench.settings(finer)["cells"],
        "difference": found.true,
        "estimated": found.estimated,
        "effectivity": found.effectivity,
        "believed": bool(low <= found.effectivity <= high),
        "sum_of_parts": float(found.by_triangle.sum()),
        "area_of_half": found.area_of(0.5),
        "failed": "",
    }


def goal_lines(goal: dict[str, Any]) -> list[str]:
    """Return the lines for people, with the heights and lengths in metres."""
    if goal["failed"]:
        return [f"Goal {goal['name']}: not by triangles: {goal['failed']}."]
    cells = goal["cells"]
    mesh = "x".join(map(str, cells)) if isinstance(cells, list | tuple) else str(cells)
    area = f"{100 * goal['area_of_half']:.2g} % of the cloth ({PICTURE_NAME})"
    lines = [
        f"Goal {goal['name']}: {goal['value']:.6g}, {goal['difference']:+.3g} with {mesh} cells.",
        f"By triangles: {goal['estimated']:+.3g} ({goal['effectivity']:.2f} of it), without signs "
        f"{goal['sum_of_parts']:.2g}, half of that in {area}.",
    ]
    if not goal["believed"]:
        lines.append("The estimate is off by more than a factor of 2: the two meshes differ too much for the picture.")
    return lines
