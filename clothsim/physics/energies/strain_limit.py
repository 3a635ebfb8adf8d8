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

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.geometry.kinematics.warp_weft import thread_axes
from clothsim.keys.fabric import EXTENDED
from clothsim.keys.typed_effects import StrainLimit
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.varying_values import over_cloth

FABRIC = "fabric"
"""Limits from the extensions of the fabric."""
WITHOUT_EXTENSION = 1.1
"""Largest stretch of a fabric whose extension is not known."""

if TYPE_CHECKING:
    from clothsim.physics.energies.stretch_barrier import StrainLimitEnergy


def strain_limit(world: World, keys: StrainLimit) -> Energy | Off:
    """Limits of the stretches of all triangles; off without a limit.

    limit = "fabric" takes the stretches along the threads at which the fabric has its measured extension under 490 N/m,
    and 1.1 in every direction for a fabric without one; none for a thread that bears that force alone.

    Raises
    ------
    InputError
        For a limit at or below 1, a missing stiffness, or a triangle that starts at its limit or beyond.
    """
    of_fabric = isinstance(keys.limit, str) and keys.limit == FABRIC
    asked = {"limit": 0.0 if of_fabric else keys.limit, "limit_warp": keys.limit_warp, "limit_weft": keys.limit_weft}
    every, warp, weft = (_limits(f"effects.strain_limit.{key}", value, world) for key, value in asked.items())
    fraction = keys.begins
    stiff = over_cloth("effects.strain_limit.stiffness", keys.stiffness, world, 0.0)
    own = np.sqrt(world.per_triangle("stiffness_along_warp") * world.per_triangle("stiffness_along_weft"))
    stiff = np.where(stiff > 0, stiff, own)
    if of_fabric:
        own_warp, own_weft = (_of_fabric(world, along, stiff, fraction) for along in ("warp", "weft"))
        known = [world.per_triangle(f"extension_along_{along}") > 0 for along in ("warp", "weft")]
        unknown = ~np.any([*known, np.isfinite(warp), np.isfinite(weft)], axis=0)
        every = np.where(unknown, WITHOUT_EXTENSION, np.inf)
        warp, weft = (np.where(np.isfinite(given), given, own) for given, own in ((warp, own_warp), (weft, own_weft)))
    limits = np.column_stack([every, every, warp, weft])
    chosen = np.flatnonzero(np.isfinite(limits).any(axis=1))
    if not len(chosen):
        return Off("the threads bear it alone" if of_fabric else "every limit is 0, which means none")
    stiff = stiff[chosen]
    if not (stiff > 0).all():
        raise InputError("effects.strain_limit has no stiffness: the fabric has none.", "Give it a stiffness in N/m.")
    angles = np.radians(over_cloth("effects.strain_limit.angle_degrees", keys.angle_degrees, world))
    inverses = (world.rest_shape_inverses @ thread_axes(world, angles))[chosen]
    limits = limits[chosen]
    begin = np.where(np.isfinite(limits), 1 + fraction * (np.where(np.isfinite(limits), limits, 1.0) - 1), np.inf)
    from clothsim.physics.energies.stretch_barrier import (
        StrainLimitEnergy,  # after the last Off: no kernel is imported for a zero
    )

    energy = StrainLimitEnergy(world.triangles[chosen], inverses, world.rest_areas[chosen], begin, limits, stiff)
    _refuse_beyond(world, energy, chosen)
    return energy


def _of_fabric(world: World, along: str, stiffness: Floats, begins: float) -> Floats:
    """Limits (m,) of the threads at which the fabrics have their extensions, inf for a fabric without one."""
    extensions, own = world.per_triangle(f"extension_along_{along}"), world.per_triangle(f"stiffness_along_{along}")
    rows, inverse = np.unique(np.column_stack([extensions, own, stiffness]), axis=0, return_inverse=True)
    limits = [limit_of_extension(float(row[0]), float(row[1]), float(row[2]), begins) for row in rows]
    return np.asarray(limits, np.float64)[inverse.ravel()]


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

    nearest = 1 - 1e-12
    y = brentq(surplus, 0.0, nearest) if surplus(nearest) > 0 else nearest
    return 1 + extension / (begins + (1 - begins) * y)


def _limits(name: str, value: Any, world: World) -> Floats:
    """Limits (m,), inf where there is none. InputError for a limit that a cloth at rest exceeds."""
    limits = over_cloth(name, value, world, 0.0)
    wrong = np.flatnonzero((limits > 0) & (limits <= 1))
    if len(wrong):
        raise InputError(f"{name} is {limits[wrong[0]]:g}, and a cloth at rest has stretch 1.", "1.1 allows 10 %.")
    return np.where(limits > 0, limits, np.inf)


def _refuse_beyond(world: World, energy: "StrainLimitEnergy", chosen: Ints) -> None:
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
        kernels=("clothsim.physics.energies.strain_limit_kernels", "clothsim.physics.energies.fibre_kernels"),
    ),
)
