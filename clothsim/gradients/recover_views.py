"""Recovery of numbers of a scene and of its pattern from calibrated pictures, by Gauss and Newton's method.

The sum of rho(r) over the residuals of all pictures, r over its noise and rho the Huber function, is minimised over the
logarithms q of the numbers. Its gradient is that of the adjoint of the run. Its Hessian is that of Gauss and Newton:
the derivatives of the cloth's vertices by q are differences of runs at first, and then follow the steps by Broyden's
update (Broyden 1965, "A class of methods for solving nonlinear simultaneous equations"); the correspondence is found
again at each run, and held in a step. Friction holds a drape where it was put on: it is first pulled to its pictures
and its sum is that beside displacements of the cloth (`placed_drape`). A run begins from the drape
that was accepted last, so that folds go on as they are. How far the end is from a minimum, in standard errors, does not
rest on the differences.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np
from scipy.optimize import lsq_linear
from scipy.sparse import csr_array

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError, InputError
from clothsim.gradients.camera import Obstacle
from clothsim.gradients.clips.gauss_newton import broyden_update, halved_until_lower
from clothsim.gradients.exact_system import NoMinimumError
from clothsim.gradients.loss_of_numbers import Evaluation, KeptResults, problem_of
from clothsim.gradients.losses import Custom
from clothsim.gradients.parameters import full_path
from clothsim.gradients.pattern_numbers import SECTION
from clothsim.gradients.placed_drape import pulled
from clothsim.gradients.recover import SOURCE, bending_keys, bending_prior
from clothsim.gradients.scene_of_pattern import ShapedScene, halved, shaped_scene
from clothsim.gradients.view_fit import Seen, ViewFit, by_kind, finer_fit, finer_positions, of_finer_cloth
from clothsim.gradients.view_recovery import SearchRecord, ViewRecovery, recovery_of
from clothsim.gradients.views import View, read_views
from clothsim.patterns.pattern_mesh import PatternMesh
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.scene import Scene

PATTERN_STEP, FABRIC_STEP = 0.005, 0.04
"""Differences of logarithms by which the cloth's derivatives are taken."""
LARGEST_PATTERN_STEP, LARGEST_FABRIC_STEP = 0.08, 0.7
"""Largest changes of logarithms in a step."""
KICK, WAVES = 1.0, 6
"""Root mean square of velocities that move cloth to other folds [m/s], and the waves that they are made of."""
MOST_ITERATIONS, FEW_ITERATIONS = 10, 3
"""Steps of one start, and those before a drape that friction holds is pulled again."""
ROUNDS, WORTH, LEAST = 3, 0.02, 3e-3
"""Further pulls of such a drape, and the falls of the sum, relative to it, below which a pull or a step is the last:
friction changes the sum at random by about as much."""
ENOUGH = 0.5
"""Length of a step in standard errors of independent pixels, and drop of the sum, at which the search ends."""


@dataclass(frozen=True, eq=False)
class SearchEnd:
    """The last run of a search and the one before it, the derivatives of the vertices at the last, and what it took.

    moves: (3 n, k); fresh: whether they are differences there; runs; adjoint: its seconds.
    """

    last: Seen
    before: Seen
    moves: Floats
    fresh: bool
    runs: int
    adjoint: float


