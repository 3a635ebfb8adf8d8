"""Recovery of what explains edited frames of a clip: rest lengths, or numbers of its scene and a residual rest shape.

The sum over the edited frames of the squared distances, over what noise leaves of each, is minimised over logarithms of
factors (`clips.numbers`) with a normal prior about the scene as it was (`clips.gauss_newton`):
a run with the scene's own contact and stop for each evaluation, for an adjoint holds the stiffness of contact and
polishes each solve, and so is another clip by more than the noise. At the end the adjoint gives the gradient of the
same sum, where the scene has one: how far the end is from a minimum does not rest on the differences.

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
from clothsim.gradients.clips.clip_fit import (
    UNEXPLAINED,
    ClipFit,
    ClipRun,
    positions_at,
    refuse_beyond,
    until_last,
)
from clothsim.gradients.clips.numbers import ClipNumbers, clip_numbers
from clothsim.gradients.clips.rest_shape import RestMesh, RestPrice, fitted_lengths, fitted_rest, is_stretch
from clothsim.gradients.loss_of_numbers import Evaluation
from clothsim.gradients.losses import Custom
from clothsim.gradients.recover import Recovery
from clothsim.gradients.run import traced
from clothsim.scene.assembly.scene_world import build, world_of
from clothsim.scene.scene import Scene
from clothsim.solve.stepping.time_loop import frame_count

SHOWN = 0.3
"""Weight of a number in a combination from which it is named."""
ALONE = 2
"""Directions that are searched alone, those whose first step is lowest."""
TIGHTENINGS = 3
"""Searches from the last one, each with the noise that it left."""
LARGEST_MODEL = 1.5
"""Multiple of the noise up to which numbers alone explain the keys, and no rest shape is sought."""
NEARBY = 0.01
"""Factor on the differences of the last search, in which nothing buckles another way."""
NEARBY_STEPS = 3
"""Bound on its steps: each takes two runs for each number."""


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
    refuse_beyond(frames, frame_count(settings.duration, settings.frames_per_second))
    fit = ClipFit.of(numbers, points, _floors(floor() if callable(floor) else floor, len(frames)))
    count = [0]

    def tell(seen: ClipRun, stage: int = 1) -> None:
        count[0] += 1
        if progress is not None:
            values = dict(zip(numbers.names, np.exp(seen.at).tolist(), strict=True))
            progress(stage, Evaluation(values, seen.total, np.zeros(len(values)), failure=seen.failure))

    first = _first(fit)
    tell(first)
    fit = fit.stepped(first.positions)
    if rest and (longer := _longer(fit, first, tell)) is not None:
        return replace(longer, runs=count[0])
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


def _first(fit: ClipFit) -> ClipRun:
    """The run of the scene as it was. ClothsimError where it cannot be taken."""
    at = np.zeros(len(fit.numbers.names))
    try:
        return fit.at(ClipRun(at, 0.0, positions_at(fit.numbers.scene_at(at), fit.frames)))
    except InputError:
        raise
    except ClothsimError as error:
        raise ClothsimError(f"The scene itself cannot be run: {error.sentence}") from error


def _explained(fit: ClipFit, first: ClipRun, tell: Callable[[ClipRun], None]) -> tuple[ClipRun, Floats]:
    """The run with the numbers, and the derivatives at it.

    What alone lowers the sum most is varied alone first: an edit is mostly of one kind, and a step of all numbers at
    once goes astray where they are far from those of the edit. Each is tried by a step, for derivatives of a garment on
    a moving body are chance.
    """
    loose = fit.tightened(first.positions)
    moves = loose.search(tell).moves(first)
    gradient, hessian = loose.linearised(first, moves)
    lines = [loose.along(first, d, float(gradient @ d), float(d @ hessian @ d), tell) for d in fit.numbers.directions]
    for line in lines:
        line.begin()
    for line in sorted(lines, key=lambda line: line.lowest.total)[:ALONE]:
        line.double()
        if fit.misfit(line.lowest.positions) < UNEXPLAINED**2 * fit.misfit(first.positions):
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
    if fit.misfit(best.positions) > UNEXPLAINED**2 * fit.misfit(first.positions):
        return best, moves  # on no branch near that of the edit
    return _nearby(fit, best, moves, tell)


def _nearby(fit: ClipFit, best: ClipRun, moves: Floats, tell: Callable[[ClipRun], None]) -> tuple[ClipRun, Floats]:
    """The run and its derivatives after a search whose differences are too small for cloth to buckle another way.

    A fabric half a percent off may leave a fold on the other side at a later frame: differences of a tenth then say how
    branches differ, those of a thousandth how this one moves, and their minimum may lie on the branch of the edit.
    """
    if fit.misfit(best.positions) <= fit.finest:
        return best, moves
    sigma = np.minimum(fit.noise, max(fit.finest, UNEXPLAINED * fit.misfit(best.positions)))
    own = replace(fit, sigma=sigma, steps=NEARBY * fit.numbers.of_kind("step"))
    search = replace(own.search(tell), least=0.0, both_sides=True, most=NEARBY_STEPS)
    try:
        found, _, own_moves, _ = search.descended(own.at(best))
    except ClothsimError:  # a run of a difference failed: the fit is as good as without it
        return best, moves
    return (found, own_moves) if found.total < own.at(best).total else (best, moves)


def _identified(fit: ClipFit, first: ClipRun, last: ClipRun, moves: Floats) -> ClipRecovery:
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


def _checked(fit: ClipFit, last: ClipRun, moves: Floats) -> dict[str, Any]:
    """How far the last run is from a minimum by the adjoint, or why it has no gradient."""
    try:
        trace = traced(until_last(fit.numbers.scene_at(last.at), fit.frames))
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


@dataclass(frozen=True, eq=False)
class _Shapes:
    """Rest shapes beside the scene's, at some numbers (k,): the mesh of all cloths, and runs with displacements."""

    fit: ClipFit
    at: Floats
    mesh: RestMesh
    tell: Callable[[ClipRun, int], None]

    @classmethod
    def of(cls, fit: ClipFit, at: Floats, tell: Callable[[ClipRun, int], None]) -> "_Shapes":
        """Those of a fit whose cloths have rest shapes in space."""
        triangles = build(fit.numbers.scene, affordable=True).world.triangles
        return cls(fit, at, RestMesh(np.concatenate(fit.numbers.rests(at)), triangles), tell)

    def displaced(self, displacements: Floats) -> ClipNumbers:
        """The numbers with displacements (n, 3) [m] of the rest shapes."""
        ends = np.cumsum([len(each) for each in self.fit.numbers.added])[:-1]
        return replace(self.fit.numbers, added=tuple(np.split(displacements, ends)))

    def run(self, displacements: Floats) -> list[Floats]:
        """Positions at each key (n, 3) [m]; none where the run fails."""
        seen = replace(self.fit, numbers=self.displaced(displacements)).run(self.at)
        self.tell(seen, 2)
        return list(np.split(seen.positions, len(self.fit.frames))) if len(seen.positions) else []


