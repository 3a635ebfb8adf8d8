"""Recovery of numbers of a scene and of its pattern from calibrated pictures, by Gauss and Newton's method.

The sum of rho(r) over the residuals of all pictures, r over its noise and rho the Huber function, is minimised over the
logarithms q of the numbers (`gauss_newton`); the correspondence is found anew at each run, and held in a step. A run
begins from the drape that was accepted last, so that folds go on as they are. At the end the adjoint gives the gradient
of the same sum: how far the end is from a minimum, in standard errors, does not rest on the differences.

Standard errors: neighbouring pixels err alike, so the covariance is H^-1 M H^-1 with H = J'WJ and M the sum of the
squares of the gradients of blocks of pixels (White 1982, "Maximum likelihood estimation of misspecified models"). They
are given the model: what meshes and time steps do to the drape is not in them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError, InputError
from clothsim.gradients.fabric_prior import SOURCE, WEIGHTS, bending_prior
from clothsim.gradients.gauss_newton import Search
from clothsim.gradients.loss_of_numbers import Evaluation, Problem, derivatives, intersecting_pairs, problem_of
from clothsim.gradients.losses import Custom
from clothsim.gradients.mask_border import MaskBorder, Matches
from clothsim.gradients.parameters import full_path
from clothsim.gradients.pattern_numbers import SECTION
from clothsim.gradients.picture_loss import Obstacle, Residuals
from clothsim.gradients.recover import Recovery
from clothsim.gradients.run import Trace, traced
from clothsim.gradients.scene_of_pattern import ShapedScene, shaped_scene
from clothsim.gradients.views import View, overlay, read_views
from clothsim.patterns.pattern import Pattern
from clothsim.patterns.pattern_mesh import PatternMesh
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.scene import Scene

BLOCK = 40
"""Side of a block of pixels that err alike."""
BOTH_WAYS = 0.5
"""Weight of a residual of a mask's border, each piece of which is compared twice."""
PATTERN_STEP, FABRIC_STEP = 0.005, 0.04
"""Differences of logarithms by which the cloth's derivatives are taken."""
PATTERN_REACH, FABRIC_REACH = 0.08, 0.7
"""Largest changes of logarithms in a step."""
PATTERN_PRIOR, FABRIC_PRIOR = 0.2, 0.85
"""Standard deviations of logarithms that pictures are compared with: what half of it is not told."""
UNTOLD = 1e3
"""Standard deviation, in those, of what keeps the covariance finite where the pictures tell nothing."""
MOST_ERROR = 3.0
"""Standard deviation of a logarithm from which a number is not determined."""
BLUE, ORANGE = (0, 90, 200), (230, 120, 0)
"""Contours of the recovered cloth, and of the first guess."""


@dataclass(frozen=True)
class PictureFit:
    """How one picture of a view fits in the end.

    Parameters
    ----------
    view, what : str
        The view, and what was measured: "mask", "normals", "depth", "label front".
    misfit : float
        Root mean square residual, over the noise.
    left_out : float
        Share of its measurements without a residual: behind a body, of another fold.
    switched : float
        Share of a mask's points that had another one in the run before; nan of others.
    """

    view: str
    what: str
    misfit: float
    left_out: float
    switched: float


@dataclass(frozen=True)
class ViewRecovery(Recovery):
    """Numbers recovered from pictures.

    Parameters
    ----------
    pictures : tuple of PictureFit
        Each of them.
    told : mapping of str to mappings
        Relative standard errors of fewer pictures at the same drape: "masks alone", "the view NAME alone".
    wide : tuple of str
        Paths of numbers whose standard error is more than half of what is known without pictures.
    from_minimum : float
        Largest change of a number in the step that is left, by the gradient of the adjoint, over its standard error.
    pattern : Pattern, optional
        The pattern with the numbers; None where none of them are of a pattern.
    overlays : mapping of str to arrays
        By view: masks in grey, contours of the first guess orange, of the recovered cloth blue.
    """

    pictures: tuple[PictureFit, ...] = ()
    told: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    wide: tuple[str, ...] = ()
    from_minimum: float = float("nan")
    pattern: Pattern | None = None
    overlays: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Seen:
    """A run, and what is left of the pictures.

    at: logarithms (k,); total: the sum, inf where the run cannot be taken; begun: positions that it began from, empty
    for the scene's own.
    """

    at: Floats
    total: float
    positions: Floats
    parts: tuple[Residuals, ...]
    begun: Floats
    failure: str = ""


