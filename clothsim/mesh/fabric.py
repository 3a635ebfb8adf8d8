"""What a cloth is made of."""

from dataclasses import dataclass

from clothsim.arrays import as_positive
from clothsim.errors import InputError


@dataclass(frozen=True)
class Fabric:
    """An isotropic sheet.

    density: area density [kg/m2]; thickness [m]; youngs_modulus E of the material [Pa]; poisson_ratio in (-1, 0.5];
    bending_stiffness D [N m].
    """

    density: float
    thickness: float
    youngs_modulus: float
    poisson_ratio: float
    bending_stiffness: float
    name: str = "custom"
    source: str = ""

    def __post_init__(self) -> None:
        as_positive("density", self.density)
        as_positive("thickness", self.thickness)
        as_positive("youngs_modulus", self.youngs_modulus, zero=True)
        as_positive("bending_stiffness", self.bending_stiffness, zero=True)
        if not -1 < self.poisson_ratio <= 0.5:
            raise InputError(f"poisson_ratio must lie in (-1, 0.5], not {self.poisson_ratio!r}.")

    @property
    def shear_modulus(self) -> float:
        """mu = E2 / (2 (1 + nu)) [N/m], with the membrane stiffness E2 = E thickness."""
        return self.youngs_modulus * self.thickness / (2 * (1 + self.poisson_ratio))

    @property
    def lame_modulus(self) -> float:
        """Plane-stress lam = E2 nu / (1 - nu^2) [N/m]."""
        return self.youngs_modulus * self.thickness * self.poisson_ratio / (1 - self.poisson_ratio**2)
