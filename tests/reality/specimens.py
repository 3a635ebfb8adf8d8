"""What is a specimen's own: outlines of its lays beside one another, turned over, and beside other specimens'.

Turned over about the axis x, a specimen whose rest curvature decides its folds has a crest where it had a valley, and
its outline is mirrored: r'(theta) - mean = -(r(-theta) - mean). So the outlines of both sides are compared as they lie
and with one of them mirrored and its sign reversed. All correlations are over the harmonics that count as folds.
"""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.study.standard_tests.cusick import FOLDS, outline_shape
from tests.benchmarks.stored_tables import markdown_table

HEADER = ("fabric", "same side", "turned", "turned, reversed", "other specimens, reversed", "fold slope")
SIDES = (1, 2), (3, 4)
"""Captures of one side and of the other."""
LEAST = 4
"""Specimens from which on there is a row."""
STIFF = 0.6
"""Coefficient above which a fabric's fold slope is pooled."""


def folds_of(radii: Floats) -> Floats:
    """Outlines (n, 360) without mean and shift, of unit norm, (n, 360)."""
    waves = np.fft.rfft(radii, axis=1)
    waves[:, : FOLDS.start], waves[:, FOLDS.stop :] = 0, 0
    r = np.fft.irfft(waves, radii.shape[1], axis=1)
    return np.asarray(r / np.linalg.norm(r, axis=1)[:, None])


def reversed_folds(folds: Floats) -> Floats:
    """The folds (n, 360) of the same specimens turned over, if rest curvature alone decided them."""
    return -np.roll(folds[:, ::-1], 1, axis=1)


def slope(groups: list[Floats]) -> tuple[float, float]:
    """Points of the coefficient by a fold within groups of (coefficient, n_eff, ...), and its standard error."""
    centred = np.concatenate([each - each.mean(axis=0) for each in groups])
    y, x = 100 * centred[:, 0], centred[:, 1]
    value = (x @ y) / (x @ x)
    left = len(y) - len(groups) - 1
    return float(value), float(np.sqrt(((y - value * x) ** 2).sum() / left / (x @ x)))


def rows(labels: Ints, radii: Floats) -> list[list[str]]:
    """Correlations and fold slope of each fabric with `LEAST` specimens that were turned over.

    Parameters
    ----------
    labels : (n, 4)
        Fabric, session, specimen, capture of lays.
    radii : (n, 360)
        Their outlines [m].
    """
    found = []
    for fabric in np.unique(labels[:, 0]):
        sides = _sides(labels, radii, fabric)
        both = sorted(sides[0].keys() & sides[1].keys())
        if len(both) >= LEAST:
            found.append([str(fabric), *_correlations(sides, both), _written(*slope(slope_groups(sides)))])
    return found


def text(labels: Ints, radii: Floats) -> str:
    """The table in Markdown, and the fold slope of stiff cloth."""
    stiff = [each for fabric in np.unique(labels[:, 0]) for each in _groups(labels, radii, fabric) if _is_stiff(each)]
    return (
        f"{markdown_table(HEADER, rows(labels, radii))}\n\nOver the fabrics with coefficients above "
        f"{100 * STIFF:.0f} %, the fold slope is {_written(*slope(stiff))} points per fold "
        f"({sum(map(len, stiff))} means of a specimen with one side up)."
    )


def _groups(labels: Ints, radii: Floats, fabric: int) -> list[Floats]:
    return [each for each in slope_groups(_sides(labels, radii, fabric)) if len(each) >= LEAST]


def _is_stiff(group: Floats) -> bool:
    return bool(group[:, 0].mean() > STIFF)


def _sides(labels: Ints, radii: Floats, fabric: int) -> list[dict[int, Floats]]:
    """Outlines of each specimen of a fabric's first session, by the side that was up."""
    of_it = labels[:, 0] == fabric
    chosen = of_it & (labels[:, 1] == labels[of_it, 1].min())
    return [by_specimen(labels[chosen], radii[chosen], captures) for captures in SIDES]


def by_specimen(labels: Ints, radii: Floats, captures: tuple[int, ...]) -> dict[int, Floats]:
    """Outlines (k, 360) of the captures of each specimen of one fabric."""
    of_side = np.isin(labels[:, 3], captures)
    return {int(s): radii[of_side & (labels[:, 2] == s)] for s in np.unique(labels[of_side, 2])}


def slope_groups(sides: list[dict[int, Floats]]) -> list[Floats]:
    """Means of (coefficient, n_eff) of the specimens, a group for each side."""
    return [np.array([_shapes(radii).mean(axis=0) for radii in side.values()]) for side in sides]


def _shapes(radii: Floats) -> Floats:
    shapes = [outline_shape(each) for each in radii]
    return np.array([[each.coefficient, each.folds] for each in shapes])


def _correlations(sides: list[dict[int, Floats]], both: list[int]) -> list[str]:
    first, second = ({s: folds_of(side[s]) for s in both} for side in sides)
    same = [each[0] @ each[1] for side in (first, second) for each in side.values() if len(each) > 1]
    turned = [(first[s] @ second[s].T).mean() for s in both]
    back = [(first[s] @ reversed_folds(second[s]).T).mean() for s in both]
    other = [(first[s] @ reversed_folds(second[t]).T).mean() for s in both for t in both if s != t]
    by_chance = np.std(other, ddof=1) / np.sqrt(len(back))
    reversed_ = _written(float(np.mean(back)), float(by_chance))
    return [f"{np.median(same):.2f}", f"{np.mean(turned):.2f}", reversed_, f"{np.mean(other):.2f}"]


def _written(value: float, error: float) -> str:
    return f"{value:.2f} +- {error:.2f}"