@dataclass(frozen=True, eq=False)
class _Fit:
    """The pictures of a problem, with the prior: mean (k,) and precision (k, k) of the logarithms."""

    problem: Problem
    views: tuple[View, ...]
    triangles: Ints
    mean: Floats
    precision: Floats

    @property
    def pairs(self) -> list[tuple[View, str]]:
        """Each picture: the view and what was measured."""
        return [(view, what) for view in self.views for what in view.losses]

    def residuals(self, positions: Floats) -> tuple[Residuals, ...]:
        """Return the residuals of all pictures, those of borders at half of their weight."""
        found = []
        for view, what in self.pairs:
            loss = view.losses[what]
            own = loss.residuals(positions, self.triangles)
            found.append(replace(own, weights=BOTH_WAYS * own.weights) if isinstance(loss, MaskBorder) else own)
        return tuple(found)

    def total(self, parts: Sequence[Residuals], at: Floats) -> float:
        """The sum that is minimised."""
        away = at - self.mean
        return sum(float(each.weights @ each.costs) for each in parts) + 0.5 * float(away @ self.precision @ away)

    def trace(self, at: Floats, begun: Floats) -> Trace:
        """Run from some positions (n, 3), or from the scene's own where they are empty."""
        start = {"start": begun, "velocity": np.zeros_like(begun)} if len(begun) else None
        return traced(self.problem.scene_at(at), self.problem.stiffness, start=start)

    def seen(self, at: Floats, begun: Floats) -> _Seen:
        """Take a run; a failed one is an outcome too."""
        try:
            x = self.trace(at, begun).cloth_positions()
            parts = self.residuals(x)
        except ClothsimError as error:
            return _Seen(at, float("inf"), np.zeros((0, 3)), (), begun, error.sentence)
        return _Seen(at, self.total(parts, at), x, parts, begun)

    def linearised(
        self, seen: _Seen, moves: Floats, kept: Callable[[str, str], bool] = lambda view, what: True
    ) -> tuple[Floats, Floats, Floats]:
        """Gradient (k,), Gauss-Newton Hessian (k, k) and gradients of blocks (b, k), moves (3 n, k) of the vertices.

        kept: which pictures count, by view and by what was measured.
        """
        k = len(seen.at)
        gradient, hessian = self.precision @ (seen.at - self.mean), self.precision.copy()
        blocks = dict[tuple[str, int, int], Floats]()
        for (view, what), each in zip(self.pairs, seen.parts, strict=True):
            if not kept(view.name, what):
                continue
            rows = each.jacobian @ moves
            steep = each.weights * each.slopes
            bent = each.weights * np.minimum(1.0, each.huber / np.maximum(np.abs(each.values), 1e-12))
            gradient = gradient + rows.T @ steep
            hessian = hessian + (rows * bent[:, None]).T @ rows
            cells = np.floor(each.pixels / BLOCK).astype(np.int64)
            unique, number = np.unique(cells, axis=0, return_inverse=True)
            sums = np.zeros((len(unique), k))
            np.add.at(sums, number.ravel(), rows * steep[:, None])
            for cell, own in zip(unique.tolist(), sums, strict=True):
                key = (view.name, *cell)
                blocks[key] = blocks.get(key, 0.0) + own
        return gradient, hessian, np.array(list(blocks.values())).reshape(-1, k)

    def covariance(self, hessian: Floats, blocks: Floats) -> Floats:
        """Covariance of the logarithms (k, k) by blocks."""
        known = _by_kind(self.problem.paths, PATTERN_PRIOR, FABRIC_PRIOR)
        floor = np.diag((UNTOLD * known) ** -2.0)
        inverse = np.linalg.inv(hessian + floor)
        middle = blocks.T @ blocks * (len(blocks) / max(len(blocks) - len(hessian), 1)) + self.precision
        return np.asarray(inverse @ (middle + floor) @ inverse)


