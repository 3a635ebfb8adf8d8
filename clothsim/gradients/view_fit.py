"""Pictures of a scene as a sum over residuals, its derivatives by numbers, and their covariance.

Neighbouring pixels err alike, so the covariance is H^-1 M H^-1 with H = J'WJ and M the sum of the squares of the
gradients of blocks of pixels (White 1982, "Maximum likelihood estimation of misspecified models").
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, eye_array, kron

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError
from clothsim.gradients.camera import PictureLoss, Residuals
from clothsim.gradients.loss_of_numbers import Evaluation, LossOfNumbers, derivatives
from clothsim.gradients.losses import Custom
from clothsim.gradients.mask_border import MaskBorder
from clothsim.gradients.pattern_numbers import SECTION
from clothsim.gradients.pixel_losses import Normals
from clothsim.gradients.placed_drape import PlacedDrape, precision_of_displacements
from clothsim.gradients.run import Trace, traced
from clothsim.gradients.scan import ScanSurface
from clothsim.gradients.scene_of_pattern import halved, quartered
from clothsim.gradients.views import View
from clothsim.scene.scene import Scene

BOTH_WAYS = 0.5
"""Weight of a residual of a mask's border, each piece of which is compared twice."""
PATTERN_PRIOR, FABRIC_PRIOR = 0.2, 0.85
"""Standard deviations of logarithms that pictures are compared with: an error above half of it is wide."""
AT_REST = np.zeros((0, 3))
"""Velocities of a run that begins at rest."""
UNTOLD = 1e3
"""Standard deviation, in those, of what keeps the covariance finite where the pictures tell nothing."""
MOST_ERROR = 3.0
"""Standard deviation of a logarithm from which a number is not determined."""


def by_kind(paths: Sequence[str], of_pattern: float, of_fabric: float) -> Floats:
    """A number for each path, of the pattern or not."""
    return np.array([of_pattern if path.startswith(SECTION) else of_fabric for path in paths])


@dataclass(frozen=True, eq=False)
class Seen:
    """A run, and what is left of the pictures.

    at: logarithms (k,); total: the sum, beside displacements of a drape that friction holds, inf where the run cannot
    be taken; begun: positions that it began from, empty for the scene's own; trace: its steps, where it was taken now;
    placed: what is left beside displacements; kick: velocities that it began with, empty for 0.
    """

    at: Floats
    total: float
    positions: Floats
    parts: tuple[Residuals, ...]
    begun: Floats
    failure: str = ""
    trace: Trace | None = None
    placed: PlacedDrape | None = None
    kick: Floats = field(default_factory=lambda: AT_REST)


