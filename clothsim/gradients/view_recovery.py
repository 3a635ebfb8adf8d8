"""Numbers recovered from pictures: their errors, the model's own, and what fewer pictures would tell."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from time import process_time

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from clothsim.gradients.loss_of_numbers import count_intersecting_pairs
from clothsim.gradients.mask_border import MaskBorder, Matches
from clothsim.gradients.pattern_numbers import SECTION
from clothsim.gradients.placed_drape import pulled
from clothsim.gradients.recover import Recovery
from clothsim.gradients.view_fit import Seen, ViewFit, errors_of, finer_fit, finer_positions, of_finer_cloth
from clothsim.gradients.views import overlay
from clothsim.patterns.pattern import Pattern
from clothsim.scene import paths as keys_by_path

BLUE, ORANGE = (0, 90, 200), (230, 120, 0)
"""Contours of the recovered cloth, and of the first guess."""


@dataclass(frozen=True)
class PictureFit:
    """How one picture of a view fits in the end.

    Parameters
    ----------
    view, what : str
        The view, and what was measured: "mask", "normals", "depth", "label front", "scan".
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
class Twin:
    """How far the numbers would move if the model were another one that is as right, or more so.

    Parameters
    ----------
    name : str
        "mesh" and "step" of half the size, "time" twice as long, "start" of the scene, pulled to the pictures,
        in place of the last drape; "place": the cloth displaced as far as the pictures show that the model does not
        explain.
    shifts : mapping of str to float
        Relative change of each number, in one step of Gauss and Newton from the recovered ones, of "mesh" with the
        steps that a search took on the finer one, of "place" its standard deviation; empty if it failed.
    failure : str
        Why there is none.
    """

    name: str
    shifts: Mapping[str, float]
    failure: str = ""


