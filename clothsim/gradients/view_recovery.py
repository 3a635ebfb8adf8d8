"""Numbers recovered from pictures: their errors, the model's own, and what fewer pictures would tell."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from time import process_time
from typing import Any

import numpy as np
from scipy.sparse import block_diag, csr_array, eye_array, kron

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError, InputError
from clothsim.gradients.loss_of_numbers import count_intersecting_pairs
from clothsim.gradients.mask_border import MaskBorder, Matches
from clothsim.gradients.pattern_numbers import SECTION
from clothsim.gradients.picture_loss import PictureLoss
from clothsim.gradients.pulled_drape import pulled
from clothsim.gradients.recover import Recovery
from clothsim.gradients.run import traced
from clothsim.gradients.view_fit import Seen, ViewFit, errors_of
from clothsim.gradients.views import overlay
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.mesh.refinement import refined
from clothsim.patterns.pattern import Pattern
from clothsim.scene import paths as keys_by_path
from clothsim.scene.scene import Scene

HELD = ("inertia", "membrane", "bending", "gravity", "damping", "pins", "body_contact", "self_contact", "friction")
"""Effects that name no vertices, or pins: a cloth with others is not meshed more finely for a twin."""
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
class Twin:
    """How far the numbers would move if the model were another one that is as right, or more so.

    Parameters
    ----------
    name : str
        "mesh" and "step" of half the size, "time" twice as long, "start" of the scene, pulled to the pictures,
        in place of the last drape.
    shifts : mapping of str to float
        Relative change of each number, in one step of Gauss and Newton from the recovered ones; empty if it failed.
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
        Four other models.
    fewer_pictures : mapping of str to mappings
        Relative standard errors of fewer pictures at the same drape: "masks alone", "the view NAME alone".
    wide : tuple of str
        Paths of numbers whose error, with the model's own, is more than half of what is known without pictures.
    from_minimum : float
        Largest change of a number in the step that is left, by the gradient of the adjoint, over its standard error.
    folds : tuple of float
        Misfit of the normals of each drape that the first start was chosen from, the scene's own first.
    cpu_seconds, adjoint_fraction : float
        Processor time of the search, and the share of the adjoint.
    pattern : Pattern, optional
        The pattern with the numbers; None where none of them are of a pattern.
    overlays : mapping of str to arrays
        By view: masks in grey, contours of the first guess orange, of the recovered cloth blue.
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

    @property
    def model_errors(self) -> Mapping[str, float]:
        """Root of the sum of the squares of the shifts of all twins, by path: the model's own relative error."""
        taken = [twin.shifts for twin in self.twins if not twin.failure]
        return {path: float(np.sqrt(sum(each[path] ** 2 for each in taken))) for path in self.values if taken}

    @property
    def total_errors(self) -> Mapping[str, float]:
        """Relative standard errors with the model's own."""
        return {path: float(np.hypot(error, self.model_errors.get(path, 0.0))) for path, error in self.errors.items()}


@dataclass(frozen=True)
class SearchRecord:
    """What a search took.

    runs; minima: sums at the ends of all starts; note: what the prior is; began: processor time at its start; adjoint:
    that of the adjoint [s]; folds: misfits of the drapes that the first start was chosen from; twins: whether other
    models are to be run.
    """

    runs: int
    minima: tuple[float, ...]
    note: str
    began: float
    adjoint: float
    folds: tuple[float, ...]
    twins: bool


def recovery_of(fit: ViewFit, first: Seen, end: tuple[Seen, Seen, Floats], search: SearchRecord) -> ViewRecovery:
    """Return what a search found.

    Parameters
    ----------
    fit : ViewFit
        The pictures.
    first : Seen
        The run of the scene itself.
    end : tuple
        The last run, the one before it, and the derivatives of the vertices at the last, (3 n, k).
    search : SearchRecord
        What it took.
    """
    last, before, moves = end
    problem, paths = fit.problem, fit.problem.paths
    _, hessian, blocks = fit.linearised(last, moves)
    covariance = fit.covariance(hessian, blocks)
    known = fit.known
    spread, directions = np.linalg.eigh(covariance / np.outer(known, known))
    errors = errors_of(covariance)
    loose = [
        directions[:, k] * np.sign(directions[np.abs(directions[:, k]).argmax(), k])
        for k in np.flatnonzero(spread > 0.25)
    ]
    trace = fit.trace(last.at, last.begun) if last.trace is None else last.trace
    before_adjoint = process_time()
    gradient = fit.adjoint(last, trace)
    adjoint = search.adjoint + process_time() - before_adjoint
    left = np.linalg.lstsq(hessian, gradient.slope, rcond=1e-12)[0]
    at_limit = np.abs(np.abs(last.at - problem.origin) - problem.ranges) < 1e-3
    values = problem.values(last.at)
    shaped = problem.shaped
    of_pattern = {path: value for path, value in values.items() if path.startswith(SECTION)}
    twins = _twins(fit, last, moves) if search.twins else ()
    found = ViewRecovery(
        problem.scene_at(last.at),
        values,
        dict(zip(paths, errors.tolist(), strict=True)),
        (),
        tuple(dict(zip(paths, each.tolist(), strict=True)) for each in loose),
        tuple(path for path, limit in zip(paths, at_limit, strict=True) if limit),
        replace(gradient, intersecting_pairs=count_intersecting_pairs(trace)),
        search.minima,
        search.runs + len(twins),
        search.note,
        _fits(fit, last, before),
        twins,
        _errors_of_fewer_pictures(fit, last, moves),
        (),
        float(np.max(np.abs(left) / np.maximum(errors, 1e-300))),
        search.folds,
        float("nan"),
        float("nan"),
        None if shaped is None else shaped.numbers.pattern(of_pattern),
        _overlays(fit, first.positions, last.positions),
    )
    errors_with_model = found.total_errors
    wide = tuple(path for path, own in zip(paths, known, strict=True) if not errors_with_model[path] < 0.5 * own)
    seconds = process_time() - search.began
    return replace(found, wide=wide, cpu_seconds=seconds, adjoint_fraction=adjoint / seconds)


