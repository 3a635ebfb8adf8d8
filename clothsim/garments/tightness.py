"""Tight parts of a worn garment: the stretch of their cloth, the contact pressure on it and its ease."""

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from clothsim import Run
from clothsim.base.arrays import Floats, Ints
from clothsim.base.triangles import triangle_areas
from clothsim.garments.inputs import BodyMesh
from transfer.errors import TransferError

STRETCHED = 1.05
"""Larger principal stretch that half of the area of a tight part exceeds."""
PRESSED = 100.0
"""Least mean contact pressure of a tight part [Pa]: the weight of a garment makes some tens."""
NAMED = 6
"""Parts that a note names."""


@dataclass(frozen=True)
class Tightness:
    """How tight a part of a garment is.

    Attributes
    ----------
    stretch : float
        Median by area of the larger principal stretch against the pattern.
    pressure : float or None
        Mean contact pressure [Pa]; None where there was no drape.
    """

    stretch: float
    pressure: float | None = None

    @property
    def ease(self) -> float:
        """Width at rest less that of the body, as a fraction of the latter: below 0."""
        return 1.0 / self.stretch - 1.0

    def __str__(self) -> str:
        pressed = "" if self.pressure is None else f", pressure {1e-3 * self.pressure:.2g} kPa"
        return f"stretched {self.stretch:.2f}{pressed}, ease {100 * self.ease:.0f} %"


def tight_parts(
    stretches: Floats,
    areas: Floats,
    parts: Mapping[str, Ints],
    triangles: Ints | None = None,
    pressures: Floats | None = None,
) -> dict[str, Tightness]:
    """The parts of a garment that are tight, the most stretched first.

    Parameters
    ----------
    stretches : (m, 2) array
        Principal stretches of the triangles.
    areas : (m,) array
        Their areas at rest [m2].
    parts : mapping of str to (k,) int array
        Triangles of each part.
    triangles, pressures : (m, 3) int array and (n,) array, optional
        Vertices of the triangles, and the contact pressure there [Pa].
    """
    largest, found = stretches.max(axis=1), {}
    for name, rows in parts.items():
        if not len(rows):
            continue
        order = rows[np.argsort(largest[rows])]
        summed = np.cumsum(areas[order])
        median = float(largest[order][np.searchsorted(summed, summed[-1] / 2)])
        pressure = None
        if triangles is not None and pressures is not None:
            pressure = float(np.average(pressures[triangles[rows]].mean(axis=1), weights=areas[rows]))
        if median > STRETCHED and (pressure is None or pressure > PRESSED):
            found[name] = Tightness(median, pressure)
    return dict(sorted(found.items(), key=lambda item: -item[1].stretch))


def tight_parts_of_run(run: Run, parts: Mapping[str, Ints]) -> dict[str, Tightness]:
    """The tight parts at the end of a drape of one cloth with recorded contact pressure; parts: rows of triangles."""
    stretches, corners = np.asarray(run.stretches(-1), np.float64), run.positions(-1)[run.triangles]
    areas = triangle_areas(corners) / np.maximum(stretches.prod(axis=1), 1e-6)  # large where flattened at rest
    return tight_parts(
        stretches, areas, parts, run.triangles, np.asarray(run.field("contact_pressure", -1), np.float64)
    )


def parts_on_body(run: Run, body: BodyMesh) -> dict[str, Ints]:
    """Triangles of a run's cloth at its end on arms, legs and trunk; all as one where the body has no such parts."""
    middles = run.positions(-1)[run.triangles].mean(axis=1)
    try:
        parts = body.parts
    except TransferError:
        return {"garment": np.arange(len(middles))}
    _, nearest = cKDTree(body.positions).query(middles, workers=1)
    arm = (parts.hands[:, nearest] < 1.0).any(axis=0)
    leg = ~arm & (parts.frame.local(middles)[:, 1] < parts.landmarks["crotch"])
    return {"arms": np.flatnonzero(arm), "legs": np.flatnonzero(leg), "trunk": np.flatnonzero(~arm & ~leg)}


def tight_notes(found: Mapping[str, Tightness]) -> tuple[str, ...]:
    """A note with the tight parts of a garment, those that differ in their side alone as one; none without any."""
    if not found:
        return ()
    groups: dict[str, Tightness] = {}
    for name, tightness in found.items():
        groups.setdefault(_strip_side(name), tightness)
    named = ", ".join(f"{name} ({tightness})" for name, tightness in list(groups.items())[:NAMED])
    more = f" and {len(groups) - NAMED} more" if len(groups) > NAMED else ""
    return (f"too tight: {named}{more}",)


def _strip_side(name: str) -> str:
    """A name in the plural without left, right, front and back; as it is where no more of it is left.

    >>> _strip_side("left_sleeve_front"), _strip_side("pants_left"), _strip_side("front")
    ('sleeves', 'pants', 'front')
    """
    words = [word for word in re.split(r"[_ ]", name) if word.lower() not in ("left", "right", "front", "back")]
    sided = len(words) < len(re.split(r"[_ ]", name))
    return (" ".join(words) + ("s" if sided and not words[-1].endswith("s") else "")) if words else name


def tight_entries(found: Mapping[str, Tightness]) -> dict[str, dict[str, Any]]:
    """Tight parts as in summary.json."""
    return {name: {**asdict(tightness), "ease": tightness.ease} for name, tightness in found.items()}
