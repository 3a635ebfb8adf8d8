"""Recovery of what explains edited frames of a clip: numbers of its scene, then a residual rest shape.

The sum over the edited frames of the squared distances, over what noise leaves of each, is minimised over logarithms of
factors (`clips.numbers`) with a normal prior about the scene as it was (`clips.gauss_newton`):
a run with the scene's own contact and stop for each evaluation, for an adjoint holds the stiffness of contact and
polishes each solve, and so is another clip by more than the noise. At the end the adjoint gives the gradient of the
same sum, where the scene has one: how far the end is from a minimum does not rest on the differences.

A garment on a moving body parts from its twins with time, so that an early key is known far better than a late one, and
small differences of late frames are chance: each key counts by its own noise, differences are as large as the noise
asks for, and what they move by no more than twins are apart counts as not moved.

What the keys determine: the singular values of the Jacobian over the noise, its columns in standard deviations of the
prior (Seber & Wild 1989, Nonlinear Regression, section 3.2). A combination of numbers whose singular value is below 1
is not determined: the whole of what is likely along it moves the keys by less than the noise.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, as_points, as_positive
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.text import many
from clothsim.gradients.clips.gauss_newton import GaussNewton, LineSearch
from clothsim.gradients.clips.numbers import ClipNumbers, clip_numbers
from clothsim.gradients.clips.rest_shape import RestMesh, RestPrice, fitted_rest
from clothsim.gradients.differentiable_session import forward
from clothsim.gradients.loss_of_numbers import Evaluation
from clothsim.gradients.losses import Custom
from clothsim.gradients.recover import Recovery
from clothsim.gradients.run import Trace, begun, traced
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build, world_of
from clothsim.scene.scene import Scene
from clothsim.solve.stepping.time_loop import frame_count

FINEST = 1e-4
"""Least noise of an edited frame: what a hand and a file of it leave [m]."""
INDEPENDENT = 10
"""Independent errors of an edited frame: neighbouring vertices err alike."""
SHOWN = 0.3
"""Weight of a number in a combination from which it is named."""
LEAST = 0.05
"""Relative drop of the sum in a step at which the search ends."""
ALONE = 2
"""Directions that are searched alone, those that promise most."""
BEGIN = 0.7
"""Least first step along a direction, of what is likely."""
UNEXPLAINED = 0.5
"""Fraction of what a run leaves at the keys that counts as noise in the next search."""
TIGHTENINGS = 3
"""Searches from the last one, each with the noise that it left."""
LARGEST_MODEL = 1.5
"""Multiple of the noise up to which numbers alone explain the keys, and no rest shape is sought."""
ABOVE_FLOOR = 3.0
"""Multiple of the floor, over the distance at a key, that a difference is of what is likely of its number."""
SEEN = 2.0
"""Multiple of the floor up to which a difference of runs at a key is chance."""


Tell = Callable[["_Seen"], None]
"""Called with each run."""
Floor = float | Sequence[float] | Floats
"""Noise of a run in all frames, or at each key [m]."""


@dataclass(frozen=True)
class ClipRecovery(Recovery):
    """Parameters, and a rest shape, that explain edited frames.

    `values` are factors by name of the number, `errors` standard errors of their logarithms, inf if the keys say
    less than is known without them; `undetermined` combinations of numbers that the keys do not determine.

    Parameters
    ----------
    scene_of_numbers : Scene
        The scene with the numbers alone; `scene` has the rest shape too.
    noise : tuple of float
        Root mean square uncertainty of each key [m]: its noise floor, or FINEST.
    misfits : tuple of float
        Root mean square distance at the keys, each by the inverse square of its noise, of the scene as it was, with the
        numbers, and with the rest shape [m].
    from_minimum : float
        Largest change of a logarithm in the remaining step, from the gradient of the adjoint, over its standard error;
        nan if the scene has no gradient.
    no_gradient : str
        Why the scene has no gradient; empty if it has one.
    rest : RestPrice, optional
        Cost of the residual rest shape; None if there is none.
    no_rest : str
        Why there is no residual rest shape; empty if there is one.
    """

    scene_of_numbers: Scene | None = None
    noise: tuple[float, ...] = ()
    misfits: tuple[float, float, float] = (float("nan"),) * 3
    from_minimum: float = float("nan")
    no_gradient: str = ""
    rest: RestPrice | None = None
    no_rest: str = ""


@dataclass(frozen=True, eq=False)
class _Seen:
    """A run: numbers (k,), the sum, and positions at all keys (p, 3), empty if it failed."""

    at: Floats
    total: float
    positions: Floats
    failure: str = ""


@dataclass(frozen=True, eq=False)
class _Fit:
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
    def of(cls, numbers: ClipNumbers, keys: Mapping[int, Floats], floor: Floats) -> "_Fit":
        """The fit of keys (n, 3) [m] by frame, known to their floor (f,) [m]."""
        frames, noise = tuple(sorted(keys)), np.maximum(floor, FINEST)
        points = np.array([keys[frame] for frame in frames])
        return cls(numbers, frames, points, floor, noise, noise, numbers.of_kind("step"))

    @property
    def known(self) -> float:
        """Noise of the keys in the mean of `misfit` [m]."""
        return float((self.noise**-2.0).mean() ** -0.5)

    @property
    def weight(self) -> Floats:
        """Of a squared distance in half the sum, (f n, 1), in the order of positions."""
        n = self.keys.shape[1]
        return np.repeat(INDEPENDENT / (n * self.sigma**2), n)[:, None]

    def run(self, at: Floats) -> _Seen:
        """A run; one that fails is an outcome too."""
        try:
            x = _positions(self.numbers.scene_at(at), self.frames)
        except ClothsimError as error:
            return _Seen(at, float("inf"), np.zeros((0, 3)), error.sentence)
        return self.at(_Seen(at, 0.0, x))

    def beside(self, at: Floats, seen: _Seen) -> _Seen:
        """A run for a difference; at keys where twins are as far from each other it is the one that is there."""
        found = self.run(at)
        if not np.isfinite(found.total):
            return found
        chance = self._apart(found.positions - seen.positions) < SEEN * self.floor
        rows = np.repeat(chance, self.keys.shape[1])[:, None]
        return replace(found, positions=np.where(rows, seen.positions, found.positions))

    def tightened(self, positions: Floats) -> "_Fit":
        """The fit that counts half of what a run leaves as noise: numbers that explain less stay where they were."""
        return replace(self, sigma=np.maximum(self.noise, UNEXPLAINED * self.misfit(positions)))

    def stepped(self, positions: Floats) -> "_Fit":
        """The fit with differences that stand out of the floor, of an edit of the size that a run leaves."""
        off = np.maximum(self.left(positions), 1e-12)
        share = min(1.0, ABOVE_FLOOR * float((self.floor / off).max()))
        return replace(self, steps=np.maximum(self.steps, share * self.numbers.of_kind("prior")))

    def at(self, seen: _Seen) -> _Seen:
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

    def normal(self, seen: _Seen, moves: Floats) -> tuple[Floats, Floats]:
        """Gradient (k,) and Gauss-Newton Hessian (k, k) of the sum without the prior."""
        off = (self.weight * (seen.positions - self.keys.reshape(-1, 3))).ravel()
        return moves.T @ off, moves.T @ (np.repeat(self.weight, 3)[:, None] * moves)

    def linearised(self, seen: _Seen, moves: Floats) -> tuple[Floats, Floats]:
        """Gradient (k,) and Gauss-Newton Hessian (k, k) of the sum."""
        inverse = self.numbers.of_kind("prior") ** -2.0
        gradient, hessian = self.normal(seen, moves)
        return gradient + inverse * seen.at, hessian + np.diag(inverse)

    def search(self, tell: Callable[[_Seen], None]) -> GaussNewton[_Seen]:
        """The search from run to run, each from the start of the scene."""
        of, limit = self.numbers.of_kind, self.numbers.of_kind("limit")

        def run(at: Floats, _: _Seen) -> _Seen:
            return self.run(at)

        return GaussNewton(run, self.beside, self.linearised, self.steps, of("largest"), -limit, limit, tell, LEAST)

    def doubled(self, first: _Seen, direction: Floats, slope: float, curvature: float, tell: Tell) -> LineSearch[_Seen]:
        """Runs along a direction (k,); slope, curvature: of the sum along it at the first run.

        The first step is at least BEGIN of what is likely.
        """
        of, moved = self.numbers.of_kind, direction > 0
        prior, largest, limit = (float(of(what)[moved].min()) for what in ("prior", "largest", "limit"))

        def run(q: float) -> _Seen:
            seen = self.run(q * direction)
            tell(seen)
            return seen

        line = LineSearch(run, {0.0: self.at(first)}, lambda seen: self.misfit(seen.positions) < self.known)
        line.double(float(np.copysign(np.clip(abs(slope) / curvature, BEGIN * prior, largest), -slope)), limit)
        return line


def recover_clip(
    scene: Scene,
    keys: Mapping[int, Floats],
    free: Sequence[str] = (),
    floor: Floor | Callable[[], Floor] = 0.0,
    rest: bool = True,
    progress: Callable[[int, Evaluation], None] | None = None,
) -> ClipRecovery:
    """Find the parameters of a scene, and a rest shape, with which its run passes through edited frames.

    Parameters
    ----------
    scene : Scene
        Its lengths and a rest shape can be found only if its cloths are given by arrays.
    keys : mapping of int to (n, 3) ndarray [m]
        Positions of all cloth vertices by the number of the frame, from 1.
    free : sequence of str
        Numbers: "stretch", "bending", "friction", "pressure", "damping", "width", "height", "hem". Empty: all that the
        scene has.
    floor : float, (f,) array_like or callable
        Root mean square noise of a run [m], for all frames or for each key in the order of time; or a function that
        finds it, called after all other checks.
    rest : bool
        Find a residual rest shape if the numbers leave more than the noise.
    progress : callable, optional
        Called after each run with 1 for numbers and 2 for the rest shape.

    Raises
    ------
    InputError
        For a frame or a number that the scene does not have.
    ClothsimError
        If the scene itself cannot be run.
    """
    if isinstance(free, str):
        raise InputError(f"free is {free!r}.", f"Give a list of names: [{free!r}].")
    numbers = clip_numbers(scene, free)
    if not keys or not all(isinstance(frame, int | np.integer) and frame > 0 for frame in keys):
        raise InputError("There is no edited frame from 1 on.", "Give positions by the number of a frame.")
    frames = tuple(sorted(keys))
    n = world_of(numbers.scene).n_cloth
    points = {frame: as_points(f"The key of frame {frame}", keys[frame]) for frame in frames}
    for frame, each in points.items():
        if len(each) != n:
            raise InputError(f"The key of frame {frame} has {len(each)} vertices, the cloths have {n}.")
    settings = scene.run_settings
    _refuse_beyond(frames, frame_count(settings.duration, settings.frames_per_second))
    fit = _Fit.of(numbers, points, _floors(floor() if callable(floor) else floor, len(frames)))
    count = [0]

    def tell(seen: _Seen, stage: int = 1) -> None:
        count[0] += 1
        if progress is not None:
            values = dict(zip(numbers.names, np.exp(seen.at).tolist(), strict=True))
            progress(stage, Evaluation(values, seen.total, np.zeros(len(values)), failure=seen.failure))

    first = _first(fit)
    tell(first)
    fit = fit.stepped(first.positions)
    last, moves = _explained(fit, first, tell)
    known = replace(fit, sigma=np.hypot(fit.noise, fit.left(last.positions)))
    found = _identified(known, first, last, moves)
    found = replace(found, **_checked(known, last, moves))
    if found.misfits[1] > LARGEST_MODEL * fit.known and rest:
        found = _with_rest(fit, last, found, tell)
    return replace(found, runs=count[0])


def _floors(given: Floor, count: int) -> Floats:
    """Floors of the keys (count,) [m]."""
    each = np.array([as_positive("floor", one, zero=True) for one in np.ravel(np.asarray(given)).tolist()])
    if np.ndim(given) and len(each) != count:
        raise InputError(f"The floor has {many(len(each), 'number')} for {many(count, 'edited frame')}.")
    return np.broadcast_to(each, (count,)).copy()


def _refuse_beyond(frames: Sequence[int], last: int) -> None:
    """InputError for a frame that the run of the scene has not."""
    if frames[-1] > last:
        raise InputError(f"There is no frame {frames[-1]} to match.", f"The run of the scene has frames 1 to {last}.")


def _first(fit: _Fit) -> _Seen:
    """The run of the scene as it was. ClothsimError where it cannot be taken."""
    at = np.zeros(len(fit.numbers.names))
    try:
        return fit.at(_Seen(at, 0.0, _positions(fit.numbers.scene_at(at), fit.frames)))
    except InputError:
        raise
    except ClothsimError as error:
        raise ClothsimError(f"The scene itself cannot be run: {error.sentence}") from error


def _explained(fit: _Fit, first: _Seen, tell: Callable[[_Seen], None]) -> tuple[_Seen, Floats]:
    """The run with the numbers, and the derivatives at it.

    What alone lowers the sum most is varied alone first: an edit is mostly of one kind, and a step of all numbers at
    once goes astray where they are far from those of the edit.
    """
    loose = fit.tightened(first.positions)
    moves = loose.search(tell).moves(first)
    gradient, hessian = loose.linearised(first, moves)
    drops = [float(d @ gradient) ** 2 / float(d @ hessian @ d) for d in fit.numbers.directions]
    lines = []
    for direction in (fit.numbers.directions[k] for k in np.argsort(drops)[::-1][:ALONE]):
        slope, curvature = float(gradient @ direction), float(direction @ hessian @ direction)
        lines.append(loose.doubled(first, direction, slope, curvature, tell))
        if fit.misfit(lines[-1].lowest.positions) < UNEXPLAINED**2 * fit.misfit(first.positions):
            break
    best = min(lines, key=lambda line: line.lowest.total).refined()
    if not best.at.any():
        best = first
    if best is not first:
        moves = fit.search(tell).moves(best)
    for _ in range(TIGHTENINGS):
        own, left = fit.tightened(best.positions), fit.misfit(best.positions)
        best, _, moves, _ = own.search(tell).descended(own.at(best), moves)
        if not fit.known < fit.misfit(best.positions) < UNEXPLAINED * left:
            break
    return best, moves


def _to_last(scene: Scene, frames: Sequence[int]) -> Scene:
    """The scene until the last of some frames."""
    settings = scene.run_settings
    return replace(scene, run=settings.with_keys(duration=frames[-1] / settings.frames_per_second))


def _positions(scene: Scene, frames: Sequence[int]) -> Floats:
    """Positions of the cloth in frames of a run, one after the other, (f n, 3) [m]."""
    scene = _to_last(scene, frames)
    session = prepare(scene, build(scene, affordable=True))
    trace = Trace(session, tuple(forward(session, begun(session, {}))))
    _refuse_beyond(frames, len(trace.frame_states) - 1)  # it may come to rest before
    return np.concatenate([trace.cloth_positions(frame) for frame in frames])


def _identified(fit: _Fit, first: _Seen, last: _Seen, moves: Floats) -> ClipRecovery:
    """The recovery with what the keys determine; what the numbers leave counts as noise too."""
    prior, names = fit.numbers.of_kind("prior"), fit.numbers.names
    left, weight = fit.misfit(last.positions), np.repeat(fit.weight, 3)[:, None]
    _, sizes, modes = np.linalg.svd(np.sqrt(weight) * moves * prior, full_matrices=False)
    covariance = np.outer(prior, prior) * ((modes.T / (1 + sizes**2)) @ modes)
    errors = np.sqrt(np.diag(covariance))
    weak = [mode * np.sign(mode[np.abs(mode).argmax()]) for mode in modes[sizes < 1.0]]
    combined = [{name: float(w) for name, w in zip(names, mode, strict=True) if abs(w) > SHOWN} for mode in weak]
    values = dict(zip(names, np.exp(last.at).tolist(), strict=True))
    return ClipRecovery(
        fit.numbers.scene_at(last.at),
        values,
        {name: float(e) if e < p / np.sqrt(2) else np.inf for name, e, p in zip(names, errors, prior, strict=True)},
        (),
        tuple(combined),
        tuple(
            n for n, q, most in zip(names, last.at, fit.numbers.of_kind("limit"), strict=True) if abs(q) > most - 1e-3
        ),
        Evaluation(values, last.total, np.zeros(len(values))),
        (last.total,),
        0,
        scene_of_numbers=fit.numbers.scene_at(last.at),
        noise=tuple(fit.noise.tolist()),
        misfits=(fit.misfit(first.positions), left, left),
    )


def _checked(fit: _Fit, last: _Seen, moves: Floats) -> dict[str, Any]:
    """How far the last run is from a minimum by the adjoint, or why it has no gradient."""
    try:
        trace = traced(_to_last(fit.numbers.scene_at(last.at), fit.frames))
        weights = fit.weight.reshape(len(fit.frames), -1)
        each = zip(fit.frames, fit.keys, weights, strict=True)
        losses = [Custom(_half_square(key, weight[:, None]), frame) for frame, key, weight in each]
        slope = fit.numbers.derivatives(trace.gradient(losses), last.at)
    except ClothsimError as error:
        return {"no_gradient": error.sentence}
    _, hessian = fit.linearised(last, moves)
    slope = slope + last.at / fit.numbers.of_kind("prior") ** 2
    errors = np.sqrt(np.diag(np.linalg.inv(hessian)))
    return {"from_minimum": float(np.max(np.abs(np.linalg.solve(hessian, slope)) / errors))}


def _half_square(key: Floats, weight: Floats) -> Callable[[Floats], tuple[float, Floats]]:
    """Half the sum of squared distances from a key (n, 3), by weights (n, 1), with its derivative."""

    def of(positions: Floats) -> tuple[float, Floats]:
        off = positions - key
        return 0.5 * float((weight * off**2).sum()), weight * off

    return of


def _with_rest(fit: _Fit, last: _Seen, found: ClipRecovery, tell: Callable[[_Seen, int], None]) -> ClipRecovery:
    """The recovery with a residual rest shape."""
    if not fit.numbers.shapes or any(len(shape.shape) == 3 for shape in fit.numbers.shapes):
        why = "the rest shape is a flat pattern" if fit.numbers.shapes else "the cloth is not given by arrays"
        return replace(found, no_rest=why)
    rests = fit.numbers.rests(last.at)
    ends = np.cumsum([len(rest) for rest in rests])[:-1]
    world = build(fit.numbers.scene, affordable=True).world
    sheet = RestMesh(np.concatenate(rests), world.triangles)

    def with_added(displacements: Floats) -> _Fit:
        added = tuple(np.split(displacements, ends))
        return replace(fit, numbers=replace(fit.numbers, added=added))

    def run(displacements: Floats) -> list[Floats]:
        seen = with_added(displacements).run(last.at)
        tell(seen, 2)
        return list(np.split(seen.positions, len(fit.frames))) if len(seen.positions) else []

    moved, price = fitted_rest(sheet, list(fit.keys), last.positions, run, fit.noise)
    if not moved.any():
        return replace(found, no_rest="none was found that is nearer to the keys")
    scene = with_added(moved).numbers.scene_at(last.at)
    return replace(found, scene=scene, rest=price, misfits=(*found.misfits[:2], price.after))