@dataclass(frozen=True)
class ViewRecovery(Recovery):
    """Numbers recovered from pictures.

    Parameters
    ----------
    pictures : tuple of PictureFit
        Each of them.
    twins : tuple of Twin
        Results with other models.
    fewer_pictures : mapping of str to mappings
        Relative standard errors of fewer pictures at the same drape, with displacements of the cloth: "masks alone",
        "the view NAME alone".
    wide : tuple of str
        Paths of numbers whose error, including that of the model, is more than half of the uncertainty without
        pictures.
    from_minimum : float
        Largest change of a number in the remaining step, from the gradient of the adjoint, over its standard error.
    folds : tuple of float
        Misfit of the normals for each drape from which the first start was chosen; the scene's own drape comes first.
    cpu_seconds, adjoint_fraction : float
        Processor time of the search, and the share of the adjoint.
    pattern : Pattern, optional
        The pattern with the recovered numbers; None if none of them belongs to a pattern.
    overlays : mapping of str to arrays
        For each view: masks in grey, with the contours of the first guess (orange) and of the recovered cloth (blue).
    notes : tuple of str
        How a scan was laid onto the body; requests that could not be met: a later start that failed, a finer cloth
        that could not be run.
    """

    pictures: tuple[PictureFit, ...] = ()
    twins: tuple[Twin, ...] = ()
    fewer_pictures: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    wide: tuple[str, ...] = ()
    from_minimum: float = float("nan")
    folds: tuple[float, ...] = ()
    cpu_seconds: float = float("nan")
    adjoint_fraction: float = float("nan")
    pattern: Pattern | None = None
    overlays: Mapping[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def adjoint_share(self) -> float:
        """Earlier name of `adjoint_fraction`."""
        warnings.warn("adjoint_share is now adjoint_fraction.", DeprecationWarning, stacklevel=2)
        return self.adjoint_fraction

    @property
    def model_errors(self) -> Mapping[str, float]:
        """Relative error of the model, by path: the root of the sum of the squared shifts of all twins."""
        taken = [twin.shifts for twin in self.twins if not twin.failure]
        return {path: float(np.sqrt(sum(each[path] ** 2 for each in taken))) for path in self.values if taken}

    @property
    def total_errors(self) -> Mapping[str, float]:
        """Relative standard errors, including the error of the model."""
        return {path: float(np.hypot(error, self.model_errors.get(path, 0.0))) for path, error in self.errors.items()}


@dataclass(frozen=True)
class SearchRecord:
    """What a search took.

    runs; minima: sums at the ends of all starts; note: what the prior is; began: processor time at its start; adjoint:
    that of the adjoint [s]; folds: misfits of the drapes that the first start was chosen from; twins: whether other
    models are to be run; coarse: logarithms (k,) that the search ended at before the cloth was meshed more finely;
    failed: sentences on starts and a finer cloth that failed.
    """

    runs: int
    minima: tuple[float, ...]
    note: str
    began: float
    adjoint: float
    folds: tuple[float, ...]
    twins: bool
    coarse: Floats | None = None
    failed: tuple[str, ...] = ()


def recovery_of(fit: ViewFit, first: Floats, end: tuple[Seen, Seen, Floats], search: SearchRecord) -> ViewRecovery:
    """Return what a search found.

    Parameters
    ----------
    fit : ViewFit
        The pictures.
    first : (n, 3) float64
        Positions of the scene's own run [m].
    end : tuple
        The last run, the one before it, and the derivatives of the vertices at the last, (3 n, k).
    search : SearchRecord
        What it took.
    """
    last, before, moves = end
    problem, paths = fit.problem, fit.problem.paths
    spread = fit.placed(last).spread()
    covariance, by_place, hessian = fit.errors(last, moves, spread)
    known = fit.known
    variances, directions = np.linalg.eigh(covariance / np.outer(known, known))
    errors = errors_of(covariance)
    loose = [
        directions[:, k] * np.sign(directions[np.abs(directions[:, k]).argmax(), k])
        for k in np.flatnonzero(variances > 0.25)
    ]
    trace = fit.traced(last)
    before_adjoint = process_time()
    gradient = fit.adjoint(last)
    adjoint = search.adjoint + process_time() - before_adjoint
    left = np.linalg.lstsq(hessian, gradient.slope, rcond=1e-12)[0]
    at_limit = np.abs(np.abs(last.at - problem.origin) - problem.ranges) < 1e-3
    values = problem.values(last.at)
    shaped = problem.shaped
    of_pattern = {path: value for path, value in values.items() if path.startswith(SECTION)}
    shown = dict(zip(paths, np.sqrt(np.diag(by_place)).tolist(), strict=True))
    others = _twins(fit, last, moves, search.coarse) if search.twins else ()
    twins = (*others, Twin("place", shown)) if search.twins else ()
    out = []
    for (view, what), each in zip(fit.pairs, last.parts, strict=True):
        loss = view.losses[what]
        switched = float("nan")
        if isinstance(loss, MaskBorder):
            matches: list[Matches] = [loss.matched(x, fit.triangles) for x in (last.positions, before.positions)]
            switched = matches[0].switched(matches[1])
        misfit = float(np.sqrt(each.weights @ each.values**2 / each.weights.sum()))
        out.append(PictureFit(view.name, what, misfit, each.left_out, switched))
    found = ViewRecovery(
        problem.scene_at(last.at),
        values,
        dict(zip(paths, errors.tolist(), strict=True)),
        (),
        tuple(dict(zip(paths, each.tolist(), strict=True)) for each in loose),
        tuple(path for path, limit in zip(paths, at_limit, strict=True) if limit),
        replace(gradient, intersecting_pairs=count_intersecting_pairs(trace)),
        search.minima,
        search.runs + len(others),
        search.note,
        tuple(out),
        twins,
        _errors_of_fewer_pictures(fit, last, moves, spread),
        (),
        float(np.max(np.abs(left) / np.maximum(errors, 1e-300))),
        search.folds,
        float("nan"),
        float("nan"),
        None if shaped is None else shaped.numbers.pattern(of_pattern),
        _overlays(fit, first, last.positions),
        (*(view.note for view in fit.views if view.note), *search.failed),
    )
    errors_with_model = found.total_errors
    wide = tuple(path for path, own in zip(paths, known, strict=True) if not errors_with_model[path] < 0.5 * own)
    seconds = process_time() - search.began
    return replace(found, wide=wide, cpu_seconds=seconds, adjoint_fraction=adjoint / seconds)


def _twins(fit: ViewFit, last: Seen, moves: Floats, coarse: Floats | None) -> tuple[Twin, ...]:
    """The numbers of four other models, each in one step from those that were found."""
    solver = fit.problem.scene.solver
    key = "error" if solver.error else "dt"
    finer_steps = keys_by_path.replace(fit.problem.scene, f"solver.{key}", 0.5 * getattr(solver, key))
    stepped = replace(fit, problem=replace(fit.problem, scene=finer_steps))
    models: dict[str, Callable[[], tuple[ViewFit, Seen, Floats]]] = {
        "mesh": lambda: _on_finer(fit, last, moves),
        "step": lambda: (stepped, stepped.seen(last.at, last.begun), moves),
        "time": lambda: (fit, fit.seen(last.at, last.positions), moves),
        "start": lambda: (fit, pulled(fit, fit.seen(last.at, np.zeros((0, 3)))), moves),
    }
    own, found = fit.left(last, moves), list[Twin]()
    if coarse is not None:
        found.append(Twin("mesh", dict(zip(fit.problem.paths, (last.at - coarse + own).tolist(), strict=True))))
        models.pop("mesh")
    for name, model in models.items():
        try:
            other, seen, other_moves = model()
        except ClothsimError as error:
            found.append(Twin(name, {}, error.sentence))
            continue
        shifts = other.left(seen, other_moves) - own if seen.parts else np.zeros(0)
        by_path = dict(zip(fit.problem.paths, shifts.tolist(), strict=False))
        found.append(Twin(name, by_path, seen.failure))
    return tuple(found)


def _on_finer(fit: ViewFit, last: Seen, moves: Floats) -> tuple[ViewFit, Seen, Floats]:
    """The pictures, the run and the derivatives of a cloth with four triangles for one."""
    finer, weights = finer_fit(fit, last.at)
    return finer, finer.seen(last.at, finer_positions(fit, finer, last.positions)), of_finer_cloth(weights, moves)


def _errors_of_fewer_pictures(fit: ViewFit, last: Seen, moves: Floats, spread: float) -> dict[str, dict[str, float]]:
    """Errors of numbers by path by fewer pictures, by the name of these."""
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
        by_noise, by_place, _ = fit.errors(last, moves, spread, kept)
        errors = errors_of(by_noise + by_place)
        out[name] = {path: float(error) for path, error in zip(fit.problem.paths, errors, strict=True)}
    return out


def _overlays(fit: ViewFit, first: Floats, last: Floats) -> dict[str, np.ndarray]:
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