def recover_views(
    scene: Scene,
    views: str | Path | Sequence[View],
    free: Sequence[str],
    starts: int = 1,
    progress: Callable[[int, Evaluation], None] | None = None,
    seed: int = 0,
    pattern: PatternMesh | None = None,
    prior: bool = False,
) -> ViewRecovery:
    """Find the numbers of a scene for which its cloth looks in the end as in calibrated pictures.

    Parameters
    ----------
    scene : Scene
        Its numbers are the first start. Contact stiffness is held at that of its own run.
    views : str, Path or sequence of View
        A TOML file of views (`gradients.views`), in the coordinates of the scene; or the views.
    free, starts, progress, seed, pattern
        As of `recover`.
    prior : bool
        Weigh stiffnesses of bending with those of 618 measured fabrics of the cloth's weight (`bending_prior`).

    Raises
    ------
    InputError
        For a picture that is none, a number that cannot be varied, or a cloth that no camera sees at the start.
    ClothsimError
        Where the scene itself cannot be run.
    """
    paths = tuple(dict.fromkeys(full_path(name) for name in free))
    shaped = shaped_scene(scene, pattern) if any(path.startswith(SECTION) for path in paths) else None
    made = _views(views, scene if shaped is None else shaped.scene, shaped)
    mean_loss = Custom(lambda x: (0.0, np.zeros_like(x)))
    problem = problem_of(scene, mean_loss, free, pattern)
    triangles = world_of(problem.scene).triangles
    fit = _Fit(problem, made, triangles, problem.origin, np.zeros((len(paths),) * 2))
    note = ""
    if prior:
        fit, note = _with_prior(fit)
    rng, ends, runs = np.random.default_rng(seed), list[tuple[_Seen, _Seen, Floats]](), 1
    own = np.zeros((0, 3))
    first = fit.seen(problem.origin, own)
    if not first.parts:
        raise InputError(f"The pictures cannot be compared with the scene as it is: {first.failure}")
    for start in range(1, max(1, starts) + 1):
        offset = problem.spreads * rng.uniform(-1.0, 1.0, len(paths)) if start > 1 else 0.0

        def tell(seen: _Seen, number: int = start) -> None:
            if progress is not None:
                values = problem.values(seen.at)
                progress(number, Evaluation(values, seen.total, np.zeros(len(values)), failure=seen.failure))

        begun = first if start == 1 else fit.seen(problem.origin + offset, own)
        tell(begun)
        if begun.parts:
            settled = fit.seen(begun.at, begun.positions)
            last, before, moves, taken = _search(fit, tell).descended(settled if settled.parts else begun)
            ends.append((last, before, moves))
            runs += taken
    best = min(ends, key=lambda each: each[0].total)
    return _result(fit, first, *best, runs=runs, minima=tuple(each[0].total for each in ends), note=note)


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


def _with_prior(fit: _Fit) -> tuple[_Fit, str]:
    """The fit with the prior of stiffnesses of bending, and what it is."""
    paths = fit.problem.paths
    bending = [k for k, path in enumerate(paths) if path.startswith("cloth.") and path.rpartition(".")[2] in WEIGHTS]
    if not bending:
        raise InputError("The prior is of stiffnesses of bending, and none is free.", f"Free {', '.join(WEIGHTS)}.")
    if any(path.endswith(".density") for path in paths):
        raise InputError("The prior is one for a weight, and the density is free.", "Weigh the cloth.")
    density = world_of(fit.problem.scene).cloths[0].fabric.density
    before = bending_prior(tuple(paths[k].rpartition(".")[2] for k in bending), density)
    mean, precision = fit.mean.copy(), fit.precision.copy()
    mean[bending] = before.mean
    precision[np.ix_(bending, bending)] = np.linalg.inv(before.covariance)
    return replace(fit, mean=mean, precision=precision), f"bending of {SOURCE} at {density:g} kg/m2, log-normal"


def _by_kind(paths: Sequence[str], of_pattern: float, of_fabric: float) -> Floats:
    """A number for each path, of the pattern or not."""
    return np.array([of_pattern if path.startswith(SECTION) else of_fabric for path in paths])


def _search(fit: _Fit, tell: Callable[[_Seen], None]) -> Search[_Seen]:
    """The search of a fit; each run begins from the drape beside which it is."""
    paths, origin, ranges = fit.problem.paths, fit.problem.origin, fit.problem.ranges
    return Search(
        lambda at, seen: fit.seen(at, seen.positions),
        lambda at, seen: fit.seen(at, seen.begun),
        lambda seen, moves: fit.linearised(seen, moves)[:2],
        _by_kind(paths, PATTERN_STEP, FABRIC_STEP),
        _by_kind(paths, PATTERN_REACH, FABRIC_REACH),
        origin - ranges,
        origin + ranges,
        tell,
    )


