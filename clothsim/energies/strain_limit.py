"""The effect `strain_limit`: a barrier that no stretch of a triangle passes.

With a stretch s, the limit S and s_hat, where the barrier begins, y = (s - s_hat)/(S - s_hat):

    psi = -k (S - s_hat)^2 y^2 ln(1 - y)  for s > s_hat, else exactly 0     [J/m2]

C2 at s_hat, infinite at S (Li, Kaufman, Jiang 2021, "Codimensional incremental potential contact", section 4, the
barrier of constitutive strain limiting; k [N/m] times the square of the way here, so that k is a stiffness). The
stretches are both principal ones (`limit`), or those of the threads (`limit_warp`, `limit_weft`); each is a convex
function of x, and with it psi: its Hessian is semi-definite as it is.

Triangles whose stretches are below s_hat are left out of value, gradient and Hessian: where none comes near, a run is
the same as without, bit for bit.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.arrays import Floats, Ints, as_number
from clothsim.energies import fibre_kernels
from clothsim.energies import strain_limit_kernels as kernels
from clothsim.energies.base import Energy, Off
from clothsim.energies.elementwise import Elementwise
from clothsim.energies.example import Example, Idle
from clothsim.energies.hessians import ElementHessian, LanesHessian
from clothsim.energies.protocols import BarrierGap, Report
from clothsim.energies.varying_values import over_cloth
from clothsim.errors import InputError
from clothsim.kinematics.warp_weft import thread_axes
from clothsim.mesh.world import World

SLACK = 0.9
"""Share of the way from a stretch to its limit that one Newton step may go at most, where the whole step passes it."""
CHORDS = 8
TIGHT = 0.9
"""The share of its way to a limit from which a stretch is told as the reason of a failure."""


@dataclass(frozen=True)
class StrainLimit(Elementwise, Energy, BarrierGap, Report):
    """E = sum over triangles and stretches of A psi.

    triangles (m, 3); inverses Dm^-1 [a b] (m, 2, 2) [1/m]; areas at rest (m,) [m2]; begins s_hat and limits S (m, 4) of
    s1, s2, la, lb, inf where there is none; stiffness k (m,) [N/m].
    """

    triangles: Ints
    inverses: Floats
    areas: Floats
    begins: Floats
    limits: Floats
    stiffness: Floats

    per_element = ("triangles", "inverses", "areas", "begins", "limits", "stiffness")

    def value(self, x: Floats) -> float:
        """Energy of the barrier [J]; +inf where a stretch is at its limit or beyond."""
        stretches = kernels.stretches(x, self.triangles, self.inverses)
        near = np.flatnonzero((stretches > self.begins).any(axis=1))
        y, ways = self._way(stretches[near], near)
        if not (y < 1).all():
            return np.inf
        weights = (self.areas * self.stiffness)[near, None]
        return float(np.sum(-weights * ways**2 * y**2 * np.log1p(-y)))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        near, stretches, slopes, _ = self._near(x)
        if not len(near):
            return np.zeros_like(x)
        triangles, inverses = self.triangles[near], self.inverses[near]
        pulled = kernels.principal_gradient(x, triangles, inverses, np.ascontiguousarray(slopes[:, :2]))
        threads, along = _of_threads(stretches), _of_threads(slopes)
        return pulled + fibre_kernels.gradient(x, triangles, inverses, threads, along)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (k, 9, 9) [N/m] of the triangles that are near; exact and semi-definite in one."""
        near, stretches, slopes, curvatures = self._near(x)
        triangles, inverses = self.triangles[near], self.inverses[near]
        if not len(near):
            return ElementHessian(triangles, np.zeros((0, 9, 9)))
        middle = np.repeat(stretches[:, :2].mean(axis=1), 4).reshape(-1, 4)
        between = self._curvature(middle, near)[:, 0]
        pairs = np.ascontiguousarray(slopes[:, :2]), np.ascontiguousarray(curvatures[:, :2])
        blocks = LanesHessian(
            triangles, lambda lanes, first: kernels.fill(lanes, first, x, triangles, inverses, *pairs, between)
        ).blocks
        threads, along, none = _of_threads(stretches), _of_threads(slopes), np.zeros(len(near))
        curved = np.column_stack([curvatures[:, 2], none, curvatures[:, 3], none])
        blocks += fibre_kernels.hessian(x, triangles, inverses, threads, along, curved, False)
        return ElementHessian(triangles, blocks)

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """The fraction of dx, at most `most`, that takes the tightest triangle at most SLACK of its way to the limit.

        A stretch is convex along dx, so that it stays below its chord: where the chord from here to the end of the step
        meets the goal, the stretch has not. From there the next chord is drawn.
        """
        passing = np.flatnonzero(self._loads(x + dx, self.triangles).max(axis=1, initial=0.0) >= 1)
        if not len(passing):
            return most
        corners = self.triangles[passing].ravel()
        own = np.arange(len(corners)).reshape(-1, 3)
        start, way = x[corners], dx[corners]
        load = self._loads(start, own, passing)
        end = self._loads(start + way, own, passing)
        goal = load + SLACK * (1 - load)
        fractions = np.zeros(len(passing))
        for _ in range(CHORDS):
            steps = np.where(end > goal, (goal - load) / np.where(end > goal, end - load, 1.0), 1.0).min(axis=1)
            fractions += (1 - fractions) * np.clip(steps, 0.0, 1.0)
            load = np.minimum(self._loads(start + np.repeat(fractions, 3)[:, None] * way, own, passing), goal)
        return min(most, float(fractions.min()))

    def gap_change(self, x: Floats, dx: Floats) -> float:
        """The largest share of what is left to its limit that the step changes, of the triangles past a begin."""
        near = (kernels.stretches(x, self.triangles, self.inverses) > self.begins).any(axis=1)
        if not near.any():
            return 0.0
        load = self._loads(x, self.triangles)[near]
        after = self._loads(x + dx, self.triangles)[near]
        return float(np.max(np.abs(after - load) / (1 - load)))

    def tightest(self, x: Floats) -> str:
        """The largest stretch, where it is most of its way to its limit."""
        stretches = kernels.stretches(x, self.triangles, self.inverses)
        y, _ = self._way(stretches, np.arange(len(stretches)))
        worst = np.unravel_index(int(y.argmax()), y.shape)
        if y[worst] < TIGHT:
            return ""
        return (
            f"effects.strain_limit holds the cloth: it is stretched to {stretches[worst]:.4g} of {self.limits[worst]:g}"
        )

    def beyond(self, x: Floats) -> Ints:
        """The triangles that are at a limit or beyond it."""
        return np.flatnonzero((self._loads(x, self.triangles) >= 1).any(axis=1))

    def _loads(self, x: Floats, triangles: Ints, rows: Ints | slice = slice(None)) -> Floats:
        """Stretches over their limits, (m, 4): 1 where the barrier is infinite."""
        return kernels.stretches(x, triangles, self.inverses[rows]) / self.limits[rows]

    def _near(self, x: Floats) -> tuple[Ints, Floats, Floats, Floats]:
        """The triangles past a begin, with their stretches, area dpsi/ds [N m] and area d2psi/ds2, (k, 4) each."""
        stretches = kernels.stretches(x, self.triangles, self.inverses)
        near = np.flatnonzero((stretches > self.begins).any(axis=1))
        stretches = stretches[near]
        y, ways = self._way(stretches, near)
        slopes = ways * (y * y / (1 - y) - 2 * y * np.log1p(-y))
        return near, stretches, (self.areas * self.stiffness)[near, None] * slopes, self._curvature(stretches, near)

    def _curvature(self, stretches: Floats, near: Ints) -> Floats:
        y, _ = self._way(stretches, near)
        return (self.areas * self.stiffness)[near, None] * ((4 * y + y * y / (1 - y)) / (1 - y) - 2 * np.log1p(-y))

    def _way(self, stretches: Floats, near: Ints) -> tuple[Floats, Floats]:
        """y (k, 4), 0 below the begin and where there is no limit, and S - s_hat (k, 4), there 0."""
        begins, limits = self.begins[near], self.limits[near]
        limited = np.isfinite(limits)
        ways = np.where(limited, limits, 1.0) - np.where(limited, begins, 1.0)
        past = np.maximum(stretches - begins, 0.0)
        return np.divide(past, ways, out=np.zeros_like(past), where=limited), ways