@dataclass(frozen=True, eq=False)
class ViewFit:
    """The pictures of a problem, with the prior: mean (k,) and precision (k, k) of the logarithms.

    halvings: how often the cloth of the runs has four triangles for one.
    """

    problem: LossOfNumbers
    views: tuple[View, ...]
    triangles: Ints
    mean: Floats
    precision: Floats
    halvings: int = 0

    def scene_at(self, at: Floats) -> Scene:
        """Return the scene with other numbers."""
        scene = self.problem.scene_at(at)
        for _ in range(self.halvings):
            scene = halved(scene)[0]
        return scene

    @property
    def pairs(self) -> list[tuple[View, str]]:
        """Each picture: the view and what was measured."""
        return [(view, what) for view in self.views for what in view.losses]

    @property
    def known(self) -> Floats:
        """Standard deviations of the logarithms without pictures, (k,)."""
        return by_kind(self.problem.paths, PATTERN_PRIOR, FABRIC_PRIOR)

    def residuals(self, positions: Floats) -> tuple[Residuals, ...]:
        """Return the residuals of all pictures, those of borders at half of their weight."""
        found = []
        for view, what in self.pairs:
            loss = view.losses[what]
            own = loss.residuals(positions, self.triangles)
            found.append(replace(own, weights=BOTH_WAYS * own.weights) if isinstance(loss, MaskBorder) else own)
        return tuple(found)

    @property
    def held(self) -> bool:
        """Whether friction holds the drape where it came to lie."""
        return {"inertia", "friction"} <= self.problem.scene.effects.keys()

    def total(self, parts: Sequence[Residuals], at: Floats) -> float:
        """The sum over the pictures, and the prior."""
        away = at - self.mean
        return sum(float(each.weights @ each.costs) for each in parts) + 0.5 * float(away @ self.precision @ away)

    def trace(self, at: Floats, begun: Floats, kick: Floats = AT_REST) -> Trace:
        """Run from some positions (n, 3) at rest or with velocities, or from the scene's own where they are empty."""
        start = {"start": begun, "velocity": kick if len(kick) else np.zeros_like(begun)} if len(begun) else None
        return traced(self.scene_at(at), self.problem.stiffness, start=start)

    def seen(self, at: Floats, begun: Floats, kick: Floats = AT_REST) -> Seen:
        """Take a run as of `trace`; a failed one is an outcome too."""
        taken = list[Trace]()

        def run() -> Mapping[str, Floats]:
            taken.append(self.trace(at, begun, kick))
            return {"positions": taken[0].cloth_positions()}

        try:
            scene = self.scene_at(at)
            x = self.problem.kept.of(scene, (*self.problem.held, begun, kick), run)["positions"]
            parts = self.residuals(x)
        except ClothsimError as error:
            return Seen(at, float("inf"), np.zeros((0, 3)), (), begun, error.sentence)
        seen = Seen(at, self.total(parts, at), x, parts, begun, trace=taken[0] if taken else None, kick=kick)
        if not self.held:
            return seen
        placed = PlacedDrape.of(parts, precision_of_displacements(x, self.triangles))
        return replace(seen, total=seen.total - placed.gain, placed=placed)

    def traced(self, seen: Seen) -> Trace:
        """Return the steps of a run, which is taken again where it was kept."""
        return self.trace(seen.at, seen.begun, seen.kick) if seen.trace is None else seen.trace

    def adjoint(self, seen: Seen) -> Evaluation:
        """The sum and its derivative by the logarithms, through the adjoint of the run.

        NoMinimumError where a step of it did not end at a minimum of its energy.
        """
        if seen.placed is None:
            by_x = np.sum([each.jacobian.T @ (each.weights * each.slopes) for each in seen.parts], axis=0)
        else:
            by_x = seen.placed.slope_left
        values = self.problem.values(seen.at)

        def derive() -> Mapping[str, ArrayLike]:
            gradient = self.traced(seen).gradient(Custom(lambda x: (seen.total, by_x.reshape(-1, 3))))
            slope = derivatives(values, gradient, self.problem.shaped, self.halvings) * list(values.values())
            return {"slope": slope, "newton_error": gradient.newton_error}

        given = (*self.problem.held, seen.begun, seen.kick, by_x)
        found = self.problem.kept.of(self.scene_at(seen.at), given, derive)
        slope = found["slope"] + self.precision @ (seen.at - self.mean)
        return Evaluation(values, seen.total, slope, float(found["newton_error"]))

    def folds_misfit(self, seen: Seen) -> float:
        """How badly folds agree: mean rho of scans and normals, those left out at their gate; without them, the sum."""
        if not seen.parts:
            return float("inf")
        scores = []
        for (view, what), each in zip(self.pairs, seen.parts, strict=True):
            loss = view.losses[what]
            if isinstance(loss, Normals):
                at_gate = 1.0 / np.radians(loss.noise)  # |n - m| at 60 degrees
                beyond = each.huber * (at_gate - 0.5 * each.huber)
                scores.append((1.0 - each.left_out) * each.mean + each.left_out * beyond)
            elif isinstance(loss, ScanSurface):
                scores.append(each.mean)
        return float(np.mean(scores)) if scores else seen.total

    def linearised(
        self, seen: Seen, moves: Floats, kept: Callable[[str, str], bool] = lambda view, what: True
    ) -> tuple[Floats, Floats, Floats]:
        """Gradient (k,), Gauss-Newton Hessian (k, k) and gradients of blocks (b, k), moves (3 n, k) of the vertices.

        kept: which pictures count, by view and by what was measured. Of a drape that friction holds the moves are those
        beside displacements of the cloth.
        """
        k = len(seen.at)
        gradient, hessian = self.precision @ (seen.at - self.mean), self.precision.copy()
        if self.held:
            placed, own = self.placed(seen, kept), moves
            moves = placed.beside(own)
            bound = own - moves
            hessian = hessian + bound.T @ (placed.precision @ bound)
        blocks = dict[tuple[str, tuple[int, ...]], Floats]()
        for (view, what), each in zip(self.pairs, seen.parts, strict=True):
            if not kept(view.name, what):
                continue
            rows = each.jacobian @ moves
            steep = each.weights * each.slopes
            gradient = gradient + rows.T @ steep
            hessian = hessian + (rows * each.curvatures[:, None]).T @ rows
            unique, number = np.unique(each.blocks, axis=0, return_inverse=True)
            sums = np.zeros((len(unique), k))
            np.add.at(sums, number.ravel(), rows * steep[:, None])
            for cell, own in zip(unique.tolist(), sums, strict=True):
                key = (view.name, tuple(cell))
                blocks[key] = blocks.get(key, 0.0) + own
        return gradient, hessian, np.array(list(blocks.values())).reshape(-1, k)

    def placed(self, seen: Seen, kept: Callable[[str, str], bool] = lambda view, what: True) -> PlacedDrape:
        """What is left of some of the pictures beside displacements."""
        parts = [each for (view, what), each in zip(self.pairs, seen.parts, strict=True) if kept(view.name, what)]
        if seen.placed is not None and len(parts) == len(seen.parts):
            return seen.placed
        return PlacedDrape.of(parts, precision_of_displacements(seen.positions, self.triangles))

    def errors(
        self, seen: Seen, moves: Floats, spread: float, kept: Callable[[str, str], bool] = lambda view, what: True
    ) -> tuple[Floats, Floats, Floats]:
        """Return the covariance of the logarithms by noise, by displacements, and the Hessian, (k, k).

        spread: of displacements, over that of their prior.
        """
        _, hessian, blocks = self.linearised(seen, moves, kept)
        placed = self.placed(seen, kept)
        inverse = np.asarray(np.linalg.inv(hessian + np.diag((UNTOLD * self.known) ** -2.0)), np.float64)
        by_place = placed.covariance(placed.beside(moves) if self.held else moves, inverse)
        return self.covariance(hessian, blocks), spread**2 * by_place, hessian

    def covariance(self, hessian: Floats, blocks: Floats) -> Floats:
        """Covariance of the logarithms (k, k) by blocks."""
        floor = np.diag((UNTOLD * self.known) ** -2.0)
        inverse = np.linalg.inv(hessian + floor)
        middle = blocks.T @ blocks * (len(blocks) / max(len(blocks) - len(hessian), 1)) + self.precision
        return np.asarray(inverse @ (middle + floor) @ inverse)

    def left(self, seen: Seen, moves: Floats) -> Floats:
        """Return the step of Gauss and Newton that is left, (k,), weakly bound to where it is."""
        gradient, hessian, _ = self.linearised(seen, moves)
        return np.asarray(-np.linalg.solve(hessian + np.diag(self.known**-2.0), gradient))


