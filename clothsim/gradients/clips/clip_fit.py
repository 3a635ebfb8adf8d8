"""Runs of a clip by its numbers, and the sum of their squared distances from edited frames.

A garment on a moving body parts from its twins with time, so that an early key is known far better than a late one, and
small differences of late frames are chance: each key counts by its own noise, differences are as large as the noise
asks for, and what they move by no more than twins are apart counts as not moved.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError, InputError
from clothsim.gradients.clips.gauss_newton import GaussNewton, LineSearch
from clothsim.gradients.clips.numbers import ClipNumbers
from clothsim.gradients.differentiable_session import forward
from clothsim.gradients.run import Trace, begun
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene

FINEST = 1e-4
"""Least noise of an edited frame: what a hand and a file of it leave [m]."""
INDEPENDENT = 10
"""Independent errors of an edited frame: neighbouring vertices err alike."""
LEAST = 0.05
"""Relative drop of the sum in a step at which the search ends."""
BEGIN = 0.7
"""Least first step along a direction, of what is likely."""
UNEXPLAINED = 0.5
"""Fraction of what a run leaves at the keys that counts as noise in the next search."""
ABOVE_FLOOR = 3.0
"""Multiple of the floor, over the distance at a key, that a difference is of what is likely of its number."""
LEAST_FLOOR = 1e-6
"""Floor of a run of which none is given [m]."""
SEEN = 2.0
"""Multiple of the floor up to which a difference of runs at a key is chance."""


Tell = Callable[["ClipRun"], None]
"""Called with each run."""


@dataclass(frozen=True, eq=False)
class ClipRun:
    """A run: numbers (k,), the sum, and positions at all keys (p, 3), empty if it failed."""

    at: Floats
    total: float
    positions: Floats
    failure: str = ""


@dataclass(frozen=True, eq=False)
class ClipFit:
    """Edited frames (f, n, 3) by number, and the numbers that may explain them.

    frames: numbers of the frames; floor: distance of twins at each (f,) [m]; noise: what each is known to (f,) [m];
    sigma: noise in the sum, which counts what is left unexplained (f,) [m]; steps: differences of the numbers (k,).
    """

    numbers: ClipNumbers
    frames: tuple[int, ...]
    keys: Floats
    floor: Floats
    noise: Floats
    sigma: Floats
    steps: Floats

    @classmethod
    def of(cls, numbers: ClipNumbers, keys: Mapping[int, Floats], floor: Floats) -> "ClipFit":
        """The fit of keys (n, 3) [m] by frame, known to their floor (f,) [m]."""
        frames, noise = tuple(sorted(keys)), np.maximum(floor, FINEST)
        points = np.array([keys[frame] for frame in frames])
        return cls(numbers, frames, points, floor, noise, noise, numbers.of_kind("step"))

    @property
    def known(self) -> float:
        """Noise of the keys in the mean of `misfit` [m]."""
        return float((self.noise**-2.0).mean() ** -0.5)

    @property
    def finest(self) -> float:
        """Distance from the keys below which a search need not go: what repetitions of the run are apart [m]."""
        return max(float(self.floor.mean()), LEAST_FLOOR)

    @property
    def weight(self) -> Floats:
        """Of a squared distance in half the sum, (f n, 1), in the order of positions."""
        n = self.keys.shape[1]
        return np.repeat(INDEPENDENT / (n * self.sigma**2), n)[:, None]

    def run(self, at: Floats) -> ClipRun:
        """A run; one that fails is an outcome too."""
        try:
            x = positions_at(self.numbers.scene_at(at), self.frames)
        except ClothsimError as error:
            return ClipRun(at, float("inf"), np.zeros((0, 3)), error.sentence)
        return self.at(ClipRun(at, 0.0, x))

    def beside(self, at: Floats, seen: ClipRun) -> ClipRun:
        """A run for a difference; at keys where twins are as far from each other it is the one that is there.

        Below FINEST the floor is no chance: what a small change of a number moves is then smooth.
        """
        found = self.run(at)
        if not np.isfinite(found.total):
            return found
        chance = self._apart(found.positions - seen.positions) < np.where(self.floor > FINEST, SEEN * self.floor, 0.0)
        rows = np.repeat(chance, self.keys.shape[1])[:, None]
        return replace(found, positions=np.where(rows, seen.positions, found.positions))

    def tightened(self, positions: Floats) -> "ClipFit":
        """The fit that counts half of what a run leaves as noise: numbers that explain less stay where they were."""
        return replace(self, sigma=np.maximum(self.noise, UNEXPLAINED * self.misfit(positions)))

    def stepped(self, positions: Floats) -> "ClipFit":
        """The fit with differences that stand out of the floor, of an edit of the size that a run leaves."""
        off = np.maximum(self.left(positions), 1e-12)
        share = min(1.0, ABOVE_FLOOR * float((self.floor / off).max()))
        return replace(self, steps=np.maximum(self.steps, share * self.numbers.of_kind("prior")))

    def at(self, seen: ClipRun) -> ClipRun:
        """A run with the sum of this fit."""
        away = seen.at / self.numbers.of_kind("prior")
        square = float((self.weight * (seen.positions - self.keys.reshape(-1, 3)) ** 2).sum())
        return replace(seen, total=0.5 * (square + float(away @ away)))

    def left(self, positions: Floats) -> Floats:
        """Root mean square distance of positions (p, 3) from each key (f,) [m]."""
        return self._apart(positions - self.keys.reshape(-1, 3))

    def misfit(self, positions: Floats) -> float:
        """That of all keys, each by the inverse square of its noise [m]."""
        return float(np.sqrt(np.average(self.left(positions) ** 2, weights=self.noise**-2.0)))

    def _apart(self, offsets: Floats) -> Floats:
        """Root mean squares of offsets (f n, 3) of each key (f,) [m]."""
        return np.asarray(np.sqrt((offsets.reshape(self.keys.shape) ** 2).sum(axis=2).mean(axis=1)))

    def normal(self, seen: ClipRun, moves: Floats) -> tuple[Floats, Floats]:
        """Gradient (k,) and Gauss-Newton Hessian (k, k) of the sum without the prior."""
        off = (self.weight * (seen.positions - self.keys.reshape(-1, 3))).ravel()
        return moves.T @ off, moves.T @ (np.repeat(self.weight, 3)[:, None] * moves)

    def linearised(self, seen: ClipRun, moves: Floats) -> tuple[Floats, Floats]:
        """Gradient (k,) and Gauss-Newton Hessian (k, k) of the sum."""
        inverse = self.numbers.of_kind("prior") ** -2.0
        gradient, hessian = self.normal(seen, moves)
        return gradient + inverse * seen.at, hessian + np.diag(inverse)

    def search(self, tell: Callable[[ClipRun], None]) -> GaussNewton[ClipRun]:
        """The search from run to run, each from the start of the scene."""
        of, limit = self.numbers.of_kind, self.numbers.of_kind("limit")

        def run(at: Floats, _: ClipRun) -> ClipRun:
            return self.run(at)

        return GaussNewton(run, self.beside, self.linearised, self.steps, of("largest"), -limit, limit, tell, LEAST)

    def along(
        self, first: ClipRun, direction: Floats, slope: float, curvature: float, tell: Tell
    ) -> LineSearch[ClipRun]:
        """Runs along a direction (k,), to be taken; slope, curvature: of the sum along it at the first run.

        The first step is at least BEGIN of what is likely.
        """
        of, moved = self.numbers.of_kind, direction > 0
        prior, largest, limit = (float(of(what)[moved].min()) for what in ("prior", "largest", "limit"))

        def run(q: float) -> ClipRun:
            seen = self.run(q * direction)
            tell(seen)
            return seen

        step = float(np.copysign(np.clip(abs(slope) / curvature, BEGIN * prior, largest), -slope))
        return LineSearch(
            run, {0.0: self.at(first)}, step, limit, lambda seen: self.misfit(seen.positions) < self.known
        )


def until_last(scene: Scene, frames: Sequence[int]) -> Scene:
    """The scene until the last of some frames."""
    settings = scene.run_settings
    return replace(scene, run=settings.with_keys(duration=frames[-1] / settings.frames_per_second))


def positions_at(scene: Scene, frames: Sequence[int]) -> Floats:
    """Positions of the cloth in frames of a run, one after the other, (f n, 3) [m]."""
    scene = until_last(scene, frames)
    session = prepare(scene, build(scene, affordable=True))
    trace = Trace(session, tuple(forward(session, begun(session, {}))))
    refuse_beyond(frames, len(trace.frame_states) - 1)  # it may come to rest before
    return np.concatenate([trace.cloth_positions(frame) for frame in frames])


def refuse_beyond(frames: Sequence[int], last: int) -> None:
    """InputError for a frame that the run of the scene has not."""
    if frames[-1] > last:
        raise InputError(f"There is no frame {frames[-1]} to match.", f"The run of the scene has frames 1 to {last}.")