def _twins(fit: ViewFit, last: Seen, moves: Floats) -> tuple[Twin, ...]:
    """The numbers of four other models, each in one step from those that were found."""
    solver = fit.problem.scene.solver
    key = "error" if solver.error else "dt"
    finer_steps = keys_by_path.replace(fit.problem.scene, f"solver.{key}", 0.5 * getattr(solver, key))
    stepped = replace(fit, problem=replace(fit.problem, scene=finer_steps))
    models: dict[str, Callable[[], tuple[ViewFit, Seen, Floats]]] = {
        "mesh": lambda: _halved(fit, last, moves),
        "step": lambda: (stepped, stepped.seen(last.at, last.begun), moves),
        "time": lambda: (fit, fit.seen(last.at, last.positions), moves),
        "start": lambda: (fit, pulled(fit, fit.seen(last.at, np.zeros((0, 3)))), moves),
    }
    own, found = fit.left(last, moves), list[Twin]()
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


def _halved(fit: ViewFit, last: Seen, moves: Floats) -> tuple[ViewFit, Seen, Floats]:
    """The pictures, the run and the derivatives of a cloth with four triangles for one."""
    scene, weights, triangles = halved(fit.problem.scene_at(last.at))
    views = [replace(view, losses={what: _of_fine(loss) for what, loss in view.losses.items()}) for view in fit.views]
    finer = replace(fit, views=tuple(views), triangles=triangles)
    begun = np.asarray(weights @ last.positions)
    x = traced(scene, fit.problem.stiffness, start={"start": begun, "velocity": 0.0 * begun}).cloth_positions()
    parts = finer.residuals(x)
    fine_moves = np.asarray(csr_array(kron(weights, eye_array(3))) @ moves)
    return finer, Seen(last.at, finer.total(parts, last.at), x, parts, begun), fine_moves


def _of_fine(loss: PictureLoss) -> PictureLoss:
    """The loss of a picture for a cloth with four triangles for one."""
    if not isinstance(loss, MaskBorder):
        return loss
    return replace(loss, label=(4 * np.asarray(loss.label, np.int64)[:, None] + np.arange(4)).ravel())


def halved(scene: Scene) -> tuple[Scene, csr_array, Ints]:
    """Return a scene whose cloths of arrays have four triangles for one, its vertices as combinations, and triangles.

    InputError for another mesh, arrays of its keys, and effects that name vertices other than pins.
    """
    others = [name for name in scene.effects if name not in HELD]
    if others:
        raise InputError(f"The effect {others[0]} may name vertices, which a finer mesh has others of.")
    tables, parts, fine, count = list[Any](), list[csr_array](), list[Ints](), 0
    for keys in scene.cloths:
        mesh = keys.mesh
        if not isinstance(mesh, MeshArrays) or any(isinstance(value, np.ndarray) for value in keys.values()):
            raise InputError("The cloth is not a mesh of arrays, or has keys that are arrays.")
        weights, triangles = refined(mesh.triangles, len(mesh.vertices))
        rest = mesh.vertices if mesh.rest is None else mesh.rest
        groups = {name: (4 * rows[:, None] + np.arange(4)).ravel() for name, rows in mesh.groups.items()}
        finer = MeshArrays.checked(
            "cloth",
            weights @ mesh.vertices,
            triangles,
            _quartered(rest) if mesh.is_flat else weights @ rest,
            groups=groups,
        )
        tables.append({**keys, "mesh": finer})
        parts.append(weights)
        fine.append(triangles + count)
        count += weights.shape[0]
    changed: dict[str, Any] = {"cloth": tables}
    made = replace(scene, **changed)
    pins = scene.effects.get("pins")
    if pins is not None and not isinstance(pins.select, str):
        held = np.asarray(pins.select, np.int64)
        if len(scene.cloths) > 1 or pins.group:
            raise InputError("Pins are of several cloths, or of groups.")
        own: Any = scene.cloths[0].mesh
        made = keys_by_path.replace(made, "effects.pins.select", _with_middles(own, held).tolist())
    return made, csr_array(block_diag(parts)), np.concatenate(fine)


def _quartered(rest: Floats) -> Floats:
    """Material coordinates (4 m, 3, 2) of four triangles for each, in the order of `refined`."""
    a, b, c = (rest[:, k] for k in range(3))
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    return np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3, 2)


def _with_middles(mesh: MeshArrays, held: Ints) -> Ints:
    """Vertices of the finer mesh that are held: also those between two that are."""
    _, fine = refined(mesh.triangles, len(mesh.vertices))
    ends = mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    middles = fine.reshape(-1, 4, 3)[:, 3].ravel()  # ab, bc, ca
    return np.union1d(held, middles[np.isin(ends, held).all(axis=1)])


def _errors_of_fewer_pictures(fit: ViewFit, last: Seen, moves: Floats) -> dict[str, dict[str, float]]:
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
        _, hessian, blocks = fit.linearised(last, moves, kept)
        errors = errors_of(fit.covariance(hessian, blocks))
        out[name] = {path: float(error) for path, error in zip(fit.problem.paths, errors, strict=True)}
    return out


def _fits(fit: ViewFit, last: Seen, before: Seen) -> tuple[PictureFit, ...]:
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