def _of_threads(values: Floats) -> Floats:
    """Of (k, 4) what belongs to la and lb, and 0 for I8, (k, 3)."""
    return np.column_stack([values[:, 2:], np.zeros(len(values))])


def strain_limit(
    world: World,
    *,
    limit: Any = 1.1,
    limit_warp: Any = 0.0,
    limit_weft: Any = 0.0,
    begins: float = 0.5,
    stiffness: Any = 0.0,
    angle_degrees: Any = 0.0,
) -> Energy | Off:
    """Stretches stay below their limits, 1.1 being 10 %: `limit` in every direction, the others along the threads.

    A limit of 0 is none; off where there is none at all. begins: the share of the way from 1 to the limit at which the
    barrier begins to push; stiffness [N/m]: 0 takes the fabric's own. Limits, stiffness and angle_degrees (of the warp,
    see `kinematics.threads`) may vary over the cloth. InputError names a triangle that starts at its limit or beyond.
    """
    asked = {"limit": limit, "limit_warp": limit_warp, "limit_weft": limit_weft}
    every, warp, weft = (_limits(f"effects.strain_limit.{key}", value, world) for key, value in asked.items())
    share = as_number("effects.strain_limit.begins", begins)
    if not 0 <= share < 1:
        raise InputError(f"effects.strain_limit.begins must be a share from 0 to below 1, not {begins!r}.")
    limits = np.column_stack([every, every, warp, weft])
    chosen = np.flatnonzero(np.isfinite(limits).any(axis=1))
    if not len(chosen):
        return Off("every limit is 0, which is none")
    stiff = over_cloth("effects.strain_limit.stiffness", stiffness, world, 0.0)
    own = np.sqrt(world.per_triangle("stiffness_along_warp") * world.per_triangle("stiffness_along_weft"))
    stiff = np.where(stiff > 0, stiff, own)[chosen]
    if not (stiff > 0).all():
        raise InputError("effects.strain_limit has no stiffness: the fabric has none.", "Give it a stiffness in N/m.")
    angles = np.radians(over_cloth("effects.strain_limit.angle_degrees", angle_degrees, world))
    inverses = (world.rest_shape_inverses @ thread_axes(world, angles))[chosen]
    limits = limits[chosen]
    begin = np.where(np.isfinite(limits), 1 + share * (np.where(np.isfinite(limits), limits, 1.0) - 1), np.inf)
    energy = StrainLimit(world.triangles[chosen], inverses, world.rest_areas[chosen], begin, limits, stiff)
    _refuse_beyond(world, energy, chosen)
    return energy