def _result(
    fit: _Fit, first: _Seen, last: _Seen, before: _Seen, moves: Floats, runs: int, minima: tuple[float, ...], note: str
) -> ViewRecovery:
    problem, paths = fit.problem, fit.problem.paths
    _, hessian, blocks = fit.linearised(last, moves)
    covariance = fit.covariance(hessian, blocks)
    known = _by_kind(paths, PATTERN_PRIOR, FABRIC_PRIOR)
    spread, directions = np.linalg.eigh(covariance / np.outer(known, known))
    errors = _errors(covariance)
    loose = [
        directions[:, k] * np.sign(directions[np.abs(directions[:, k]).argmax(), k])
        for k in np.flatnonzero(spread > 0.25)
    ]
    trace = fit.trace(last.at, last.begun)
    gradient = _adjoint_gradient(fit, trace, last)
    left = np.linalg.lstsq(hessian, gradient.slope, rcond=1e-12)[0]
    wide = tuple(path for path, error, own in zip(paths, errors, known, strict=True) if not error < 0.5 * own)
    at_limit = np.abs(np.abs(last.at - problem.origin) - problem.ranges) < 1e-3
    values = problem.values(last.at)
    shaped = problem.shaped
    of_pattern = {path: value for path, value in values.items() if path.startswith(SECTION)}
    return ViewRecovery(
        problem.scene_at(last.at),
        values,
        {path: float(error) for path, error in zip(paths, errors, strict=True)},
        (),
        tuple(dict(zip(paths, each.tolist(), strict=True)) for each in loose),
        tuple(path for path, limit in zip(paths, at_limit, strict=True) if limit),
        replace(gradient, intersecting_pairs=intersecting_pairs(trace)),
        minima,
        runs + 1,
        note,
        _fits(fit, last, before),
        _told(fit, last, moves),
        wide,
        float(np.max(np.abs(left) / np.maximum(errors, 1e-300))),
        None if shaped is None else shaped.numbers.pattern(of_pattern),
        _overlays(fit, first.positions, last.positions),
    )


def _errors(covariance: Floats) -> Floats:
    """Standard deviations of logarithms (k,), inf where a number is not determined."""
    errors = np.sqrt(np.diag(covariance))
    return np.where(errors > MOST_ERROR, np.inf, errors)


def _told(fit: _Fit, last: _Seen, moves: Floats) -> dict[str, dict[str, float]]:
    """Errors of numbers by path as fewer pictures tell them, by their name."""
    kinds = {what for _, what in fit.pairs}
    parts: dict[str, Callable[[str, str], bool]] = {}
    if "mask" in kinds and len(kinds) > 1:
        parts["masks alone"] = lambda view, what: what == "mask"
    if len(fit.views) > 1:
        first = fit.views[0].name
        parts[f"the view {first} alone"] = lambda view, what: view == first
        if "masks alone" in parts:
            parts[f"the mask of {first} alone"] = lambda view, what: view == first and what == "mask"
    out = {}
    for name, kept in parts.items():
        _, hessian, blocks = fit.linearised(last, moves, kept)
        errors = _errors(fit.covariance(hessian, blocks))
        out[name] = {path: float(error) for path, error in zip(fit.problem.paths, errors, strict=True)}
    return out


def _adjoint_gradient(fit: _Fit, trace: Trace, last: _Seen) -> Evaluation:
    """The sum and its derivative by the logarithms, through the adjoint of the run."""
    by_x = np.sum([each.jacobian.T @ (each.weights * each.slopes) for each in last.parts], axis=0, dtype=np.float64)
    gradient = trace.gradient(Custom(lambda x: (last.total, by_x.reshape(-1, 3))))
    problem = fit.problem
    values = problem.values(last.at)
    slope = derivatives(values, gradient, problem.shaped) * list(values.values())
    slope = slope + fit.precision @ (last.at - fit.mean)
    return Evaluation(values, last.total, slope, gradient.newton_error)


def _fits(fit: _Fit, last: _Seen, before: _Seen) -> tuple[PictureFit, ...]:
    out = []
    for (view, what), each in zip(fit.pairs, last.parts, strict=True):
        loss = view.losses[what]
        switched = float("nan")
        if isinstance(loss, MaskBorder):
            matches: list[Matches] = [loss.matched(x, fit.triangles) for x in (last.positions, before.positions)]
            switched = matches[0].switched(matches[1])
        misfit = float(np.sqrt(each.weights @ each.values**2 / each.weights.sum()))
        out.append(PictureFit(view.name, what, misfit, each.left_out, switched))
    return tuple(out)


def _overlays(fit: _Fit, first: Floats, last: Floats) -> dict[str, np.ndarray]:
    pictures = {}
    for view in fit.views:
        border = next((loss for loss in view.losses.values() if isinstance(loss, MaskBorder)), None)
        own = border or MaskBorder(view.camera, np.zeros((view.camera.height, view.camera.width)))
        contours = [
            (replace(own, label=np.zeros(0, np.int64), spacing=0.7).contour(x, fit.triangles)[0].pixels, colour)
            for x, colour in ((first, ORANGE), (last, BLUE))
        ]
        pictures[view.name] = overlay(view, contours)
    return pictures