def errors_of(covariance: Floats) -> Floats:
    """Standard deviations of logarithms (k,), inf where a number is not determined."""
    errors = np.sqrt(np.diag(covariance))
    return np.where(errors > MOST_ERROR, np.inf, errors)


# The end of a search of pictures, on a cloth with four triangles for one.


def finer_fit(fit: ViewFit, at: Floats) -> tuple[ViewFit, csr_array]:
    """Return the pictures for the finer cloth, and its vertices as combinations of those of the cloth.

    InputError where the cloth cannot be meshed more finely.
    """
    _, weights, triangles = halved(fit.scene_at(at))
    views = [replace(view, losses={what: _of_fine(loss) for what, loss in view.losses.items()}) for view in fit.views]
    return replace(fit, views=tuple(views), triangles=triangles, halvings=fit.halvings + 1), weights


def finer_positions(fit: ViewFit, finer: ViewFit, positions: Floats) -> Floats:
    """Return the vertices (m, 3) of the finer cloth on the flat triangles of the cloth, at positions (n, 3) [m].

    A run begins there: the surface is the same, free of intersections where that of the cloth is, which a smooth one
    through its vertices is not where layers are near one another.
    """
    placed = np.zeros((int(finer.triangles.max()) + 1, 3))
    placed[finer.triangles] = quartered(positions[fit.triangles])
    return placed


def of_finer_cloth(weights: csr_array, moves: Floats) -> Floats:
    """Return derivatives (3 m, k) of the finer cloth's vertices from those of the cloth's, (3 n, k)."""
    return np.asarray(csr_array(kron(weights, eye_array(3))) @ moves)


def _of_fine(loss: PictureLoss) -> PictureLoss:
    """The loss of a picture for the finer cloth."""
    if not isinstance(loss, MaskBorder):
        return loss
    return replace(loss, label=(4 * np.asarray(loss.label, np.int64)[:, None] + np.arange(4)).ravel())