def recover_views(
    scene: Scene,
    views: str | Path | Sequence[View],
    free: Sequence[str],
    starts: int = 1,
    progress: Callable[[int, Evaluation], None] | None = None,
    seed: int = 0,
    pattern: PatternMesh | None = None,
    prior: bool = False,
    twins: bool = True,
    folds: int = 6,
    finer: bool = False,
    runs: str | Path = "",
) -> ViewRecovery:
    """Find the parameters of a scene whose cloth ends as in calibrated pictures.

    Parameters
    ----------
    scene : Scene
        Its parameters are the first start. The contact stiffness is held at that of its own run.
    views : str, Path or sequence of View
        A TOML file of views (`gradients.views`), in the coordinates of the scene; or the views.
    free, starts, progress, seed, pattern
        As in `recover`.
    prior : bool
        Combine the bending stiffnesses with those of 618 measured fabrics of the cloth's weight (`bending_prior`).
    twins : bool
        Run four other models at the end, for the model's own error (`Twin`): about ten runs more.
    folds : int
        Number of drapes from which the first start is chosen by their normals: the scene's own drape, and others after
        seeded kicks.
    finer : bool
        End with a few steps on a cloth with four triangles for each; a run then costs five times as much. The values
        are those of the finer cloth.
    runs : str or Path
        As in `recover`.

    Raises
    ------
    InputError
        For an unreadable picture, a number that cannot be varied, a cloth that no camera sees at the start, or a cloth
        that cannot be meshed more finely.
    ClothsimError
        If the scene itself cannot be run.
    """
    began = process_time()
    paths = tuple(dict.fromkeys(full_path(name) for name in free))
    shaped = shaped_scene(scene, pattern) if any(path.startswith(SECTION) for path in paths) else None
    made = _views(views, scene if shaped is None else shaped.scene, shaped)
    mean_loss = Custom(lambda x: (0.0, np.zeros_like(x)))
    problem = problem_of(scene, mean_loss, free, pattern, KeptResults(runs))
    triangles = world_of(problem.scene).triangles
    fit = ViewFit(problem, made, triangles, problem.origin, np.zeros((len(paths),) * 2))
    if finer:
        try:  # now, and not after the search
            halved(fit.scene_at(fit.problem.origin))
        except InputError as error:
            raise InputError(error.sentence, "Leave out --finer.") from error
    note = ""
    if prior:
        fit, note = _with_prior(fit)

    def tell(number: int, seen: Seen) -> None:
        if progress is not None:
            values = problem.values(seen.at)
            progress(number, Evaluation(values, seen.total, np.zeros(len(values)), failure=seen.failure))

    rng, ends, failed = np.random.default_rng(seed), list[SearchEnd](), list[str]()
    drapes = _drapes(fit, folds, rng, partial(tell, 0))
    first, misfits, count = drapes[0], tuple(fit.folds_misfit(each) for each in drapes), len(drapes)
    for start in range(1, max(1, starts) + 1):
        offset = problem.spreads * rng.uniform(-1.0, 1.0, len(paths)) if start > 1 else 0.0
        begun = (
            drapes[int(np.argmin(misfits))] if start == 1 else fit.seen(problem.origin + offset, first.positions[:0])
        )
        tell(start, begun)
        try:
            ends.append(_searched(fit, begun, partial(tell, start)))
        except ClothsimError as error:
            if start == 1:
                raise
            failed.append(f"Start {start} failed: {error.sentence}")
    best = min(ends, key=lambda each: each.last.total)
    minima, coarse, shown = tuple(each.last.total for each in ends), None, first.positions
    count, adjoint = count + sum(each.runs for each in ends), sum(each.adjoint for each in ends)
    if finer:
        try:
            fine_fit, weights = finer_fit(fit, best.last.at)
            placed = finer_positions(fit, fine_fit, best.last.positions)
            end = _on_finer_cloth(fine_fit, placed, weights, best, partial(tell, start))
        except ClothsimError as error:
            failed.append(f"The finer cloth could not be run, the values are of the cloth as given: {error.sentence}")
        else:
            fit, coarse, best, shown = fine_fit, best.last.at, end, np.asarray(weights @ shown)
            count, adjoint = count + end.runs, adjoint + end.adjoint
    search = SearchRecord(count, minima, note, began, adjoint, misfits, twins, coarse, tuple(failed))
    return recovery_of(fit, shown, (best.last, best.before, best.moves), search)


