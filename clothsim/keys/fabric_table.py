"""Table of named fabrics: measurements with their sources and units, and their conversion to a `Fabric`.

A fabric is one row, of the class of its publication.

WANG: Wang, O'Brien, Ramamoorthi 2011, "Data-driven elastic models for cloth: modeling and measurement", ACM Trans.
Graph. 30(4); their published material files. A row holds density [kg/m2], the stretch stiffness (c11, c12, c22, c33)
at zero strain [N/m] and the bending stiffness ke at the smallest curvature along 0, 45 and 90 degrees [N m], u = 0.
They are read as ARCSim (Narain, Samii, O'Brien 2012), of the same group, reads them: with the Green strain e

    c11 e11^2 + 2 c12 e11 e22 + c22 e22^2 + c33 e12^2 [J/m2],  so that C = 2 c and the shear modulus is c33/2,
    ke l^2 theta^2/(8 (A1 + A2)) [J] for a hinge,              so that D = ke/4 (ours: D l^2 theta^2/(2 (A1 + A2))).

v, the stiffer direction of every row, is taken for the warp, and the third ke for the bending along it. ARCSim's code
finds ke by the direction of the edge about which the cloth bends, by which the third would be along u. Of the rows only
denim and jet_set are so much stiffer one way (5 and 4 times) that their warp is sure, and both have the larger third
ke: a warp bends stiffer than a weft, as the fabrics of FENG do in the median. So the direction is read as that of the
strip that was bent. Of their ten fabrics the sweater (navy-sparkle-sweat) is
not here: c11 c22 < c12^2, no stable sheet.

PENAVA: Penava, Simic Penava, Knezic 2014, "Determination of the elastic constants of plain woven fabrics by a tensile
test in various directions", Fibres & Textiles in Eastern Europe 22(2), tables 1 and 3, as C-IPC (Li, Kaufman, Jiang
2021) uses them: density [kg/m2], thickness [m], Young's modulus [Pa], Poisson's ratio.

FENG: Feng, Huang, Xu, Wang 2022, "Learning-based bending stiffness parameter estimation by a drape tester", ACM Trans.
Graph. 41(6): cantilevers of 618 fabrics. What is here are facts found in them: medians of the bending stiffness [N m]
of those of like weight (within a quarter), and the percentile of each fabric among them.

KES numbers in gf cm2/cm are 9.80665e-5 N m; a shear stiffness of 1 gf/(cm degree) is 56.19 N/m.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from math import pi, sqrt
from typing import Any

from clothsim.base.errors import InputError
from clothsim.base.inputs import did_you_mean
from clothsim.keys.fabric import Fabric

SHEAR_UNIT = 98.0665 * 1e-2 * 180 / pi
"""1 gf/(cm degree), the unit of KES shear stiffness [N/m]."""

BULK = 520.0, "the mean of the fabrics of Penava 2014"
"""Density over thickness of the four fabrics of PENAVA, in the mean [kg/m3]."""
KNIT_BULK = 250.0, "typical of knits: .7 to 1 mm at .19 kg/m2"
"""Density over thickness of double-faced knits [kg/m3]: interlock of .19 kg/m2 is .75 mm thick."""
DENIMS = "KES of a cotton denim, Journal of Textiles 2016, 4614168, table 5, sample A"

_FENG_IS = "Feng 2022"
_FENG_LONG = (
    "Feng, Huang, Xu, Wang 2022, Learning-based bending stiffness parameter estimation by a drape tester, ACM Trans. "
    "Graph. 41(6)"
)
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
_LIKE_DENIM = f"estimated: {_FENG_IS}, the median of 122 fabrics of like weight"


@dataclass(frozen=True)
class Comparison:
    """A fabric's simulated drape and its bending beside measured fabrics.

    Parameters
    ----------
    coefficient : float
        Drape coefficient by `clothsim test`, 2 lays [%].
    stiffer_than : int
        Percentile of sqrt(D_warp D_weft) among the fabrics of FENG of like weight.
    of : int
        Their number.
    published : (float, float), optional
        Range of published Cusick tests of such fabrics [%]; None where none was found.
    size : float
        Of the mesh [mm]; at 6 the coefficient is 1 to 4 points below that at 4.
    """

    coefficient: float
    stiffer_than: int
    of: int
    published: tuple[float, float] | None = None
    size: float = 6.0


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
    compared : Comparison
        Its drape and bending beside those of measured fabrics.
    """

    fabric: Fabric
    made_of: str
    measured_by: str
    sources: Mapping[str, str]
    compared: Comparison

    @property
    def estimated(self) -> tuple[str, ...]:
        """The values that no source gives."""
        return tuple(key for key, source in self.sources.items() if source.startswith("estimated"))


