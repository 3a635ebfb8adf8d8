"""Barrier on the stretches of triangles: the effect `strain_limit`.

With a stretch s, the limit S, the activation s_hat and y = (s - s_hat)/(S - s_hat):

    psi = -k (S - s_hat)^2 y^2 ln(1 - y)  for s > s_hat, else exactly 0     [J/m2]

C2 at s_hat, infinite at S (Li, Kaufman, Jiang 2021, "Codimensional incremental potential contact", section 4, the
barrier of constitutive strain limiting, here scaled by the square of S - s_hat, so that k [N/m] is a stiffness). The
stretches are both principal ones (`limit`) and those of the threads (`limit_warp`, `limit_weft`); each is a convex
function of x, hence so is psi: its exact Hessian is semi-definite.

Triangles with all stretches below s_hat are left out of value, gradient and Hessian: without a triangle above it, a run
is bit for bit the same as without the effect.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.jit import LANES, kernel, natural
from clothsim.geometry.kinematics.deformation_gradient import thread_axes
from clothsim.keys.fabric import EXTENDED
from clothsim.keys.typed_effects import StrainLimit
from clothsim.mesh.world import World
from clothsim.physics.energies import fibre_kernels
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.hessians import ElementHessian, LanesHessian
from clothsim.physics.energies.key_values import over_cloth
from clothsim.physics.energies.protocols import BarrierGap, Elementwise, EnergyReport
from clothsim.physics.energies.triangle_kernels import (
    VALUES_PER_LANE,
    deformation_gradient,
    fill_lanes,
    principal_state,
    products,
    store_lane,
)

FABRIC = "fabric"
"""Limits from the extensions of the fabric."""
WITHOUT_EXTENSION = 1.1
"""Largest stretch of a fabric whose extension is not known."""


SLACK = 0.9
"""Largest fraction of the distance to its limit that a stretch may cover in a Newton step that would pass the limit."""
CHORDS = 8
"""Secant iterations of the step limit."""
TIGHT = 0.9
"""Value of y from which a stretch is reported as the reason of a failed step."""


@dataclass(frozen=True)
class StrainLimitEnergy(Elementwise, Energy, BarrierGap, EnergyReport):
    """E = sum over triangles and stretches of A psi; +inf where a stretch is at its limit or beyond.

    Parameters
    ----------
    triangles : (m, 3) int array
        Rows of x.
    inverses : (m, 2, 2) array
        Dm^-1 [a b] [1/m].
    areas : (m,) array
        A at rest [m2].
    begins, limits : (m, 4) arrays
        s_hat and S of the stretches s1, s2, la, lb; inf where there is no limit.
    stiffness : (m,) array
        k [N/m].
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
        stretches = _stretches(x, self.triangles, self.inverses)
        near = np.flatnonzero((stretches > self.begins).any(axis=1))
        y, ranges = self._range(stretches[near], near)
        if not (y < 1).all():
            return np.inf
        weights = (self.areas * self.stiffness)[near, None]
        return float(np.sum(-weights * ranges**2 * y**2 * np.log1p(-y)))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        near, stretches, slopes, _ = self._near(x)
        if not len(near):
            return np.zeros_like(x)
        triangles, inverses = self.triangles[near], self.inverses[near]
        principal = _principal_gradient(x, triangles, inverses, np.ascontiguousarray(slopes[:, :2]))
        threads, along = _pad_threads(stretches), _pad_threads(slopes)
        return principal + fibre_kernels.gradient(x, triangles, inverses, threads, along)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (k, 9, 9) [N/m] of the triangles past s_hat; exact and positive semi-definite."""
        near, stretches, slopes, curvatures = self._near(x)
        triangles, inverses = self.triangles[near], self.inverses[near]
        if not len(near):
            return ElementHessian(triangles, np.zeros((0, 9, 9)))
        middle = np.repeat(stretches[:, :2].mean(axis=1), 4).reshape(-1, 4)
        between = self._curvature(middle, near)[:, 0]
        pairs = np.ascontiguousarray(slopes[:, :2]), np.ascontiguousarray(curvatures[:, :2])
        blocks = LanesHessian(
            triangles, lambda lanes, first: _fill(lanes, first, x, triangles, inverses, *pairs, between)
        ).blocks
        threads, along, none = _pad_threads(stretches), _pad_threads(slopes), np.zeros(len(near))
        curved = np.column_stack([curvatures[:, 2], none, curvatures[:, 3], none])
        blocks += fibre_kernels.hessian(x, triangles, inverses, threads, along, curved, False)
        return ElementHessian(triangles, blocks)

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """The fraction of dx, at most `most`, with which a stretch covers at most SLACK of the distance to its limit.

        A stretch is convex along dx, hence below its secant: where the secant from x to x + dx meets the goal, the
        stretch is still below it. The next secant starts there.
        """
        passing = np.flatnonzero(self._loads(x + dx, self.triangles).max(axis=1, initial=0.0) >= 1)
        if not len(passing):
            return most
        corners = self.triangles[passing].ravel()
        own = np.arange(len(corners)).reshape(-1, 3)
        start, displacement = x[corners], dx[corners]
        load = self._loads(start, own, passing)
        end = self._loads(start + displacement, own, passing)
        goal = load + SLACK * (1 - load)
        fractions = np.zeros(len(passing))
        for _ in range(CHORDS):
            steps = np.where(end > goal, (goal - load) / np.where(end > goal, end - load, 1.0), 1.0).min(axis=1)
            fractions += (1 - fractions) * np.clip(steps, 0.0, 1.0)
            load = np.minimum(self._loads(start + np.repeat(fractions, 3)[:, None] * displacement, own, passing), goal)
        return min(most, float(fractions.min()))

    def gap_change(self, x: Floats, dx: Floats, within: float = np.inf) -> float:
        """The largest relative change of the distance of a stretch to its limit, over the triangles past s_hat.

        Triangles whose distance is `within` times that of s_hat or more do not count.
        """
        stretches = _stretches(x, self.triangles, self.inverses)
        y, _ = self._range(stretches, np.arange(len(stretches)))
        near = ((stretches > self.begins) & (1 - y < within)).any(axis=1)
        if not near.any():
            return 0.0
        load = self._loads(x, self.triangles)[near]
        after = self._loads(x + dx, self.triangles)[near]
        return float(np.max(np.abs(after - load) / (1 - load)))

    def tightest(self, x: Floats) -> str:
        """The stretch nearest to its limit, if its y is at least TIGHT."""
        stretches = _stretches(x, self.triangles, self.inverses)
        y, _ = self._range(stretches, np.arange(len(stretches)))
        worst = np.unravel_index(int(y.argmax()), y.shape)
        if y[worst] < TIGHT:
            return ""
        how = "nearly active" if y[worst] < 1 else "exceeded"
        return f"effects.strain_limit is {how}: a stretch of {stretches[worst]:.4g} of {self.limits[worst]:g}"

    def stretches(self, x: Floats) -> Floats:
        """Stretches s1, s2, la, lb of the triangles at x, (m, 4)."""
        return _stretches(x, self.triangles, self.inverses)

    def beyond(self, x: Floats) -> Ints:
        """The triangles with a stretch at its limit or beyond."""
        return np.flatnonzero((self._loads(x, self.triangles) >= 1).any(axis=1))

    def _loads(self, x: Floats, triangles: Ints, rows: Ints | slice = slice(None)) -> Floats:
        """Stretches relative to their limits, (m, 4): 1 where the barrier is infinite."""
        return _stretches(x, triangles, self.inverses[rows]) / self.limits[rows]

    def _near(self, x: Floats) -> tuple[Ints, Floats, Floats, Floats]:
        """The triangles past s_hat, with their stretches, A dpsi/ds [N m] and A d2psi/ds2, (k, 4) each."""
        stretches = _stretches(x, self.triangles, self.inverses)
        near = np.flatnonzero((stretches > self.begins).any(axis=1))
        stretches = stretches[near]
        y, ranges = self._range(stretches, near)
        with np.errstate(divide="ignore", invalid="ignore"):  # beyond a limit that shrank: not finite, and reported
            slopes = ranges * (y * y / (1 - y) - 2 * y * np.log1p(-y))
            return near, stretches, (self.areas * self.stiffness)[near, None] * slopes, self._curvature(stretches, near)

    def _curvature(self, stretches: Floats, near: Ints) -> Floats:
        y, _ = self._range(stretches, near)
        return (self.areas * self.stiffness)[near, None] * ((4 * y + y * y / (1 - y)) / (1 - y) - 2 * np.log1p(-y))

    def _range(self, stretches: Floats, near: Ints) -> tuple[Floats, Floats]:
        """y (k, 4), 0 below s_hat and without a limit, and S - s_hat (k, 4), 0 without a limit."""
        begins, limits = self.begins[near], self.limits[near]
        limited = np.isfinite(limits)
        ranges = np.where(limited, limits, 1.0) - np.where(limited, begins, 1.0)
        past = np.maximum(stretches - begins, 0.0)
        return np.divide(past, ranges, out=np.zeros_like(past), where=limited), ranges


def _pad_threads(values: Floats) -> Floats:
    """The columns of la and lb of (k, 4), and 0 for I8, (k, 3)."""
    return np.column_stack([values[:, 2:], np.zeros(len(values))])


# Element loops of the strain limit: stretches, and gradient and Hessian by principal stretches.
#
# [u v] = F [a b] as in `fibre_kernels`: the principal stretches of F are those of [u v].


ALIKE = 1e-5
"""Difference of two stretches below which a divided difference is replaced by the curvature at their mean."""


@kernel
def _stretches(x, triangles, inverses):
    """Principal stretches s1 >= s2, then the warp's la and the weft's lb, (m, 4)."""
    out = np.empty((len(triangles), 4))
    F = np.empty((3, 2))
    for t in range(len(triangles)):
        deformation_gradient(x, triangles[t], inverses[t], F)
        uu, uv, vv = products(F)
        middle, radius = 0.5 * (uu + vv), np.hypot(0.5 * (uu - vv), uv)
        s1 = np.sqrt(middle + radius)
        out[t, 0], out[t, 1] = s1, (np.sqrt(max(uu * vv - uv * uv, 0.0)) / s1 if s1 > 0.0 else 0.0)
        out[t, 2], out[t, 3] = np.sqrt(uu), np.sqrt(vv)
    return out


@kernel
def _principal_gradient(x, triangles, inverses, slopes):
    """dE/dx from slopes (m, 2) = dE/ds_i: the stress p1 w1 v1' + p2 w2 v2'."""
    out = np.zeros_like(x)
    F, n, V, W = np.empty((3, 2)), np.empty(3), np.empty((2, 2)), np.empty((2, 3))
    alpha, beta = np.empty(3), np.empty(3)
    for t in range(len(triangles)):
        principal_state(x, triangles[t], inverses[t], F, n, V, W, alpha, beta)
        for p in range(3):
            row = natural(triangles[t, p])
            for k in range(3):
                out[row, k] += slopes[t, 0] * alpha[p] * W[0, k] + slopes[t, 1] * beta[p] * W[1, k]
    return out


@kernel
def _fill(lanes, first, x, triangles, inverses, slopes, curvatures, between):
    """`LanesHessian.fill` of d2E/dx2 of E = sum e(s1) + e(s2); between (m,): e'' half-way from s2 to s1.

    The modes of `membrane_kernels.fill`: e'' on the stretches, (e1' + e2')/(s1 + s2) twist, (e1' - e2')/(s1 - s2)
    flip, e_i'/s_i out of plane. None is negative where e grows and is convex.
    """
    F, n, V, W = np.empty((3, 2)), np.empty(3), np.empty((2, 2)), np.empty((2, 3))
    alpha, beta, lane_values = np.empty(3), np.empty(3), np.zeros(VALUES_PER_LANE * LANES)
    for group in range(len(lanes)):
        for lane in range(min(LANES, len(triangles) - first - group * LANES)):
            t = first + group * LANES + lane
            s1, s2 = principal_state(x, triangles[t], inverses[t], F, n, V, W, alpha, beta)
            p1, p2 = slopes[t]
            flip = (p1 - p2) / (s1 - s2) if s1 - s2 > ALIKE else between[t]
            others = (p1 + p2) / (s1 + s2), flip, p1 / s1, p2 / s2
            store_lane(lane_values, lane, 1.0, alpha, beta, W, n, (curvatures[t, 0], 0.0, curvatures[t, 1]), others)
        fill_lanes(lanes[group], lane_values)


def strain_limit(world: World, keys: StrainLimit, *, at_start: bool = True) -> Energy | Off:
    """Limits of the stretches of all triangles; off without a limit. at_start: of the world as it starts, or later.

    limit = "fabric" takes the stretches along the threads at which the fabric has its measured extension under 490 N/m,
    and 1.1 in every direction for a fabric without one; none for a thread that bears that force alone.

    Raises
    ------
    InputError
        For a limit at or below 1, a missing stiffness, or a triangle that starts at its limit or beyond.
    """
    of_fabric = isinstance(keys.limit, str) and keys.limit == FABRIC
    asked = {"limit": 0.0 if of_fabric else keys.limit, "limit_warp": keys.limit_warp, "limit_weft": keys.limit_weft}
    limits = []
    for key, value in asked.items():
        name, given = f"effects.strain_limit.{key}", over_cloth(f"effects.strain_limit.{key}", value, world, 0.0)
        wrong = np.flatnonzero((given > 0) & (given <= 1))
        if len(wrong):
            raise InputError(f"{name} is {given[wrong[0]]:g}, and a cloth at rest has stretch 1.", "1.1 allows 10 %.")
        limits.append(np.where(given > 0, given, np.inf))
    every, warp, weft = limits
    fraction = keys.begins
    stiff = over_cloth("effects.strain_limit.stiffness", keys.stiffness, world, 0.0)
    own = np.sqrt(world.per_triangle("stiffness_along_warp") * world.per_triangle("stiffness_along_weft"))
    stiff = np.where(stiff > 0, stiff, own)
    if of_fabric:
        of_threads = []  # the limits at which the fabrics have their extensions, inf for a fabric without one
        for along in ("warp", "weft"):
            columns = [world.per_triangle(f"{what}_along_{along}") for what in ("extension", "stiffness")]
            distinct, inverse = np.unique(np.column_stack([*columns, stiff]), axis=0, return_inverse=True)
            found = [limit_of_extension(e, own, k, fraction) for e, own, k in distinct.tolist()]
            of_threads.append(np.asarray(found, np.float64)[inverse.ravel()])
        own_warp, own_weft = of_threads
        known = [world.per_triangle(f"extension_along_{along}") > 0 for along in ("warp", "weft")]
        unknown = ~np.any([*known, np.isfinite(warp), np.isfinite(weft)], axis=0)
        every = np.where(unknown, WITHOUT_EXTENSION, np.inf)
        warp, weft = (np.where(np.isfinite(given), given, own) for given, own in ((warp, own_warp), (weft, own_weft)))
    table = np.column_stack([every, every, warp, weft])
    chosen = np.flatnonzero(np.isfinite(table).any(axis=1))
    if not len(chosen):
        return Off("the threads bear it alone" if of_fabric else "every limit is 0, which means none")
    stiff = stiff[chosen]
    if not (stiff > 0).all():
        raise InputError("effects.strain_limit has no stiffness: the fabric has none.", "Give it a stiffness in N/m.")
    angles = np.radians(over_cloth("effects.strain_limit.angle_degrees", keys.angle_degrees, world))
    inverses = (world.rest_shape_inverses @ thread_axes(world, angles))[chosen]
    table = table[chosen]
    begin = np.where(np.isfinite(table), 1 + fraction * (np.where(np.isfinite(table), table, 1.0) - 1), np.inf)
    energy = StrainLimitEnergy(world.triangles[chosen], inverses, world.rest_areas[chosen], begin, table, stiff)
    if at_start:
        _refuse_beyond(world, energy, chosen)
    return energy


def limit_of_extension(extension: float, own: float, stiffness: float, begins: float) -> float:
    """The limit S with which a thread of stiffness `own` and the barrier bear EXTENDED at a strain of `extension`.

    own e + k (S - s_hat) (y^2/(1 - y) - 2 y ln(1 - y)) = EXTENDED, with S - 1 = e/(begins + (1 - begins) y).

    Parameters
    ----------
    extension : float
        Strain e of the fabric under `EXTENDED`; 0: not known.
    own : float
        Stiffness of the thread [N/m].
    stiffness : float
        k of the barrier [N/m].
    begins : float
        Activation of the barrier as a fraction of the range from 1 to S.

    Returns
    -------
    float
        S; inf where the extension is not known or the thread bears the force alone.

    Examples
    --------
    >>> round(limit_of_extension(0.05, 261.0, 261.0, 0.5), 4)
    1.0504
    """
    missing = EXTENDED - own * extension
    if extension == 0.0 or stiffness == 0.0 or missing <= 0.0:
        return float("inf")

    def surplus(y: float) -> float:
        width = (1 - begins) * extension / (begins + (1 - begins) * y)
        return float(stiffness * width * (y * y / (1 - y) - 2 * y * np.log1p(-y)) - missing)

    least, nearest = 0.0 if begins else 1e-12, 1 - 1e-12  # a barrier from rest has no width at y = 0
    y = brentq(surplus, least, nearest) if surplus(nearest) > 0 else nearest
    return 1 + extension / (begins + (1 - begins) * y)


def _refuse_beyond(world: World, energy: StrainLimitEnergy, chosen: Ints) -> None:
    x = world.start()
    beyond = energy.beyond(x)
    if not len(beyond):
        return
    first = beyond[0]
    stretches, limits = energy.stretches(x)[first], energy.limits[first]
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
        kernels=("clothsim.physics.energies.strain_limit", "clothsim.physics.energies.fibre_kernels"),
    ),
)