def _drapes(fit: ViewFit, folds: int, rng: np.random.Generator, tell: Callable[[Seen], None]) -> list[Seen]:
    """Drapes with the scene's own numbers: its run, and folds - 1 others after seeded kicks."""
    first = fit.seen(fit.problem.origin, np.zeros((0, 3)))
    if not first.parts:
        raise InputError(f"The pictures cannot be compared with the scene as it is: {first.failure}")
    drapes = [first]
    for _ in range(folds - 1):
        # velocities (n, 3) [m/s] that vary smoothly over the cloth, of KICK in the root mean square
        size = float(np.ptp(first.positions, axis=0).max())
        waves = 2 * np.pi / size * rng.normal(size=(WAVES, 3))
        phases, amplitudes = rng.uniform(0, 2 * np.pi, WAVES), rng.normal(size=(WAVES, 3))
        speeds = np.sin(first.positions @ waves.T + phases) @ amplitudes
        kick = np.asarray(speeds * (KICK / np.sqrt((speeds**2).sum(axis=1).mean())))
        drapes.append(fit.seen(first.at, first.positions, kick))
        tell(drapes[-1])
    return [replace(each, trace=None) for each in drapes]  # as large as the run has steps


def _with_prior(fit: ViewFit) -> tuple[ViewFit, str]:
    """The fit with the prior of stiffnesses of bending, and what it is."""
    keys = bending_keys(fit.problem.paths)
    bending = list(keys)
    density = world_of(fit.problem.scene).cloths[0].fabric.density
    before = bending_prior(tuple(keys.values()), density)
    mean, precision = fit.mean.copy(), fit.precision.copy()
    mean[bending] = before.mean
    precision[np.ix_(bending, bending)] = np.linalg.inv(before.covariance)
    return replace(fit, mean=mean, precision=precision), f"bending of {SOURCE} at {density:g} kg/m2, log-normal"


def _views(views: str | Path | Sequence[View], scene: Scene, shaped: ShapedScene | None) -> tuple[View, ...]:
    if not isinstance(views, str | Path):
        if not views:
            raise InputError("There are no views.", "Give one or more.")
        return tuple(views)
    world = world_of(scene)
    faces = {} if shaped is None else dict(shaped.numbers.mesh.faces)
    start = 0 if shaped is None else sum(len(each.triangles) for each in world.cloths[: shaped.cloth])
    count = 0 if shaped is None else len(world.cloths[shaped.cloth].triangles)
    panels = {name: start + np.arange(count)[own] for name, own in faces.items()}
    parts, number = [np.zeros((0, 3), np.int64)], 0
    places = [np.zeros((0, 3))]
    everything = world.start() + world.origin
    for body, rows in zip(world.bodies, world.body_slices, strict=True):
        parts.append(body.triangles + number)
        places.append(everything[rows])
        number += len(places[-1])
    return read_views(views, panels, Obstacle(np.concatenate(places), np.concatenate(parts)))


def _moves(fit: ViewFit, seen: Seen, tell: Callable[[Seen], None]) -> Floats | None:
    """Derivatives of the vertices by the logarithms, (3 n, k), by differences of runs; None if one fails."""
    steps = by_kind(fit.problem.paths, PATTERN_STEP, FABRIC_STEP)
    columns = []
    for k, step in enumerate(steps):
        for sign in (1.0, -1.0):  # a run may fail on one side
            at = seen.at + sign * step * np.eye(len(steps))[k]
            beside = fit.seen(at, seen.begun)
            tell(beside)
            if beside.parts:
                columns.append((beside.positions - seen.positions).ravel() / (sign * step))
                break
        else:
            return None
    return np.array(columns).T


def _searched(fit: ViewFit, begun: Seen, tell: Callable[[Seen], None]) -> SearchEnd:
    """The end of a search from a drape that is pulled to its pictures; where friction holds it, again after FEW steps.

    A first guess of other widths is not pulled to the right place: the search would go on slowly from there.
    """
    if not begun.parts:
        raise ClothsimError(f"The pictures cannot be compared with the first run: {begun.failure}")
    held = fit.held
    drape = pulled(fit, begun)
    tell(drape)
    end = _descended(fit, drape, tell, FEW_ITERATIONS if held else MOST_ITERATIONS)
    for _ in range(ROUNDS if held else 0):
        again = pulled(fit, end.last)
        tell(again)
        try:
            further = _descended(fit, again, tell, FEW_ITERATIONS, end.moves)
        except ClothsimError:  # runs beside the pulled drape fail: the search before it has its end
            break
        gain = end.last.total - further.last.total
        end = replace(further if gain > 0 else end, runs=end.runs + further.runs, adjoint=end.adjoint + further.adjoint)
        if gain < WORTH * end.last.total:
            break
    return end if end.fresh else replace(end, moves=_moves_at(fit, end.last, tell), runs=end.runs + len(begun.at))