@dataclass(frozen=True)
class Row(ABC):
    """What is known of a fabric.

    Parameters
    ----------
    made_of : str
        Composition.
    density : float
        [kg/m2].
    extension : (float, float, str)
        Strains along warp and weft under 490 N/m, and their source.
    compared : Comparison
        Measured on 2026-11-24.
    others : dict of str to (float, str)
        Values of other sources, which replace those of the row.
    """

    made_of: str
    density: float
    extension: tuple[float, float, str]
    compared: Comparison
    others: Mapping[str, tuple[float, str]] = field(default_factory=dict, kw_only=True)

    @abstractmethod
    def _measured(self) -> tuple[Fabric, str, dict[str, str]]:
        """The fabric of the row alone, its publication in short, and the source of each value."""

    def named(self, name: str) -> NamedFabric:
        """The fabric of this name, with its extensions and the values of other sources."""
        fabric, publication, sources = self._measured()
        warp, weft, source = self.extension
        values = {"warp_extension": (warp, source), "weft_extension": (weft, source), **self.others}
        numbers: dict[str, Any] = {key: value for key, (value, _) in values.items()}
        sources |= {key: text for key, (_, text) in values.items()}
        return NamedFabric(replace(fabric, name=name, **numbers), self.made_of, publication, sources, self.compared)


@dataclass(frozen=True)
class PenavaRow(Row):
    """A row of PENAVA; like_weight: of FENG, the number of fabrics of like weight and their median bending [N m]."""

    thickness: float
    youngs_modulus: float
    poisson_ratio: float
    like_weight: tuple[int, float]

    def _measured(self) -> tuple[Fabric, str, dict[str, str]]:
        count, bending = self.like_weight
        sources = dict.fromkeys(("density", "thickness", "youngs_modulus", "poisson_ratio"), _PENAVA_IS)
        sources["bending_stiffness"] = f"estimated: {_FENG_IS}, the median of {count} fabrics of like weight"
        values = self.density, self.thickness, self.youngs_modulus, self.poisson_ratio, bending
        return Fabric(*values, source=_PENAVA_LONG), _PENAVA_IS, sources


@dataclass(frozen=True)
class WangRow(Row):
    """A row of WANG: c11, c12, c22, c33; ke at 0, 45 and 90 degrees; density over thickness [kg/m3] and its source."""

    stretch: tuple[float, float, float, float]
    bending: tuple[float, float, float]
    bulk: tuple[float, str] = BULK

    def _measured(self) -> tuple[Fabric, str, dict[str, str]]:
        (c11, c12, c22, c33), (across, bias, along) = self.stretch, self.bending
        nu = c12 / sqrt(c11 * c22)
        weft, warp = (2 * c * (1 - nu**2) for c in (c11, c22))
        bulk, rule = self.bulk
        thickness = self.density / bulk
        sources = {
            "density": _WANG_IS,
            "thickness": f"estimated: density over {bulk:g} kg/m3, {rule}",
            "warp_stiffness": f"{_WANG_IS}: the direction v at zero strain",
            "weft_stiffness": f"{_WANG_IS}: the direction u at zero strain",
            "shear_stiffness": f"{_WANG_IS}: c33/2",
            "thread_poisson_ratio": f"{_WANG_IS}: c12 over the root of c11 c22",
            "bending_warp": f"{_WANG_IS}: ke/4 along v",
            "bending_weft": f"{_WANG_IS}: ke/4 along u",
            "bending_bias": f"{_WANG_IS}: ke/4 at 45 degrees",
            "youngs_modulus": f"{_WANG_IS}: {_OF_WARP_AND_WEFT}, over the thickness",
            "poisson_ratio": "that of the threads, but at least 0, for the isotropic sheet, and at most .5",
            "bending_stiffness": f"{_WANG_IS}: {_OF_WARP_AND_WEFT}",
        }
        fabric = Fabric(
            density=self.density,
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
            bending_bias=bias / 4,
            source=_WANG_LONG,
        )
        return fabric, _WANG_IS, sources