def _no_rest(numbers: ClipNumbers) -> str:
    """Why a scene can have no residual rest shape; empty where it can."""
    if not numbers.shapes:
        return "the cloth is not given by arrays"
    return "the rest shape is a flat pattern" if any(len(each.shape) == 3 for each in numbers.shapes) else ""


def _longer(fit: ClipFit, first: ClipRun, tell: Callable[[ClipRun, int], None]) -> ClipRecovery | None:
    """The recovery by rest lengths that the keys agree on; None where they leave most of the distance.

    They come before the numbers: which of these can imitate a longer hem is chance, while its edges are longer in each
    key. The numbers stay as they were, with what is known of them.
    """
    if _no_rest(fit.numbers):
        return None
    shapes, before, keys = _Shapes.of(fit, first.at, tell), fit.misfit(first.positions), list(fit.keys)
    if is_stretch(shapes.mesh, first.positions, keys):
        return None
    moved, positions, runs = fitted_lengths(shapes.mesh, keys, first.positions, shapes.run, fit.noise, fit.finest)
    if fit.misfit(positions) > UNEXPLAINED * before:
        return None
    known = replace(fit, numbers=shapes.displaced(moved), sigma=np.hypot(fit.noise, fit.left(positions)))
    last = known.at(replace(first, positions=positions))
    try:
        moves = known.search(lambda seen: tell(seen, 2)).moves(last)
    except ClothsimError:  # nothing is known of the numbers, and the lengths stand
        moves = np.zeros((last.positions.size, len(first.at)))
    found = _identified(known, first, last, moves)
    moved, price = fitted_rest(shapes.mesh, keys, positions, shapes.run, fit.noise, moved)
    return replace(
        found,
        scene=shapes.displaced(moved).scene_at(first.at),
        scene_of_numbers=fit.numbers.scene_at(first.at),
        misfits=(before, before, price.after),
        rest=replace(price, before=before, runs=runs + price.runs),
        no_gradient="the parameters were not searched, as rest lengths explain the edit",
    )


def _with_rest(fit: ClipFit, last: ClipRun, found: ClipRecovery, tell: Callable[[ClipRun, int], None]) -> ClipRecovery:
    """The recovery with a residual rest shape."""
    if why := _no_rest(fit.numbers):
        return replace(found, no_rest=why)
    shapes = _Shapes.of(fit, last.at, tell)
    moved, price = fitted_rest(shapes.mesh, list(fit.keys), last.positions, shapes.run, fit.noise)
    if not moved.any():
        return replace(found, no_rest="none was found that is nearer to the keys")
    scene = shapes.displaced(moved).scene_at(last.at)
    return replace(found, scene=scene, rest=price, misfits=(*found.misfits[:2], price.after))