def _limits(name: str, value: Any, world: World) -> Floats:
    """(m,) limits, inf where there is none. InputError for one that a cloth at rest is beyond."""
    limits = over_cloth(name, value, world, 0.0)
    wrong = np.flatnonzero((limits > 0) & (limits <= 1))
    if len(wrong):
        raise InputError(f"{name} is {limits[wrong[0]]:g}, and a cloth at rest has stretch 1.", "1.1 allows 10 %.")
    return np.where(limits > 0, limits, np.inf)


def _refuse_beyond(world: World, energy: StrainLimit, chosen: Ints) -> None:
    x = world.start()
    beyond = energy.beyond(x)
    if not len(beyond):
        return
    first = beyond[0]
    stretches, limits = kernels.stretches(x, energy.triangles, energy.inverses)[first], energy.limits[first]
    kind = int((stretches / limits).argmax())
    triangle = int(chosen[first])
    sizes = np.cumsum([0] + [len(cloth.triangles) for cloth in world.cloths])
    number = int(np.searchsorted(sizes, triangle, side="right")) - 1
    where = f"{world.cloths[number].name}: triangle {triangle - sizes[number]}"
    along = ("", "", " along the warp", " along the weft")[kind]
    raise InputError(
        f"{where} starts stretched to {stretches[kind]:.4g}{along}, its strain limit is {limits[kind]:g} "
        f"({len(beyond)} such triangles).",
        "Raise the limit, or start it less stretched.",
    )


EXAMPLE = Example(
    keys={"limit": 3.0, "limit_warp": 3.5, "begins": 0.0},
    in_scene={"limit": 2.0},
    zero={"limit": 0, "begins": 0.1},
    idle=Idle(
        always={"limit": 2.0},
        searches=True,
        kernels=("clothsim.energies.strain_limit_kernels", "clothsim.energies.fibre_kernels"),
    ),
)