@dataclass(frozen=True)
class WeaveRow(Row):
    """Medians of FENG, of density and of the bending stiffness along warp, weft and bias [N m]."""

    bending: tuple[float, float, float]

    def _measured(self) -> tuple[Fabric, str, dict[str, str]]:
        warp, weft, bias = self.bending
        bulk, rule = BULK
        median = f"{_FENG_IS}: median of {self.made_of}"
        sources = {
            "density": median,
            "thickness": f"estimated: density over {bulk:g} kg/m3, {rule}",
            **dict.fromkeys(("youngs_modulus", "poisson_ratio"), "estimated: that of the cotton of Penava 2014"),
            "shear_stiffness": "estimated: .8 gf/(cm degree), typical of plain weaves in KES tests",
            **dict.fromkeys(("bending_warp", "bending_weft", "bending_bias"), median),
            "bending_stiffness": f"{median}, {_OF_WARP_AND_WEFT}",
        }
        fabric = Fabric(
            density=self.density,
            thickness=self.density / bulk,
            youngs_modulus=PENAVA["cotton"].youngs_modulus,
            poisson_ratio=PENAVA["cotton"].poisson_ratio,
            bending_stiffness=sqrt(warp * weft),
            source=_FENG_LONG,
            shear_stiffness=0.8 * SHEAR_UNIT,
            bending_warp=warp,
            bending_weft=weft,
            bending_bias=bias,
        )
        return fabric, _FENG_IS, sources


PENAVA: Mapping[str, PenavaRow] = {
    "cotton": PenavaRow(
        "plain weave, cotton", 0.150, (0.05, 0.05, "estimated: typical of plain cotton in KES tests"),
        Comparison(62.7, 50, 103, (60, 76), size=4.0), 0.318e-3, 0.821e6, 0.243, (103, 9.2e-6),
    ),
    "wool": PenavaRow(
        "plain weave, wool", 0.2348, (0.06, 0.08, "estimated: typical of plain wool suitings in KES tests"),
        Comparison(61.6, 49, 167, (40, 70)), 0.568e-3, 0.170e6, 0.277, (167, 17.7e-6),
    ),
    "wool_lycra": PenavaRow(
        "plain weave, wool with Lycra", 0.1782, (0.08, 0.2, "estimated: typical of wool with elastane in the weft"),
        Comparison(61.8, 51, 133), 0.328e-3, 0.076e6, 0.071, (133, 15.5e-6),
    ),
    "polyester": PenavaRow(
        "plain weave, polyester", 0.1646, (0.04, 0.05, "estimated: typical of plain polyester in KES tests"),
        Comparison(66.9, 50, 120), 0.252e-3, 0.478e6, 0.381, (120, 13.7e-6),
    ),
}  # fmt: skip

