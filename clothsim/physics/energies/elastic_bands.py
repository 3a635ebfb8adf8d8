"""Elastic bands sewn along edges of the cloth, such as a waist or a cuff: the effect `elastic_bands`.

    E = sum k/2 (|e| / (s l0) - 1)^2 s l0   over the edges with |e| > s l0        [J]

k [N]: force at which the band is twice as long as at rest; l0 [m]: length of the edge at rest; s: that of the band
over it, which may change over time, as where a band is drawn in. An edge is a link (`links`) of the rest length s l0
and the stiffness k / (s l0) [N/m], so that the tension of a band is k (|e| / (s l0) - 1). It does not push: one that is
longer than what it is sewn to folds with it.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.keys.typed_effects import ElasticBands
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.edge_curves import drawn_curves
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.key_values import Schedule
from clothsim.physics.energies.links import Links
from clothsim.physics.energies.protocols import Driven, EnergyReport, NoPastSensitivity

SHORTEST = 0.05
"""Least length of a band over that of its edge: a band of no length would be infinitely stiff."""


@dataclass(frozen=True)
class BandSchedule:
    """One band: k [N] and s over time, and the lengths (m,) [m] of its edges at rest."""

    stiffness: Schedule
    length_ratio: Schedule
    rest_lengths: Floats

    def at(self, time: float) -> tuple[Floats, Floats]:
        """Rest lengths s l0 [m] and stiffnesses k / (s l0) [N/m] of its links at `time` [s], (m,) each."""
        lengths = self.length_ratio.at(time) * self.rest_lengths
        return lengths, self.stiffness.at(time) / lengths


@dataclass(frozen=True)
class ElasticBandsEnergy(Links, Driven, NoPastSensitivity, EnergyReport):
    """Links along the edges of all bands; `bands`: what they are over time, in the order of the links."""

    bands: tuple[BandSchedule, ...]

    @property
    def drives(self) -> bool:
        """True where a band changes over time."""
        return not all(band.stiffness.is_constant and band.length_ratio.is_constant for band in self.bands)

    def begin(self, step: Step) -> Self:
        """A copy with the lengths and stiffnesses of the end of the step."""
        lengths, stiffnesses = zip(*(band.at(step.time + step.dt) for band in self.bands), strict=True)
        return replace(self, lengths=np.concatenate(lengths), stiffnesses=np.concatenate(stiffnesses))

    def final_notes(self, x: Floats, time: float) -> tuple[str, ...]:
        """Length and mean tension of each band at x."""
        notes, first = [], 0
        distances = np.linalg.norm(self.lines(x), axis=1)
        for k, band in enumerate(self.bands):
            lengths, stiffnesses = band.at(time)
            now, first = distances[first : first + len(lengths)], first + len(lengths)
            tension = float(np.mean(stiffnesses * np.maximum(now - lengths, 0.0)))
            sizes = f"of {100 * lengths.sum():.4g} cm is {100 * now.sum():.4g} cm long"
            notes.append(f"band {k} {sizes} and pulls with {tension:.3g} N")
        return tuple(notes)


def elastic_bands(world: World, keys: ElasticBands) -> Energy | Off:
    """Bands of the tables of a scene; off where every stiffness is 0.

    Raises
    ------
    InputError
        Names the table and key.
    """
    rows, bands = [], []
    for _, stiffness, ratio, curves in drawn_curves("effects.elastic_bands.band", world, keys.band, SHORTEST):
        rows += [curve.edges for curve in curves]
        bands.append(BandSchedule(stiffness, ratio, np.concatenate([curve.lengths for curve in curves])))
    if not bands:
        return Off("every stiffness is 0" if keys.band else "there is no band")
    m = sum(len(band.rest_lengths) for band in bands)
    lengths, stiffnesses = (np.concatenate(parts) for parts in zip(*(band.at(0.0) for band in bands), strict=True))
    links = np.concatenate(rows), np.tile([1.0, -1.0], (m, 1)), np.zeros((m, 3)), lengths, stiffnesses
    return ElasticBandsEnergy(*links, np.ones(m, bool), tuple(bands))


_LEFT = {"select": "left", "length_ratio": 0.7}
EXAMPLE = Example(
    keys={"band": [{"select": [0, 1, 2], "stiffness": 2.0, "length_ratio": 0.7}]},
    in_scene={"band": [{**_LEFT, "stiffness": 5.0}]},
    zero={"band": [{**_LEFT, "stiffness": 0}]},
    idle=Idle(
        always={"band": [{**_LEFT, "stiffness": [[0.0, 0.0], [10.0, 0.0], [11.0, 30.0]]}]},
        sometimes={"band": [{**_LEFT, "stiffness": [[0.0, 0.0], [0.05, 0.0], [0.06, 20.0]]}]},
    ),
)
