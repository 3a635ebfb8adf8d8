"""A3, bending: cantilevers, the roll-up, the end shear, a loaded ring, a column and a deep beam that buckle."""

from functools import lru_cache, partial

import numpy as np

from clothsim.mesh.generators.shapes import rectangle
from tests.known_answers.a3_buckling import critical_weight
from tests.known_answers.elastica import deep_beam, loaded_ring, pushed_cantilever, rolled_up, upright_column
from tests.known_answers.plastic_strip import MESHES, tip_left, tip_of_beam
from tests.known_answers.plates import INNER, NU, OUTER, drooped, elastica, ring_deflection
from tests.known_answers.row import Outcome, Row
from tests.known_answers.strips import lattice_strip, random_ring, random_strip
from tests.known_answers.tied_plates import STIFFNESS, WIDTH, bent, end_shear, plate, tip, weight

RATIOS = {1: "0.12456177", 10: "1.06680232", 100: "5.88810462"}
"""Tip drop over tip reach of the cantilever as docs/results/validation.md prints it, by Gamma = rho_A g L^3/B."""
SECOND = (1.9, 3.0)
LOADS = (0.1, 0.2, 0.4, 0.7, 1.0)
"""Shares of a large weight that are laid on one after the other."""


def order(coarse: float, fine: float, exact: float) -> float:
    """log2 of the ratio of two errors, the mesh of the second being twice as fine."""
    return float(np.log2(abs((coarse - exact) / (fine - exact))))


def _against(coarse: float, fine: float, exact: float, printed: str, hinges: float | None = None) -> Outcome:
    observed = order(coarse, fine, exact)
    return Outcome(fine, exact, 5e-3, printed=printed, order=observed, orders=SECOND, hinges=hinges)


def _tied(gamma: int, diagonals: str) -> Outcome:
    def ratio(cells: int) -> float:
        p = plate(cells, diagonals)
        slopes = np.zeros(cells)
        for fraction in (1.0,) if gamma < 100 else LOADS:
            slopes = bent(p, "hinge", weight(p, fraction * gamma), start=slopes)
        reach, drop = tip(p, slopes)
        return drop / reach

    return _against(ratio(20), ratio(40), elastica(gamma), RATIOS[gamma])


def _free(gamma: int) -> Outcome:
    """Its order is only reported: the membrane's own stretch adds up to .1 % that no mesh takes away."""
    coarse, fine = (drooped(*lattice_strip(cells, 0), "midedge", gamma) for cells in (20, 40))
    exact, hinges = elastica(gamma), drooped(*lattice_strip(40, 0), "hinge", gamma)
    return Outcome(fine, exact, 5e-3, printed=RATIOS[gamma], order=order(coarse, fine, exact), hinges=hinges)


@lru_cache
def _cuts(gamma: int) -> tuple[float, ...]:
    """Drop over reach of strips cut out at 0, 45, 90 and 135 degrees and of one of points at random, with midedge."""
    meshes = [*(lattice_strip(40, degrees) for degrees in (0, 45, 90, 135)), random_strip(40, 0)]
    return tuple(drooped(*mesh, "midedge", gamma) for mesh in meshes)


def _worst_cut(gamma: int) -> Outcome:
    exact = elastica(gamma)
    worst = max(_cuts(gamma), key=lambda ratio: abs(ratio - exact))
    return Outcome(worst, exact, 5e-3, printed=RATIOS[gamma])


def _spread(gamma: int) -> Outcome:
    fraction = (max(_cuts(gamma)) - min(_cuts(gamma))) / elastica(gamma)
    return Outcome(100 * fraction, 0.0, 2.0, unit="%")


def _woven(warp_degrees: float, own: float) -> Outcome:
    """A strip of a fabric with D = 4 along the warp and .5 along the weft: the elastica of its `own`."""

    def ratio(cells: int) -> float:
        strip = lattice_strip(cells, 0)
        return drooped(*strip, "midedge", 10, warp_degrees, bending_warp=4.0, bending_weft=0.5)

    coarse, fine = ratio(20), ratio(40)
    return Outcome(fine, elastica(10 / own), 5e-3, order=order(coarse, fine, elastica(10 / own)))


def _roll(turns: float, part: int, model: str) -> Outcome:
    p = plate(40)
    found = tip(p, bent(p, model, moment=2 * np.pi * turns * STIFFNESS * WIDTH))[part]
    return Outcome(found, rolled_up(turns)[part], 5e-3)