WANG: Mapping[str, WangRow] = {
    "denim": WangRow(
        "11oz-black-denim: jeans, 99 % cotton, 1 % spandex", 0.324,
        (0.05515, 0.05515, f"{DENIMS}: EMT, mean of warp and weft"), Comparison(70.7, 51, 122, (70, 90), size=4.0),
        (205.352005, 10.234077, 1013.88629, 53.387184), (64.196457e-6, 73.384567e-6, 96.951576e-6),
        # by its row it would bend with 24.2, 16.0 and 18.3 uN m and drape to 61 %, below every denim (70 to 90 %), and
        # shear with .48 gf/(cm degree): six measured denims have 1.5 to 3.4
        others={
            "friction": (
                0.28,
                "Friction dynamics of denim fabrics with washing or polishing treatment, preprint rs-7719155/v1: of "
                "another denim, unwashed, under a moving probe",
            ),
            "shear_stiffness": (2.180 * SHEAR_UNIT, f"{DENIMS}: 2.18 gf/(cm degree)"),
            "bending_warp": (30.2e-6, _LIKE_DENIM),
            "bending_weft": (23.4e-6, _LIKE_DENIM),
            "bending_bias": (28.5e-6, _LIKE_DENIM),
            "bending_stiffness": (sqrt(30.2e-6 * 23.4e-6), f"{_LIKE_DENIM}, {_OF_WARP_AND_WEFT}"),
        },
    ),
    "interlock": WangRow(
        "gray-interlock: T-shirt knit, 60 % cotton, 40 % polyester", 0.187,
        (0.3, 0.5, "estimated: typical of cotton interlocks, wider across the wales"), Comparison(38.3, 20, 136),
        (16.593832, -14.695990, 34.477123, 36.860302), (23.191698e-6, 24.749964e-6, 14.267624e-6), KNIT_BULK,
    ),
    "rib_knit": WangRow(
        "ivory-rib-knit: underwear, 95 % cotton, 5 % spandex", 0.276,
        (0.35, 0.6, "estimated: typical of ribs with elastane, wider across the wales"), Comparison(39.4, 29, 145),
        (42.871021, -0.234556, 65.166023, 83.175644), (46.237591e-6, 30.015930e-6, 32.243889e-6), KNIT_BULK,
    ),
    "ponte_roma": WangRow(
        "camel-ponte-roma: jacket knit, 60 % polyester, 40 % rayon", 0.284,
        (0.25, 0.35, "estimated: typical of double jerseys"), Comparison(37.8, 25, 151),
        (31.146198, -12.802702, 44.028667, 31.896357), (36.348366e-6, 33.013252e-6, 37.157593e-6), KNIT_BULK,
    ),
    "swimwear": WangRow(
        "white-swim-solid: swimsuit knit, 87 % nylon, 13 % spandex", 0.204,
        (0.6, 0.8, "estimated: typical of warp knits with elastane"), Comparison(61.7, 48, 161),
        (47.971176, 6.834521, 104.615456, 60.773663), (60.237942e-6, 58.803211e-6, 51.018833e-6),
        (400.0, "typical of warp knits with elastane: about .5 mm at .2 kg/m2"),
    ),
    "jet_set": WangRow(
        "tango-red-jet-set: light jacket, 100 % polyester", 0.113,
        (0.05, 0.05, "estimated: typical of light woven polyester"), Comparison(44.6, 41, 108),
        (43.067627, 54.373299, 171.424835, 14.314700), (14.293814e-6, 21.951700e-6, 20.345654e-6),
    ),
    "blanket": WangRow(
        "pink-ribbon-brown: blanket, 100 % polyester", 0.228, (0.2, 0.3, "estimated: typical of brushed knits"),
        Comparison(66.9, 59, 181), (151.503906, 106.028160, 244.830673, 30.250183),
        (117.070122e-6, 87.509773e-6, 59.774277e-6), (90.0, "typical of brushed polyester: 2 to 4 mm at .23 kg/m2"),
    ),
    "tablecloth": WangRow(
        "white-dots-on-blk: table cloth, 100 % polyester", 0.128,
        (0.05, 0.05, "estimated: typical of plain weaves in KES tests"), Comparison(70.3, 67, 102),
        (2002.08618, 0.345588, 2027.48559, 19.189022), (51.713814e-6, 40.659470e-6, 31.282822e-6),
    ),
    "trousers": WangRow(
        "royal-target: trousers, 65 % cotton, 35 % polyester", 0.220,
        (0.05, 0.07, "estimated: typical of woven trouserings in KES tests"), Comparison(81.0, 76, 176),
        (2016.55456, 9.170511, 2034.97644, 104.759674), (125.409805e-6, 107.997696e-6, 125.409805e-6),
    ),
}  # fmt: skip