def _on_finer_cloth(
    finer: ViewFit, placed: Floats, weights: csr_array, coarse: SearchEnd, tell: Callable[[Seen], None]
) -> SearchEnd:
    """A few steps on a cloth with four triangles for one, with the derivatives that the coarse one has, continued.

    ClothsimError where it cannot be run.
    """
    begun = finer.seen(coarse.last.at, placed)
    tell(begun)
    if not begun.parts:
        raise ClothsimError(begun.failure)
    drape = pulled(finer, begun)
    tell(drape)
    moves = of_finer_cloth(weights, coarse.moves)
    end = _descended(finer, drape, tell, FEW_ITERATIONS, moves, differences=False)
    return replace(end, runs=end.runs + 2)


def _moves_at(fit: ViewFit, seen: Seen, tell: Callable[[Seen], None]) -> Floats:
    """As in `_moves`. ClothsimError where a run fails."""
    moves = _moves(fit, seen, tell)
    if moves is None:
        raise ClothsimError(f"The runs beside {fit.problem.values(seen.at)} fail.", "Start from other numbers.")
    return moves


def _descended(
    fit: ViewFit,
    seen: Seen,
    tell: Callable[[Seen], None],
    most: int,
    moves: Floats | None = None,
    differences: bool = True,
) -> SearchEnd:
    """The end after `most` steps; moves: derivatives to begin with; differences: whether others may be taken."""
    k, runs, adjoint = len(seen.at), 0, 0.0
    largest = by_kind(fit.problem.paths, LARGEST_PATTERN_STEP, LARGEST_FABRIC_STEP)
    low, high = fit.problem.origin - fit.problem.ranges, fit.problem.origin + fit.problem.ranges

    def follow(at: Floats, begun: Seen) -> Seen:
        return fit.seen(at, begun.positions)

    if differences:
        settled = follow(seen.at, seen)
        seen, runs = settled if settled.parts else seen, 1
    fresh, before = moves is None, seen
    if moves is None:
        moves, runs = _moves_at(fit, seen, tell), runs + k
    for _ in range(most):
        gradient, hessian, _ = fit.linearised(seen, moves)
        before_adjoint = process_time()
        with suppress(NoMinimumError):  # a step beside a saddle: the differences do
            gradient = fit.adjoint(seen).slope
        adjoint += process_time() - before_adjoint
        within = np.maximum(low - seen.at, -largest), np.minimum(high - seen.at, largest)
        # weakly bound to where it is: what the pictures hardly tell goes to its limit, and what they tell goes on
        factor = np.linalg.cholesky(hessian + np.diag(fit.known**-2.0))
        step = np.asarray(lsq_linear(factor.T, -np.linalg.solve(factor, gradient), bounds=within).x)
        enough = LEAST * seen.total if fit.held else 0.0
        done = float(step @ hessian @ step) < max(ENOUGH**2, enough)
        better, tried = (None, 0) if done else halved_until_lower(follow, seen, step, tell)
        runs += tried
        if better is not None:
            moves = broyden_update(moves, seen, better)
            gain, before, seen, fresh = seen.total - better.total, seen, better, False
            before = replace(before, trace=None)
            done = gain < max(ENOUGH, enough)
        if better is None or done:
            if fresh or not differences:
                break
            moves, fresh, runs = _moves_at(fit, seen, tell), True, runs + k
    return SearchEnd(seen, before, moves, fresh, runs, adjoint)
