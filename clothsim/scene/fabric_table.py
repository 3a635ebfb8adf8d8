"""Table of named fabrics: measurements with their sources and units, and their conversion to a `Fabric`.

WANG: Wang, O'Brien, Ramamoorthi 2011, "Data-driven elastic models for cloth: modeling and measurement", ACM Trans.
Graph. 30(4); their published material files. A row holds density [kg/m2], the stretch stiffness (c11, c12, c22, c33)
at zero strain [N/m] and the bending stiffness ke at the smallest curvature along 0, 45 and 90 degrees [N m], u = 0.
They are read as ARCSim (Narain, Samii, O'Brien 2012), of the same group, reads them: with the Green strain e

    c11 e11^2 + 2 c12 e11 e22 + c22 e22^2 + c33 e12^2 [J/m2],  so that C = 2 c and the shear modulus is c33/2,
    ke l^2 theta^2/(8 (A1 + A2)) [J] for a hinge,              so that D = ke/4 (ours: D l^2 theta^2/(2 (A1 + A2))).

v, the stiffer direction of every row, is taken for the warp. Of their ten fabrics the sweater (navy-sparkle-sweat) is
not here: c11 c22 < c12^2, no stable sheet.

PENAVA: Penava, Simic Penava, Knezic 2014, "Determination of the elastic constants of plain woven fabrics by a tensile
test in various directions", Fibres & Textiles in Eastern Europe 22(2), tables 1 and 3, as C-IPC (Li, Kaufman, Jiang
2021) uses them: density [kg/m2], thickness [m], Young's modulus [Pa], Poisson's ratio.

KES numbers in gf cm2/cm are 9.80665e-5 N m.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import sqrt

from clothsim.mesh.fabric import Fabric

GRAM_FORCE_CM = 9.80665e-5
"""1 gf cm2/cm, the unit of KES bending rigidity [N m]."""

_Row = tuple[str, float, tuple[float, float, float, float], tuple[float, float, float]]

WANG: Mapping[str, _Row] = {
    "denim": (
        "11oz-black-denim: jeans, 99 % cotton, 1 % spandex",
        0.324,
        (205.352005, 10.234077, 1013.88629, 53.387184),
        (64.196457e-6, 73.384567e-6, 96.951576e-6),
    ),
    "interlock": (
        "gray-interlock: T-shirt knit, 60 % cotton, 40 % polyester",
        0.187,
        (16.593832, -14.695990, 34.477123, 36.860302),
        (23.191698e-6, 24.749964e-6, 14.267624e-6),
    ),
    "rib_knit": (
        "ivory-rib-knit: underwear, 95 % cotton, 5 % spandex",
        0.276,
        (42.871021, -0.234556, 65.166023, 83.175644),
        (46.237591e-6, 30.015930e-6, 32.243889e-6),
    ),
    "ponte_roma": (
        "camel-ponte-roma: jacket knit, 60 % polyester, 40 % rayon",
        0.284,
        (31.146198, -12.802702, 44.028667, 31.896357),
        (36.348366e-6, 33.013252e-6, 37.157593e-6),
    ),
    "swimwear": (
        "white-swim-solid: swimsuit knit, 87 % nylon, 13 % spandex",
        0.204,
        (47.971176, 6.834521, 104.615456, 60.773663),
        (60.237942e-6, 58.803211e-6, 51.018833e-6),
    ),
    "jet_set": (
        "tango-red-jet-set: light jacket, 100 % polyester",
        0.113,
        (43.067627, 54.373299, 171.424835, 14.314700),
        (14.293814e-6, 21.951700e-6, 20.345654e-6),
    ),
    "blanket": (
        "pink-ribbon-brown: blanket, 100 % polyester",
        0.228,
        (151.503906, 106.028160, 244.830673, 30.250183),
        (117.070122e-6, 87.509773e-6, 59.774277e-6),
    ),
    "tablecloth": (
        "white-dots-on-blk: table cloth, 100 % polyester",
        0.128,
        (2002.08618, 0.345588, 2027.48559, 19.189022),
        (51.713814e-6, 40.659470e-6, 31.282822e-6),
    ),
    "trousers": (
        "royal-target: trousers, 65 % cotton, 35 % polyester",
        0.220,
        (2016.55456, 9.170511, 2034.97644, 104.759674),
        (125.409805e-6, 107.997696e-6, 125.409805e-6),
    ),
}

PENAVA: Mapping[str, tuple[str, float, float, float, float]] = {
    "cotton": ("plain weave, cotton", 0.150, 0.318e-3, 0.821e6, 0.243),
    "wool": ("plain weave, wool", 0.2348, 0.568e-3, 0.170e6, 0.277),
    "wool_lycra": ("plain weave, wool with Lycra", 0.1782, 0.328e-3, 0.076e6, 0.071),
    "polyester": ("plain weave, polyester", 0.1646, 0.252e-3, 0.478e6, 0.381),
}

BULK = 520.0
"""Density over thickness of the four fabrics of PENAVA, in the mean [kg/m3]."""
BENDING_LENGTH = 15e-3
"""Of a plain woven wool [m]: 15.0 along the warp and 14.5 mm along the weft in a SiroFAST-2 test."""

_WANG_IS = "Wang 2011"
_WANG_LONG = (
    "Wang, O'Brien, Ramamoorthi 2011, Data-driven elastic models for cloth: modeling and measurement, ACM Trans. "
    "Graph. 30(4), read as ARCSim (Narain, Samii, O'Brien 2012) reads it"
)
_PENAVA_IS = "Penava 2014"
_PENAVA_LONG = (
    "Penava, Simic Penava, Knezic 2014, Determination of the elastic constants of plain woven fabrics by a tensile "
    "test in various directions, Fibres & Textiles in Eastern Europe 22(2), tables 1 and 3, as C-IPC uses them"
)
_OF_WARP_AND_WEFT = "of warp and weft the geometric mean"


@dataclass(frozen=True)
class NamedFabric:
    """A fabric with the sources of its values.

    Parameters
    ----------
    fabric : Fabric
        The values.
    made_of : str
        Composition.
    measured_by : str
        Publication, in short.
    sources : dict of str to str
        Source of each value, or the rule of an estimate.
    """

    fabric: Fabric
    made_of: str
    measured_by: str
    sources: Mapping[str, str]

    @property
    def estimated(self) -> tuple[str, ...]:
        """The values that no source gives."""
        return tuple(key for key, source in self.sources.items() if source.startswith("estimated"))


def _of_wang(name: str, row: _Row) -> NamedFabric:
    made_of, density, (c11, c12, c22, c33), (across, _, along) = row
    nu = c12 / sqrt(c11 * c22)
    weft, warp = (2 * c * (1 - nu**2) for c in (c11, c22))
    thickness = density / BULK
    sources = {
        "density": _WANG_IS,
        "thickness": f"estimated: density over {BULK:g} kg/m3, the mean of the fabrics of Penava 2014",
        "warp_stiffness": f"{_WANG_IS}: the direction v at zero strain",
        "weft_stiffness": f"{_WANG_IS}: the direction u at zero strain",
        "shear_stiffness": f"{_WANG_IS}: c33/2",
        "thread_poisson_ratio": f"{_WANG_IS}: c12 over the root of c11 c22",
        "bending_warp": f"{_WANG_IS}: ke/4 along v",
        "bending_weft": f"{_WANG_IS}: ke/4 along u",
        "youngs_modulus": f"{_WANG_IS}: {_OF_WARP_AND_WEFT}, over the thickness",
        "poisson_ratio": "that of the threads, but within 0 and .5",
        "bending_stiffness": f"{_WANG_IS}: {_OF_WARP_AND_WEFT}",
    }
    fabric = Fabric(
        name=name,
        density=density,
        thickness=thickness,
        youngs_modulus=sqrt(warp * weft) / thickness,
        poisson_ratio=min(max(nu, 0.0), 0.5),
        bending_stiffness=sqrt(along * across) / 4,
        warp_stiffness=warp,
        weft_stiffness=weft,
        shear_stiffness=c33 / 2,
        thread_poisson_ratio=nu,
        bending_warp=along / 4,
        bending_weft=across / 4,
        source=_WANG_LONG,
    )
    return NamedFabric(fabric, made_of, _WANG_IS, sources)


def _of_penava(name: str, row: tuple[str, float, float, float, float]) -> NamedFabric:
    made_of, density, thickness, youngs_modulus, nu = row
    sources = dict.fromkeys(("density", "thickness", "youngs_modulus", "poisson_ratio"), _PENAVA_IS)
    if name == "cotton":
        bending = 5e-6
        rule = "estimated: typical of light plain cotton in KES tests, .05 gf cm2/cm = 4.9e-6 N m"
    else:
        bending = density * 9.80665 * BENDING_LENGTH**3
        rule = "estimated: density g c^3 with the bending length c = 15 mm of a plain woven wool in a SiroFAST test"
    sources |= {"bending_stiffness": rule}
    fabric = Fabric(density, thickness, youngs_modulus, nu, bending, name=name, source=_PENAVA_LONG)
    return NamedFabric(fabric, made_of, _PENAVA_IS, sources)


FRICTION: Mapping[str, tuple[float, str]] = {
    "denim": (
        0.28,
        "Friction dynamics of denim fabrics with washing or polishing treatment, preprint rs-7719155/v1: of another "
        "denim, unwashed, under a moving probe",
    ),
}
"""Coefficients of friction, where one is published."""


def _with_friction(name: str, named: NamedFabric) -> NamedFabric:
    friction, source = FRICTION[name]
    return replace(
        named, fabric=replace(named.fabric, friction=friction), sources={**named.sources, "friction": source}
    )


_MEASURED = {name: _of_penava(name, row) for name, row in PENAVA.items()} | {
    name: _of_wang(name, row) for name, row in WANG.items()
}
TABLE: Mapping[str, NamedFabric] = {
    name: _with_friction(name, named) if name in FRICTION else named for name, named in _MEASURED.items()
}
