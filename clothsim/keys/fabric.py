"""Fabric: mass, thickness and stiffnesses of a cloth."""

from dataclasses import dataclass

from clothsim.base.arrays import as_finite, as_positive
from clothsim.base.errors import InputError

EXTENDED = 490.3325
"""Force at which the extension of a fabric is given, 500 gf/cm, the largest of a KES tensile test [N/m]."""

THREADS = "warp_stiffness", "weft_stiffness", "shear_stiffness"
BENDINGS = "bending_warp", "bending_weft", "bending_bias"
SLOPES = "bending_slope", "bending_slope_warp", "bending_slope_weft", "bending_slope_bias"
HYSTERESES = "bending_hysteresis", "bending_hysteresis_warp", "bending_hysteresis_weft"
CURLS = "rest_curvature_warp", "rest_curvature_weft"


@dataclass(frozen=True)
class Fabric:
    """Material of a sheet; woven and knitted fabrics have orthotropic stiffnesses besides.

    Parameters
    ----------
    density : float
        Area density [kg/m2].
    thickness : float
        [m].
    youngs_modulus : float
        E of the material [Pa].
    poisson_ratio : float
        In (-1, 0.5].
    bending_stiffness : float
        D [N m].
    warp_stiffness, weft_stiffness, shear_stiffness : float, optional
        Of the threads [N/m] (see `energies.woven_membrane`); None: the isotropic ones.
    thread_poisson_ratio : float, optional
        Geometric mean of both Poisson ratios of the threads; None: poisson_ratio.
    warp_extension, weft_extension : float, optional
        Strain under `EXTENDED` of a strip cut along warp and weft (KES, EMT), for `strain_limit`.
    bending_warp, bending_weft, bending_bias : float, optional
        Bending stiffness of the sheet along warp, along weft, and at 45 degrees to them [N m]; None: bending_stiffness,
        and at 45 degrees what follows from those along warp and weft.
    bending_slope : float
        s [N m2] of the moment D k + s k^2 of a cylinder of curvature k; below 0 the sheet softens as it bends.
    bending_slope_warp, bending_slope_weft, bending_slope_bias : float, optional
        The same along warp, along weft and at 45 degrees; None: bending_slope, and at 45 degrees what follows from
        those along warp and weft.
    rest_curvature_warp, rest_curvature_weft : float
        Curvature of a strip at rest (natural curl) along warp and weft [1/m], above 0 towards the front.
    bending_hysteresis : float
        2HB, the width of the loop of moment over curvature [N m/m]: friction of half of it resists bending.
    bending_hysteresis_warp, bending_hysteresis_weft : float, optional
        The same along warp and weft; None: bending_hysteresis.
    hysteresis_curvature : float
        Change of curvature in which that friction grows to its limit [1/m].
    friction : float, optional
        Friction coefficient for the user's information; None where no source gives it.
    """

    density: float
    thickness: float
    youngs_modulus: float
    poisson_ratio: float
    bending_stiffness: float
    name: str = "custom"
    source: str = ""
    warp_stiffness: float | None = None
    weft_stiffness: float | None = None
    shear_stiffness: float | None = None
    thread_poisson_ratio: float | None = None
    warp_extension: float | None = None
    weft_extension: float | None = None
    bending_warp: float | None = None
    bending_weft: float | None = None
    bending_bias: float | None = None
    bending_slope: float = 0.0
    bending_slope_warp: float | None = None
    bending_slope_weft: float | None = None
    bending_slope_bias: float | None = None
    rest_curvature_warp: float = 0.0
    rest_curvature_weft: float = 0.0
    bending_hysteresis: float = 0.0
    bending_hysteresis_warp: float | None = None
    bending_hysteresis_weft: float | None = None
    hysteresis_curvature: float = 10.0
    friction: float | None = None

    def __post_init__(self) -> None:
        as_positive("density", self.density)
        as_positive("thickness", self.thickness)
        as_positive("youngs_modulus", self.youngs_modulus, zero=True)
        as_positive("bending_stiffness", self.bending_stiffness, zero=True)
        for name in (*THREADS, *BENDINGS, *HYSTERESES, "friction"):
            if getattr(self, name) is not None:
                as_positive(name, getattr(self, name), zero=True)
        for name in ("warp_extension", "weft_extension"):
            if getattr(self, name) is not None:
                as_positive(name, getattr(self, name))
        if not -1 < self.poisson_ratio <= 0.5:
            raise InputError(f"poisson_ratio must lie in (-1, 0.5], not {self.poisson_ratio!r}.")

        if self.thread_poisson_ratio is not None and not -1 < self.thread_poisson_ratio < 1:
            raise InputError(f"thread_poisson_ratio must lie in (-1, 1), not {self.thread_poisson_ratio!r}.")

        as_positive("hysteresis_curvature", self.hysteresis_curvature)
        for name in (*SLOPES, *CURLS):
            if getattr(self, name) is not None:
                as_finite(name, getattr(self, name))
        slopes = self.slope_along_warp, self.slope_along_weft, self.slope_along_bias
        if min(slopes) < 0 < max(slopes):
            raise InputError(
                "bending_slope is above 0 in one direction and below in another.", "Set the smaller one to 0."
            )
        if self.bending_bias is not None and not self._flexibility_of_twist > 0:
            raise InputError(
                f"bending_bias is {self.bending_bias!r} N m, which no twisting stiffness gives.",
                f"With those along warp and weft it is below {1 / self._flexibility_without_twist:.3g} N m.",
            )

    @property
    def shear_modulus(self) -> float:
        """mu = E2 / (2 (1 + nu)) [N/m], with the membrane stiffness E2 = E thickness."""
        return self.youngs_modulus * self.thickness / (2 * (1 + self.poisson_ratio))

    @property
    def lame_modulus(self) -> float:
        """Plane-stress lam = E2 nu / (1 - nu^2) [N/m]."""
        return self.youngs_modulus * self.thickness * self.poisson_ratio / (1 - self.poisson_ratio**2)

    @property
    def has_threads(self) -> bool:
        """True where the orthotropic sheet is its own: it has such a stiffness, or a negative Poisson ratio.

        The isotropic energy is unbounded below for lam < 0: lam/2 (ln J)^2 as J -> 0.
        """
        own = self.warp_stiffness, self.weft_stiffness, self.shear_stiffness, self.thread_poisson_ratio
        return self.poisson_ratio < 0 or any(value is not None for value in own)

    @property
    def stiffness_along_warp(self) -> float:
        """E1 [N/m]; E thickness where the fabric gives none."""
        return self._own(self.warp_stiffness, self.youngs_modulus * self.thickness)

    @property
    def stiffness_along_weft(self) -> float:
        """E2 [N/m]; E thickness where the fabric gives none."""
        return self._own(self.weft_stiffness, self.youngs_modulus * self.thickness)

    @property
    def stiffness_in_shear(self) -> float:
        """G [N/m]; mu where the fabric gives none."""
        return self._own(self.shear_stiffness, self.shear_modulus)

    @property
    def poisson_ratio_of_threads(self) -> float:
        """Square root of nu12 nu21; poisson_ratio where the fabric gives none."""
        return self._own(self.thread_poisson_ratio, self.poisson_ratio)

    @property
    def extension_along_warp(self) -> float:
        """Strain under `EXTENDED` along the warp; 0 where the fabric gives none."""
        return self._own(self.warp_extension, 0.0)

    @property
    def extension_along_weft(self) -> float:
        """Strain under `EXTENDED` along the weft; 0 where the fabric gives none."""
        return self._own(self.weft_extension, 0.0)

    @property
    def has_own_bending(self) -> bool:
        """True where the sheet bends differently along warp, weft or at 45 degrees."""
        return any(getattr(self, name) is not None for name in BENDINGS)

    @property
    def bending_along_warp(self) -> float:
        """D1 [N m]; bending_stiffness where the fabric gives none."""
        return self._own(self.bending_warp, self.bending_stiffness)

    @property
    def bending_along_weft(self) -> float:
        """D2 [N m]; bending_stiffness where the fabric gives none."""
        return self._own(self.bending_weft, self.bending_stiffness)

    @property
    def slope_along_warp(self) -> float:
        """s along the warp [N m2]; bending_slope where the fabric gives none."""
        return self._own(self.bending_slope_warp, self.bending_slope)

    @property
    def slope_along_weft(self) -> float:
        """s along the weft [N m2]; bending_slope where the fabric gives none."""
        return self._own(self.bending_slope_weft, self.bending_slope)

    @property
    def slope_along_bias(self) -> float:
        """s at 45 degrees [N m2]; where the fabric gives none, that of a sheet without a twist of its own.

        s^(2/3) = (w + f)/4 + sqrt(w f)/2, w and f the powers 2/3 of those along warp and weft.
        """
        if self.bending_slope_bias is not None:
            return self.bending_slope_bias
        warp, weft = abs(self.slope_along_warp) ** (2 / 3), abs(self.slope_along_weft) ** (2 / 3)
        size = ((warp + weft) / 4 + (warp * weft) ** 0.5 / 2) ** 1.5
        return size if self.slope_along_warp + self.slope_along_weft > 0 else -size

    @property
    def hysteresis_along_warp(self) -> float:
        """2HB along the warp [N m/m]; bending_hysteresis where the fabric gives none."""
        return self._own(self.bending_hysteresis_warp, self.bending_hysteresis)

    @property
    def hysteresis_along_weft(self) -> float:
        """2HB along the weft [N m/m]; bending_hysteresis where the fabric gives none."""
        return self._own(self.bending_hysteresis_weft, self.bending_hysteresis)

    @property
    def twisting_stiffness(self) -> float:
        """T of `kinematics.plate_law` [N m], for which a strip at 45 degrees bends with bending_bias (1 - nu^2).

        Without a bending_bias it is (1 - nu) sqrt(D1 D2) (Huber 1923).
        """
        if self.bending_bias is not None:
            return (1 - self.poisson_ratio**2) / (2 * self._flexibility_of_twist)
        return (1 - self.poisson_ratio) * (self.bending_along_warp * self.bending_along_weft) ** 0.5

    @property
    def _flexibility_without_twist(self) -> float:
        """Flexibility of the sheet at 45 degrees if it could not be twisted [1/(N m)]."""
        warp, weft = self.bending_along_warp, self.bending_along_weft
        if not warp * weft:
            return float("inf")
        return (1 / warp + 1 / weft - 2 * self.poisson_ratio / (warp * weft) ** 0.5) / 4

    @property
    def _flexibility_of_twist(self) -> float:
        """What twisting adds to that [1/(N m)]."""
        return (1 / self.bending_bias if self.bending_bias else float("inf")) - self._flexibility_without_twist

    @staticmethod
    def _own(value: float | None, isotropic: float) -> float:
        return isotropic if value is None else value