def _shear(part: int, printed: str) -> Outcome:
    """The tip under an end shear of 4: how far down (1), how much nearer (0)."""

    def found(reach: float, drop: float) -> float:
        return drop if part else 1 - reach

    plates = [plate(cells) for cells in (20, 40)]
    coarse, fine = (found(*tip(p, bent(p, "hinge", end_shear(p, 4)))) for p in plates)
    return _against(coarse, fine, found(*pushed_cantilever(4)), printed)


def _ring() -> Outcome:
    coarse, fine = (ring_deflection(*random_ring(cells, 0, INNER, OUTER), "midedge") for cells in (6, 12))
    exact, hinges = loaded_ring(INNER, OUTER, NU), ring_deflection(*random_ring(12, 0, INNER, OUTER), "hinge")
    observed = order(coarse, fine, exact)
    return Outcome(fine, exact, 1e-2, printed="0.00350753", order=observed, orders=(1.8, 3.0), hinges=hinges)


def _column() -> Outcome:
    coarse, fine = (critical_weight(*lattice_strip(cells, 0), (-1.0, 0.0)) for cells in (20, 40))
    hinges = critical_weight(*lattice_strip(40, 0), (-1.0, 0.0), model="hinge")
    return _against(coarse, fine, upright_column(), "7.83734744", hinges)


def _beam(nu: float) -> Outcome:
    """Over sqrt(2/(1 + nu)), a beam of no width: what a clamp adds to one of some width is proportional to it."""
    scale = np.sqrt(2 / (1 + nu))
    found, hinges = ((2 * _deep(0.05, nu, model) - _deep(0.1, nu, model)) / scale for model in ("midedge", "hinge"))
    return Outcome(float(found), deep_beam(nu) / scale, 5e-3, printed="12.853763", hinges=float(hinges))


def _deep(width: float, nu: float, model: str) -> float:
    positions, triangles = rectangle((1.0, width), (round(8 / width), 16))
    return critical_weight(positions[:, :2] + [0.5, width / 2], triangles, (0.0, -1.0), nu, model)


def _plastic() -> Outcome:
    coarse, fine = (tip_left(10, cells=cells) for cells in MESHES)
    exact = tip_of_beam()
    observed = order(coarse, fine, exact) / np.log2(MESHES[1] / MESHES[0])
    return Outcome(fine, exact, 1e-2, printed="0.00200000", order=float(observed), orders=(1.9, 6.0))


CANTILEVER = "cantilever, {}, Gamma {}: drop / reach"


def _cantilevers() -> tuple[Row, ...]:
    """Hinges on a tied strip; midedge on a free one, then on five cuts and meshes."""
    tied = [(1, "right"), (10, "right"), (100, "right"), (10, "alternating")]
    rows = [
        (CANTILEVER.format(f"hinges, tied columns, {diagonals} diagonals", gamma), partial(_tied, gamma, diagonals))
        for gamma, diagonals in tied
    ]
    rows += [(CANTILEVER.format("midedge, free strip", gamma), partial(_free, gamma)) for gamma in RATIOS]
    rows += [(CANTILEVER.format("worst of five cuts and meshes", g), partial(_worst_cut, g)) for g in RATIOS]
    rows += [(f"cantilever, spread over these five, Gamma {gamma} [%]", partial(_spread, gamma)) for gamma in RATIOS]
    return tuple(Row(f"A3{letter}", what, run) for letter, (what, run) in zip("abcdefghijklm", rows, strict=True))


ROWS = (
    *_cantilevers(),
    Row("A3n", "roll-up by half a turn, hinges: drop / length", partial(_roll, 0.5, 1, "hinge")),
    Row("A3o", "roll-up by a quarter turn, midedge: reach / length", partial(_roll, 0.25, 0, "midedge")),
    Row("A3p", "end shear of 4, hinges: drop / length", partial(_shear, 1, "0.66996418")),
    Row("A3q", "end shear of 4, hinges: (length - reach) / length", partial(_shear, 0, "0.32894124")),
    Row("A3r", "loaded ring, midedge, random mesh, 12 cells: w D/(q b^4)", _ring),
    Row("A3s", "column that buckles under its weight, midedge: Gamma", _column),
    Row("A3t", "deep beam that tips over, midedge, nu = 0: Gamma / sqrt(2/(1 + nu))", partial(_beam, 0.0)),
    Row("A3u", "deep beam that tips over, midedge, nu = 0.3: Gamma / sqrt(2/(1 + nu))", partial(_beam, 0.3)),
    Row("A3v", "cantilever cut along the warp, D = 4, Gamma 10: drop / reach", partial(_woven, 0.0, 4.0)),
    Row("A3w", "the same, cut along the weft, D = 0.5", partial(_woven, 90.0, 0.5)),
    Row("A3x", "cantilever loaded past its yield in 10 steps, H = 0.5, then unloaded: tip / length", _plastic),
)
