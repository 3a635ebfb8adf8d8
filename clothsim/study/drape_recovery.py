"""Bending of a cloth from outlines of its drapes on a Cusick tester, by simulated lays of a sheet of common ratios.

The outlines' mean drape coefficient gives the bending length c = (D/(rho g))^(1/3), and the difference of the two sides
the curl: a specimen turned over is one of the opposite curl. Both are found by secants, each step a simulated lay of
each seed on each side. Everything else is assumed (`ASSUMED`) and said.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clothsim import gradients
from clothsim.base.arrays import Floats, as_finite, as_positive
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_arrays
from clothsim.base.text import percent
from clothsim.study.standard_tests.cusick import PLATE, RADIUS, lays, outline_shape

GRAVITY, DENSITY = 9.81, 0.2
"""[m/s2]; weight of a cloth where none is given [kg/m2]."""
ASSUMED: dict[str, float] = {"thickness": 0.4e-3, "youngs_modulus": 0.75e6, "poisson_ratio": 0.243,
                              "shear_stiffness": 45.0}  # fmt: skip
"""E2 300 N/m; a shear stiffness of .8 gf/(cm degree), a KES value of plain weaves."""
WARP, WEFT, BIAS = 1.25, 0.8, 1.04
"""Bending stiffnesses over the geometric mean of warp and weft: medians of 618 fabrics (Feng et al. 2022)."""
LENGTHS = np.array([8.0, 9.5, 11.0, 13.0, 15.0, 17.0, 19.0, 21.5, 24.5, 28.0, 33.0]) * 1e-3
COEFFICIENTS = np.array([0.149, 0.208, 0.261, 0.346, 0.439, 0.531, 0.623, 0.723, 0.778, 0.836, 0.901])
"""Drape coefficients of simulated bending lengths [m], the first guess (docs/results/reality.md)."""
REPEATABILITY = 0.02
"""Standard deviation of the coefficient of one outline where one is given: of lays of 9 fabrics .006 to .039."""
MESH_ERROR = 0.02
"""Of the coefficient on meshes of `mesh_size` (docs/results/fabrics.md)."""
CLOSE, MOST_STEPS = 0.004, 5
"""Difference of the coefficient at which the search ends, and its bound on steps."""
FIRST_CURL, LEAST_SLOPE = 2.0, 2e-4
"""Curl of the first secant [1/m], and the least change of the coefficient by 1/m that tells of curl."""
LAYS = 4
MOST_BYTES = 1 << 28


@dataclass(frozen=True)
class DrapeRecovery:
    """What outlines tell of a cloth.

    Attributes
    ----------
    bending_length : float
        c = (D/(rho g))^(1/3) [m], D the geometric mean of warp and weft.
    relative_error : float
        Relative standard error of D/(rho g).
    curl, curl_error : float or None
        Natural curvature along warp and weft [1/m] towards the side of the first outlines, and its standard error; None
        where one side alone was laid, or the drape does not answer.
    stiffnesses : mapping
        D along warp, weft and bias [N m] with their relative standard errors; empty without a weight.
    coefficient, simulated : float
        Mean drape coefficient of the outlines, and of the simulated lays at the end.
    lays : int
        Simulated lays.
    notes : tuple of str
        What was assumed, and what is not determined.
    """

    bending_length: float
    relative_error: float
    curl: float | None
    curl_error: float | None
    stiffnesses: Mapping[str, tuple[float, float]]
    coefficient: float
    simulated: float
    lays: int
    notes: tuple[str, ...]

    def document(self) -> dict[str, Any]:
        """The recovery as plain data in SI units."""
        return {
            "bending_length": self.bending_length,
            "stiffness_over_weight": self.bending_length**3,
            "relative_error": self.relative_error,
            "curl": self.curl,
            "curl_error": self.curl_error,
            "stiffnesses": {k: {"value": v, "relative_error": e} for k, (v, e) in self.stiffnesses.items()},
            "coefficient": self.coefficient,
            "simulated": self.simulated,
            "lays": self.lays,
            "notes": list(self.notes),
        }

    def text(self) -> str:
        """The numbers in lines, and the notes."""
        c, error = self.bending_length, f"+- {percent(self.relative_error)}"
        both = f"{100 * self.coefficient:.1f} %, simulated {100 * self.simulated:.1f} %, {self.lays} lays"
        lines = [
            f"  D/(rho g)        {c**3:.3g} m3 {error} (bending length {1e3 * c:.3g} mm)",
            f"  coefficient      {both}",
        ]
        if self.curl is not None:
            lines.append(f"  curl             {self.curl:.2g} +- {self.curl_error:.1g} 1/m")
        lines += [f"  {key:16} {d:.3g} N m +- {percent(e)}" for key, (d, e) in self.stiffnesses.items()]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])


def assumed_cloth(bending_length: float, curl: float = 0.0, own: Mapping[str, float] | None = None) -> dict[str, Any]:
    """Keys of [cloth] of the assumed sheet with a bending length [m] and a curl [1/m]; own: keys in their place."""
    known = {"density": DENSITY, **ASSUMED, **(own or {})}
    mean = known["density"] * GRAVITY * bending_length**3
    bending = {"bending_warp": WARP * mean, "bending_weft": WEFT * mean, "bending_bias": BIAS * mean}
    curled = {"rest_curvature_warp": curl, "rest_curvature_weft": curl} if curl else {}
    return {"fabric": "cotton", **known, **bending, **curled}


def mesh_size(bending_length: float) -> float:
    """Distance of neighbouring vertices [m] for a bending length [m]: a soft cloth jams on a coarser mesh."""
    return 3e-3 if bending_length < 10e-3 else 4e-3 if bending_length < 16e-3 else 6e-3


def read_outlines(file: Path) -> tuple[Floats, Floats]:
    """Coefficients (n,) of the outlines of a file, and the side that was up at each, 1 or -1 (n,).

    Its array `radii`, (k,) or (n, k), has r at the angles 2 pi j/k about the plate's centre [m]; `side` (n,) may be
    left out.

    Raises
    ------
    InputError
        For a file without them, radii of another size than a drape's, or sides that are not 1 and -1.
    """
    arrays = read_arrays(file, ["radii", "side"], MOST_BYTES)
    if "radii" not in arrays:
        raise InputError(f"{file} has no array radii.", "Save r(theta) in metres: np.savez(FILE, radii=r).")
    radii = np.atleast_2d(as_finite("radii", arrays["radii"]))
    side = as_finite("side", arrays["side"]) if "side" in arrays else np.ones(len(radii))
    if not radii.size:
        raise InputError(f"{file} has no outline.", "Save r(theta) in metres: np.savez(FILE, radii=r).")
    low, high = float(radii.min()), float(radii.max())
    if not 0.5 * PLATE < low <= high < 1.1 * RADIUS:
        raise InputError(
            f"{file} has radii of {low:.3g} to {high:.3g} m.",
            f"A disc of {RADIUS:g} m on a plate of {PLATE:g} m is measured, in metres about the plate's centre.",
        )
    if side.shape != (len(radii),) or not np.isin(side, (1, -1)).all():
        raise InputError(f"{file} has sides of shape {side.shape}.", "Give 1 or -1 for each outline.")
    return np.array([outline_shape(each).coefficient for each in radii]), side


def recover_drape(
    coefficients: Floats,
    side: Floats,
    own: Mapping[str, float] | None = None,
    prior: bool = False,
    count: int = LAYS,
    message: Callable[[str], None] | None = None,
    simulate: Callable[[Mapping[str, Any], float], Sequence[float]] | None = None,
) -> DrapeRecovery:
    """Find D/(rho g) and curl of a cloth from drape coefficients.

    Parameters
    ----------
    coefficients, side : (n,) arrays
        Of lays, and the side that was up at each, 1 or -1.
    own : mapping, optional
        Keys of [cloth] in place of what is assumed; without a density [kg/m2] D itself is not known.
    prior : bool
        Weigh D with those of 618 fabrics of that weight (`bending_prior`).
    count : int
        Simulated lays of each side and step.
    message : callable, optional
        Gets a line for each step.
    simulate : callable, optional
        From keys of [cloth] and the distance of neighbouring vertices [m] to the coefficients of lays, in place of
        simulated ones.

    Raises
    ------
    InputError
        For a weight that is not positive, a stiffness of bending or a curl, or a prior without a weight.
    """
    own = own or {}
    found_here = next((key for key in own if key.startswith(("bending_", "rest_curvature_"))), None)
    if found_here:
        raise InputError(f"{found_here} is what the outlines are to determine.", "Leave it out.")
    density = as_positive("density", own["density"]) if "density" in own else None
    if prior and density is None:
        raise InputError("The prior is for a cloth of known weight.", "Set density in kg/m2.")
    message = message or (lambda line: None)
    lay = simulate or (lambda cloth, size: [each.shape.coefficient for each in lays(cloth, count, size)])
    sides = [float(coefficients[side == s].mean()) for s in (1, -1) if (side == s).any()]
    target, half = float(np.mean(sides)), 0.5 * (sides[0] - sides[-1])
    both, taken = len(sides) == 2, 0
    x, curl = float(np.interp(target, COEFFICIENTS, 3 * np.log(LENGTHS))), float(np.copysign(FIRST_CURL, half)) * both
    slope, per_curl = float(np.interp(target, COEFFICIENTS, np.gradient(COEFFICIENTS, 3 * np.log(LENGTHS)))), 0.0
    points: list[tuple[float, float, float, float]] = []
    spread = 0.0
    for step in range(MOST_STEPS):
        ups = (1, -1) if both and curl else (1,)
        c = float(np.exp(x / 3))
        found = [np.array(lay(assumed_cloth(c, up * curl, own), mesh_size(c))) for up in ups]
        taken += sum(map(len, found))
        mean, apart = float(np.mean(found)), 0.5 * float(found[0].mean() - found[-1].mean())
        spread = float(np.concatenate(found).std() / np.sqrt(taken / (step + 1)))
        message(
            f"step {step + 1}: bending length {1e3 * np.exp(x / 3):.2f} mm, curl {curl:.2g} 1/m: {100 * mean:.1f} %"
        )
        points.append((x, mean, curl, apart))
        if len(points) > 1 and points[-1][0] != points[-2][0]:
            measured = (mean - points[-2][1]) / (x - points[-2][0])
            slope = measured if 0.3 * slope < measured < 3 * slope else slope
        per_curl = apart / curl if curl else 0.0
        if abs(mean - target) < CLOSE and (not both or abs(apart - half) < CLOSE or abs(per_curl) < LEAST_SLOPE):
            break
        x += float(np.clip((target - mean) / slope, -0.7, 0.7))
        if both and per_curl > LEAST_SLOPE:
            curl = float(np.clip(half / per_curl, -20.0, 20.0))
    x, mean, curl, apart = min(points, key=lambda each: abs(each[1] - target) + abs(each[3] - half) * both)
    noise = float(coefficients.std(ddof=1)) if len(coefficients) > 2 and not both else REPEATABILITY
    noise /= np.sqrt(len(coefficients))
    error = float(np.sqrt(noise**2 + spread**2 + MESH_ERROR**2)) / slope
    determined = both and per_curl > LEAST_SLOPE
    x += (target - mean) / slope if abs(target - mean) < 0.05 else 0.0
    known, notes = _stiffnesses(x, error, density, prior)
    return DrapeRecovery(
        float(np.exp(x / 3)),
        error,
        curl if determined else None,
        float(np.hypot(noise, spread) / per_curl) if determined else None,
        known,
        target,
        mean,
        taken,
        (*notes, *_notes(target, mean, both, determined, own)),
    )


def _stiffnesses(
    x: float, error: float, density: float | None, prior: bool
) -> tuple[dict[str, tuple[float, float]], tuple[str, ...]]:
    """D along warp, weft and bias with relative errors, and how they came about; x: log of D/(rho g) [m3]."""
    if density is None:
        return {}, ()
    names, mean = ("bending_warp", "bending_weft", "bending_bias"), x + float(np.log(density * GRAVITY))
    if not prior:
        ratios = dict(zip(names, (WARP, WEFT, BIAS), strict=True))
        text = "D along warp, weft and bias: by the ratios of medians of 618 fabrics, not by the outline."
        return {name: (ratio * float(np.exp(mean)), error) for name, ratio in ratios.items()}, (text,)
    before = gradients.bending_prior(names, density)
    along = np.array([0.5, 0.5, 0.0])  # what the outline tells: the geometric mean of warp and weft
    after = before.given(2.0 * along * mean, np.outer(along, along) / error**2)
    spreads = np.sqrt(np.diag(after.covariance))
    moved = 100 * np.expm1(float(along @ after.mean) - mean)
    text = (
        f"Prior: 618 fabrics of Feng et al. 2022 at {density:g} kg/m2, log-normal; it moved the mean D by "
        f"{moved:+.2g} %; warp, weft and bias apart are its own."
    )
    return {n: (float(np.exp(m)), float(s)) for n, m, s in zip(names, after.mean, spreads, strict=True)}, (text,)


def _notes(target: float, mean: float, both: bool, determined: bool, own: Mapping[str, float]) -> tuple[str, ...]:
    """What was assumed, and what the outlines do not determine."""
    known = {**ASSUMED, **own}
    stretch = known["youngs_modulus"] * known["thickness"]
    notes = [
        f"Assumed: stretch {stretch:.3g} N/m and shear {known['shear_stiffness']:.3g} N/m (ten times the stretch is"
        " about ten points of the coefficient, shear of 115 to 10 N/m three), "
        f"warp : weft : bias = {WARP} : {WEFT} : {BIAS}, no softening (that of the median of 618 fabrics takes 5 to 8"
        " points off the coefficient), no hysteresis, a ring at 100 mm/s.",
        "Not determined: warp and weft apart, stretch, shear; number and depth of the folds are the laying's.",
    ]
    if "density" not in own:
        notes.append(f"Not determined: D itself; weigh the cloth and set density ({DENSITY:g} kg/m2 was simulated).")
    if not both:
        notes.append("Not determined: curl; lay the specimen with the other side up too (side = 1 and -1).")
    elif not determined:
        notes.append("Not determined: curl; the sides differ by less than the simulated lays tell.")
    if abs(target - mean) > 0.02:
        notes.append(
            f"NOT reached: the simulated lays have {100 * mean:.1f} %; the cloth is beyond what this mesh drapes."
        )
    return tuple(notes)