_PLAIN = 0.05, 0.06, "estimated: typical of plain weaves in KES tests"
WEAVES: Mapping[str, WeaveRow] = {
    "light_weave": WeaveRow(
        "the lightest third of 618 fabrics, below 126 g/m2", 0.0774, _PLAIN, Comparison(46.5, 43, 56),
        (3.10e-6, 3.09e-6, 2.91e-6),
    ),
    "medium_weave": WeaveRow(
        "the middle third of 618 fabrics, 126 to 250 g/m2", 0.1965, _PLAIN, Comparison(60.6, 47, 149),
        (15.4e-6, 9.99e-6, 12.1e-6),
    ),
    "heavy_weave": WeaveRow(
        "the heaviest third of 618 fabrics, above 250 g/m2", 0.3672, _PLAIN, Comparison(67.8, 56, 112),
        (39.9e-6, 25.8e-6, 29.6e-6),
    ),
}  # fmt: skip

TABLE: Mapping[str, NamedFabric] = {
    name: row.named(name) for rows in (PENAVA, WANG, WEAVES) for name, row in rows.items()
}
FABRICS = {name: named.fabric for name, named in TABLE.items()}


SIMILAR = 0.6
"""Similarity from 0 to 1 of a name that is asked about, "Did you mean ...?"."""


def fabric_named(where: str, name: Any) -> Fabric:
    """The fabric of a name.

    Parameters
    ----------
    where : str
        Dotted name of the value, for messages.
    name : str
        A name of FABRICS.

    Raises
    ------
    InputError
        For an unknown name, with the nearest known one.

    Examples
    --------
    >>> fabric_named("cloth.fabric", "cotton").density
    0.15
    """
    if isinstance(name, str) and name in FABRICS:
        return FABRICS[name]
    known = f"Known: {', '.join(FABRICS)}."
    raise InputError(f"{where} is {name!r}.", f"{did_you_mean(name, FABRICS, SIMILAR)} {known}".strip())


def fabrics_of(where: str, panels: Collection[str], given: Mapping[str, Any]) -> dict[str, Fabric]:
    """The fabric of each panel that has one of its own.

    Parameters
    ----------
    where : str
        Dotted name of the table, for messages.
    panels : collection of str
        Names of all panels.
    given : mapping
        Named fabric by panel; a name with `*` or `?` stands for all panels that it matches and that are not named
        themselves.

    Raises
    ------
    InputError
        For an unknown fabric, a name that is of no panel, and two that match one panel with different fabrics.

    Examples
    --------
    >>> found = fabrics_of("cloth.fabric_of", ["front", "cuff_l", "cuff_r"], {"cuff*": "denim", "cuff_l": "wool"})
    >>> {panel: fabric.name for panel, fabric in found.items()}
    {'cuff_l': 'wool', 'cuff_r': 'denim'}
    """
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        raise InputError(f"{where} must be a table of fabrics by panel, not {given!r}.", 'As {"collar": "denim"}.')
    found: dict[str, Fabric] = {}
    for name, value in given.items():
        fabric = fabric_named(f"{where}.{name}", value)
        matched = [name] if name in panels else [panel for panel in panels if fnmatchcase(panel, name)]
        if not matched:
            known = f"Panels: {', '.join(panels)}." if panels else "The mesh names no panel or group."
            hint = f"{did_you_mean(name, panels, SIMILAR)} {known}".strip()
            raise InputError(f"{where} names the panel {name!r}.", hint)
        for panel in matched:
            if panel != name and panel in given:
                continue
            if found.get(panel, fabric) != fabric:
                raise InputError(
                    f"{where} gives the panel {panel} the fabrics {found[panel].name} and {fabric.name}.",
                    "Name the panel itself too.",
                )
            found[panel] = fabric
    return {panel: found[panel] for panel in panels if panel in found}
