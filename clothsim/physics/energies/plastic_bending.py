"""Plastic bending with kinematic hardening: the effect `plastic_bending`.

The strains of bending e = B (theta - theta0) have plastic parts p (`hinge_moments`): in the hinge model the angle of
each hinge, in the mid-edge model the three components of the curvature at each point of a triangle, scaled such that
their squares sum to (1 - nu) |S|^2 + nu tr(S)^2: their norm is the curvature of a cylindrical bend in any direction.
With the yield y and linear kinematic hardening H (Prager 1956; return mapping: Simo and Hughes 1998, "Computational
inelasticity", box 1.4), p flows along q = e - (1 + H) p where |q| > y, independent of the rate:

    p += q/|q| (|q| - y) / (1 + H),

the associated flow of the elastic energy w |e - p|^2/2, so that it only dissipates. A fold held at theta_m retains
(theta_m - y) / (1 + H) when it is released, and y/H at most: beyond, its hardening makes it yield backwards.

The flow of a step is solved with it (Ortiz & Stainier 1999, "The variational formulation of viscoplastic constitutive
updates"): with p_n at its start the least over p of elastic energy, hardening and dissipation, a convex function of e,

    w min_p [|e - p|^2/2 + H |p|^2/2 + y |p - p_n|] = w [|e - p_n|^2/2 + H |p_n|^2/2 - (|q| - y)+^2/(2 (1 + H))],

q = e - (1 + H) p_n. The first two terms are the moments of `hinge_moments`, the last one lowers the tangent beyond the
yield to w H/(1 + H); bending's own projected Hessian bounds the sum. The next step begins with the return mapping at
the positions where this one was accepted. A fold at the start of a run flows at once.

y is given as a curvature kappa, a property of the fabric and not of the mesh, or as the angle of a hinge. Hinges of
edge length |e| between areas A1 and A2 take y = kappa (A1 + A2)/|e|, triangles of the mid-edge model the angle over
the mean (A1 + A2)/|e| of the hinges in their curvature.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from scipy import sparse

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.linalg import dot
from clothsim.base.memo import Memo
from clothsim.keys.typed_effects import PlasticBending
from clothsim.mesh.world import World
from clothsim.physics.energies import hinge_kernels
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.hessians import ElementHessian, ImplicitHessian, LanesHessian, SumHessian
from clothsim.physics.energies.hinge_bending import HingeBending
from clothsim.physics.energies.hinge_moments import BendingModel, HingeMoments, ShiftedAngles, hinges_of_bending
from clothsim.physics.energies.midedge_bending import MidedgeBending
from clothsim.physics.energies.protocols import HistorySensitivity, StartDerivatives

NAME = "plastic_bending"


def plastic_bending(world: World, keys: PlasticBending, *, built: Mapping[str, Energy] | None = None) -> Energy | Off:
    """Permanent folds beyond a yield angle or curvature; off without yield or bending.

    built: the energies built so far, with the bending whose angles are shifted.

    Raises
    ------
    InputError
        For both kinds of yield, or a bending model without rest angles.
    """
    degrees, curvature = keys.yield_angle_degrees, keys.yield_curvature
    if degrees and curvature:
        sentence = "effects.plastic_bending has both yield_angle_degrees and yield_curvature."
        raise InputError(sentence, "Give one of them.")
    if not degrees and not curvature:
        return Off("no yield is given")
    bending = (built or {}).get("bending")
    if bending is None:
        return Off("the scene has no bending")
    hinges = hinges_of_bending(NAME, bending)
    if isinstance(hinges, MidedgeBending):
        hinges = hinges.by_point()
    strains, weights = hinges.strains_of_angles()
    stiff = world.hinges.stiffness > 0
    widths = world.hinges.areas[stiff] / world.hinges.edge_lengths[stiff]
    if isinstance(hinges, HingeBending):
        yields = curvature * widths if curvature else np.full(len(widths), np.radians(degrees))
    else:
        yields = np.full(len(weights), curvature) if curvature else np.radians(degrees) / hinges.widths(widths)
    rest, none = hinges.rest_angles, np.zeros(len(widths))
    flow = hinges, strains, weights, yields, keys.hardening, np.zeros((len(weights), strains.shape[0] // len(weights)))
    return PlasticBendingEnergy(hinges.vertices, rest, none, 0.0, rest, *flow)


EXAMPLE = Example(
    keys={"yield_angle_degrees": 1.0, "hardening": 0.3},
    in_scene={"yield_angle_degrees": 1.0},
    zero={"hardening": 0.5},
    idle=Idle(always={"yield_angle_degrees": 179.0}, sometimes={"yield_angle_degrees": 0.02}, searches=True),
)


@dataclass(frozen=True)
class PlasticBendingEnergy(HingeMoments, HistorySensitivity):
    """Plastic strains of bending.

    Parameters
    ----------
    rest_angles : (h,) array
        Rest angles without creases [rad].
    model : HingeBending or MidedgeBending
        The bending whose strains have plastic parts.
    strains : (g r, h) sparse array
        B: r strains of each of g elements, hinges or points of triangles [1 or 1/m].
    weights : (g,) array
        w of each element [N m or J m2].
    yields : (g,) array
        y [rad or 1/m].
    hardening : float
        H, relative to the stiffness of bending.
    plastic : (g, r) array
        p_n, of this step.
    """

    rest_angles: Floats
    model: BendingModel
    strains: sparse.csr_array
    weights: Floats
    yields: Floats
    hardening: float
    plastic: Floats

    _turned: Memo[Floats] = field(default_factory=Memo, init=False, repr=False, compare=False)

    depends_on_other_energies = True

    @property
    def carry_over(self) -> Floats:
        """p_n, (g r,): of each hinge [rad], or of each point of a triangle [1/m]."""
        return self.plastic.ravel()

    def begin(self, step: Step) -> Self:
        """A copy with p after the return mapping at the start of the step, relative to rest angles with creases."""
        references = self.rest_angles.copy()
        for other in step.bound.values():
            if isinstance(other, ShiftedAngles):
                references[other.numbers] += other.shifts
        memory = step.memory.get(NAME, np.zeros(self.plastic.size))
        before = np.asarray(memory, np.float64).reshape(self.plastic.shape)
        turned = hinge_kernels.angles(self.vertices, step.positions) - references
        plastic = flowed(self._strain(turned), before, self.yields, self.hardening)
        stresses = self.weights[:, None] * plastic
        offset = 0.5 * (1 + self.hardening) * float(np.sum(stresses * plastic))
        moments = self.strains.T @ stresses.ravel()
        return replace(self, references=references, plastic=plastic, moments=moments, offset=offset)

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        turned = self._turns(x)
        if not np.isfinite(turned).all():
            return np.inf
        beyond = self._beyond(x)[1]
        flow = dot(self.weights, beyond**2) / (2 * (1 + self.hardening))
        return self.offset - dot(self.moments, turned) - flow

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return hinge_kernels.gradient(self.vertices, -self._all_moments(x), x)

    def hessian(self, x: Floats, project: bool = True) -> LanesHessian | SumHessian:
        """Exact: d2theta/dx2 of the moments, and the stiffness that is lost beyond the yield; projected: none."""
        moments = np.zeros(len(self.vertices)) if project else -self._all_moments(x)
        driving, beyond = self._beyond(x)
        lost = np.zeros(len(self.vertices))
        if not isinstance(self.model, MidedgeBending):
            lost = -np.where(beyond > 0, self.weights, 0.0) / (1 + self.hardening)
        acting = np.zeros(0, np.int64) if project else np.flatnonzero((moments != 0) | (lost != 0))
        by_hinge = hinge_kernels.hinge_hessian(self.vertices[acting], moments[acting], lost[acting], x)
        if project or not isinstance(self.model, MidedgeBending) or not beyond.any():
            return by_hinge
        return SumHessian((by_hinge, self._lost(self.model, x, driving, beyond)))

    def history_sensitivity(self, step: Step, x: Floats, adjoint: Floats, memory_adjoint: Floats) -> StartDerivatives:
        """By the angles at the start and by the flow before, which give p by the return mapping.

        With e' = B dtheta/dx . a the power of the force is -w [p . e' + T(q) . e'/(1 + H)], T(q) = (1 - y/|q|)+ q.
        """
        slopes = hinge_kernels.angle_gradients(self.vertices, x)
        turns = np.where(
            np.isfinite(self._turns(x)), (slopes * adjoint[self.vertices].reshape(-1, 12)).sum(axis=1), 0.0
        )
        rates = (self.strains @ turns).reshape(self.plastic.shape)
        driving, _ = self._beyond(x)
        by_plastic = -self.weights[:, None] * (rates - _flow_slope(driving, self.yields, rates))
        by_plastic -= memory_adjoint.reshape(self.plastic.shape)
        before = np.asarray(step.memory.get(NAME, np.zeros(self.plastic.size)), np.float64).reshape(self.plastic.shape)
        turned = hinge_kernels.angles(self.vertices, step.positions) - self.references
        driving, _ = _driving(self._strain(turned), before, self.yields, self.hardening)
        flow = _flow_slope(driving, self.yields, by_plastic)
        by_angles = self.strains.T @ flow.ravel() / (1 + self.hardening)
        by_start = hinge_kernels.gradient(self.vertices, np.where(np.isfinite(turned), by_angles, 0.0), step.positions)
        return StartDerivatives(positions=by_start, memory=(by_plastic - flow).ravel())

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """The energy itself: its elements have hinges in common."""
        return self

    def _lost(self, model: MidedgeBending, x: Floats, driving: Floats, beyond: Floats) -> ImplicitHessian:
        """-J'B' T B J of the triangles that flow, T = w d2/dq2 (|q| - y)^2/(2 (1 + H))."""
        flowing = np.flatnonzero(beyond)
        ratio = np.sqrt(beyond[flowing] / (beyond + self.yields)[flowing])[:, None, None]
        unit = driving[flowing] / np.linalg.norm(driving[flowing], axis=1, keepdims=True)
        root = ratio * np.eye(3) + (1 - ratio) * unit[:, :, None] * unit[:, None, :]
        entries = root @ model.weights[flowing] / np.sqrt(1 + self.hardening)
        slopes, stencils = hinge_kernels.angle_gradients(model.vertices, x), model.stencils[flowing]
        elements, slots = model.elements[flowing], model.slots[flowing]
        elementwise = model.vertices, stencils, entries

        def by_element() -> ElementHessian:
            factors = hinge_kernels.factors(*elementwise, slots, elements.shape[1], slopes)
            threes = factors.reshape(len(elements), 3, -1)
            return ElementHessian(elements, -np.einsum("mqi,mqj->mij", threes, threes))

        return ImplicitHessian(elements, lambda v: -hinge_kernels.product(*elementwise, slopes, v), by_element)

    def _turns(self, x: Floats) -> Floats:
        """theta - theta0, (h,) [rad]; +inf where a triangle has no area."""
        angles: Callable[[Floats], Floats] = lambda x: hinge_kernels.angles(self.vertices, x)  # noqa: E731
        return self._turned.at(x, angles) - self.references

    def _beyond(self, x: Floats) -> tuple[Floats, Floats]:
        """q (g, r) and (|q| - y)+ (g,); 0 in an element at a hinge without an angle."""
        strain = self._strain(self._turns(x))
        return _driving(strain, self.plastic, self.yields, self.hardening)

    def _all_moments(self, x: Floats) -> Floats:
        """The moments of p_n and those that the flow of the step adds, (h,) [N m]; 0 at a hinge without an angle."""
        driving, beyond = self._beyond(x)
        sizes = np.where(beyond > 0, beyond + self.yields, 1.0)
        stresses = (self.weights * beyond / (sizes * (1 + self.hardening)))[:, None] * driving
        moments = self.moments + self.strains.T @ stresses.ravel() if beyond.any() else self.moments
        return np.where(np.isfinite(self._turns(x)), moments, 0.0)

    def _strain(self, turned: Floats) -> Floats:
        """e (g, r) of changes of angle (h,); +inf in an element at a hinge without an angle."""
        defined = np.isfinite(turned)
        strain = (self.strains @ np.where(defined, turned, 0.0)).reshape(self.plastic.shape)
        if not defined.all():
            strain[(abs(self.strains) @ (~defined).astype(np.float64)).reshape(strain.shape).any(axis=1)] = np.inf
        return strain


def flowed(strain: Floats, plastic: Floats, yields: Floats, hardening: float) -> Floats:
    """Return mapping: plastic strains (g, r) from the previous ones, e (g, r) and the yields (g,)."""
    driving, beyond = _driving(strain, plastic, yields, hardening)
    sizes = np.linalg.norm(driving, axis=1)[:, None]
    directions = np.divide(driving, sizes, out=np.zeros_like(driving), where=sizes > 0)
    return np.asarray(plastic + directions * (beyond / (1 + hardening))[:, None], np.float64)


def _flow_slope(driving: Floats, yields: Floats, vectors: Floats) -> Floats:
    """d((1 - y/|q|)+ q)/dq times vectors (g, r)."""
    sizes = np.maximum(np.maximum(np.linalg.norm(driving, axis=1), yields), np.finfo(float).tiny)
    ratios = (yields / sizes)[:, None]
    unit = driving / sizes[:, None]
    along = (unit * vectors).sum(axis=1, keepdims=True) * unit
    return np.asarray(np.where(ratios < 1.0, (1.0 - ratios) * vectors + ratios * along, 0.0), np.float64)


def _driving(strain: Floats, plastic: Floats, yields: Floats, hardening: float) -> tuple[Floats, Floats]:
    """q = e - (1 + H) p (g, r) and (|q| - y)+ (g,), 0 where e is not finite."""
    defined = np.asarray(np.isfinite(strain).all(axis=1))
    driving = np.where(defined[:, None], strain, 0.0) - (1 + hardening) * plastic
    sizes = np.asarray(np.linalg.norm(driving, axis=1), np.float64)
    return driving, np.where(defined, np.maximum(sizes - yields, 0.0), 0.0)
