"""Certificate of a run, accumulated step by step: intersections, gap, stretches, residual, energy, estimated error."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.intersection.proved_separations import Effort
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.protocols import AdaptiveStiffness, ChangingMaterial, ContactGap
from clothsim.run.fields import world_stretches
from clothsim.run.intersections import IntersectionHistory, history_from
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.failure import HasContactPairs
from clothsim.solve.stepping.local_error import LEAST_FRACTION
from clothsim.solve.stepping.mechanical_energy import mechanical_energy
from clothsim.solve.stepping.state import State
from clothsim.solve.stepping.stepping import StepReport

if TYPE_CHECKING:
    from clothsim.solve.pinch.flypaper import PinchRecord


@dataclass(frozen=True)
class ErrorEstimate:
    """Sums over all steps so far [m]; estimates of size, not bounds.

    Parameters
    ----------
    temporal : float
        Sum of the local errors of the difference formula (`step_error`), RMS over the vertices: the error at the end
        where perturbations neither grow nor decay, more than it where errors oscillate or are damped, less where a
        motion is unstable; nan without inertia.
    temporal_largest : float
        The same with the largest local error of a vertex in each step.
    newton : float
        Sum of `NewtonResult.remaining`; of the last solve alone without inertia.
    contact_gap : float
        Smallest gap at the last step as a fraction of d_hat: how far contact stands off; inf without contact.
    at_floor : int
        Steps of the shortest length whose local error was still too large.
    steps : int
        Number of steps; without any nothing is estimated.
    """

    temporal: float = 0.0
    temporal_largest: float = 0.0
    newton: float = 0.0
    contact_gap: float = np.inf
    at_floor: int = 0
    steps: int = 0

    def after(self, report: StepReport) -> Self:
        """Return the estimate after one more step."""
        energies = report.potential.energies.values()
        x, error = report.state.positions, report.error
        fractions = [np.inf]
        if report.minimum_gap < np.inf:
            fractions += [energy.minimum_gap(x) / energy.d_hat for energy in energies if isinstance(energy, ContactGap)]
        return replace(
            self,
            temporal=np.nan if error is None else report.state.temporal_error,
            temporal_largest=np.nan if error is None else self.temporal_largest + error.largest,
            newton=report.result.remaining + (0.0 if error is None else self.newton),
            contact_gap=float(min(fractions)),
            at_floor=self.at_floor + report.at_floor,
            steps=self.steps + 1,
        )

    def as_dict(self, asked: float = 0.0, completed: bool = True) -> dict[str, Any]:
        """Return the entry of the certificate; asked: the requested error [m], 0 where none was.

        A run that was not completed does not meet its request, whatever the error of its steps.
        """
        if not self.steps:
            parts = dict.fromkeys(("temporal", "temporal_largest", "newton", "contact_gap"), "not estimated (no step)")
            return {**parts, **({"asked": asked, "met": False} if asked else {})}
        static = bool(np.isnan(self.temporal))
        return {
            "temporal": "not estimated (quasi-static)" if static else self.temporal,
            "temporal_largest": "not estimated (quasi-static)" if static else self.temporal_largest,
            "newton": self.newton,
            "contact_gap": self.contact_gap if self.contact_gap < np.inf else "not estimated (no contact)",
            **({"asked": asked, "met": completed and not self.unmet(asked)} if asked else {}),
        }

    def unmet(self, error: float) -> str:
        """Return a message where the requested `error` [m] is exceeded, else an empty string; 0: none was requested."""
        if not error or not self.temporal > (1 + LEAST_FRACTION) * error:
            return ""
        why = f": {self.at_floor} steps had the shortest length allowed" if self.at_floor else ""
        return (
            f"The requested error of {error:g} m is exceeded{why}. "
            f'The estimate is {self.temporal:.2g} m. Set a larger solver.error, or integrator = "bdf2".'
        )


@dataclass(frozen=True)
class EnergyChanges:
    """Energy that changes between steps, of the contact stiffness or of the material, added and removed so far.

    Parameters
    ----------
    added, removed : float
        Sum of the changes that added energy, and of those that removed some [J], both 0 or more.
    last : float
        Energy that the last change added [J]; below 0 where it removed some.
    """

    added: float = 0.0
    removed: float = 0.0
    last: float = 0.0

    def after(self, change: float) -> Self:
        """Return the record after one more `change` [J]."""
        return replace(self, added=self.added + max(change, 0.0), removed=self.removed + max(-change, 0.0), last=change)

    def as_dict(self) -> dict[str, float]:
        """Return the entry of the certificate."""
        return {"added": self.added, "removed": self.removed}


def stiffness_energy(potential: Potential, before: State) -> float:
    """Return the energy at the start of a step with the stiffness of the step less that with the one before [J]."""
    return sum(
        energy.stiffness_energy(before.positions, float(before.memory[name]))
        for name, energy in potential.acting.items()
        if isinstance(energy, AdaptiveStiffness) and name in before.memory
    )


# Cloth that bodies press from opposite sides.

OPPOSED = 0.5
"""Net force over the sum of the magnitudes below which the contact forces of a vertex oppose each other.

On a plane it is 1, in a rectangular groove or over a rectangular edge .71, between two planes 0.
"""


@dataclass(frozen=True)
class Pinches:
    """Pinched vertices in the frames so far.

    Parameters
    ----------
    frames : int
        Number of frames with some.
    most_vertices : int
        Most in a frame.
    first_time : float or None
        Time of the first such frame [s].
    first_vertex : str
        One of its vertices, by name.
    """

    frames: int = 0
    most_vertices: int = 0
    first_time: float | None = None
    first_vertex: str = ""

    def after(self, world: World, energies: Iterable[Energy], x: Floats, time: float) -> Self:
        """Return the record after one more frame at x (N, 3) [m]."""
        rows = pinched_vertices(world, energies, x)
        if not len(rows):
            return self
        record = replace(self, frames=self.frames + 1, most_vertices=max(self.most_vertices, len(rows)))
        if self.first_time is not None:
            return record
        label = int(world.labels[rows[0]])
        name = f"vertex {int(rows[0]) - world.cloth_slices[label].start} of {world.names[label]}"
        return replace(record, first_time=time, first_vertex=name)


def pinched_vertices(world: World, energies: Iterable[Energy], x: Floats) -> Ints:
    """Rows of the cloth vertices whose contact forces from bodies oppose each other at x (N, 3) [m]."""
    net, total = np.zeros((world.n_cloth, 3)), np.zeros(world.n_cloth)
    for energy in energies:
        if not isinstance(energy, HasContactPairs) or not world.bodies:
            continue
        rows, weights, lines, forces = energy.normal_forces(x, energy.stiffness)
        with_body = (rows[:, [0, 3]] >= world.n_cloth).any(axis=1)
        acting = with_body & (forces > 0)
        rows, weights, lines, forces = rows[acting], weights[acting], lines[acting], forces[acting]
        directions = forces[:, None] * lines / np.linalg.norm(lines, axis=1)[:, None]
        of_cloth = rows < world.n_cloth
        np.add.at(net, rows[of_cloth], (weights[:, :, None] * directions[:, None])[of_cloth])
        np.add.at(total, rows[of_cloth], (np.abs(weights) * forces[:, None])[of_cloth])
    pressed = total > 0
    opposed = np.linalg.norm(net, axis=1) < OPPOSED * total
    return np.flatnonzero(pressed & opposed)


@dataclass(frozen=True)
class UnstableEquilibria:
    """Unstable equilibria so far.

    Parameters
    ----------
    left, kept : int
        Number of those that were left, and of steps that ended in one that was kept.
    first_at : float or None
        Time of the first [s].
    growth_rate : float
        Largest growth rate of a lowest mode [1/s].
    """

    left: int = 0
    kept: int = 0
    first_at: float | None = None
    growth_rate: float = 0.0

    def after(self, report: StepReport) -> Self:
        """Return the record after one more step."""
        if not report.switches:
            return self
        left = sum(switch.left for switch in report.switches)
        return replace(
            self,
            left=self.left + left,
            kept=self.kept + (not report.switches[-1].left),
            first_at=report.state.time if self.first_at is None else self.first_at,
            growth_rate=max(self.growth_rate, *(switch.growth_rate for switch in report.switches)),
        )


@dataclass(frozen=True)
class Certificate:
    """Extremes over all steps so far.

    E(x) falls in every step. In backward Euler that is |v(n+1) - v(n)|^2_M/2 + Psi(n+1) <= |v(n)|^2_M/2 + Psi(n), and
    the energy itself falls where Psi is convex: a sheet that buckles within a large step may gain some. BDF2 has no
    such law: its energy may rise within its order, by a hundredth of the kinetic energy (`stepping.mechanical_energy`).

    Parameters
    ----------
    intersections : IntersectionHistory
        Intersections by the exact check.
    gap : float
        Smallest distance of cloth and body below d_hat [m], else inf.
    stretch_min, stretch_max : float
        Extremes of the principal stretches.
    residual : float
        Largest force that the last step left on a free vertex [N].
    relative_residual : float
        Largest residual of a step over its force scale (`ForceBalance`).
    energy : float
        Kinetic and potential energy now [J].
    energy_rise, step_rise : float
        Largest rise in one step of the energy and of the incremental potential E(x) [J].
    energy_scale : float
        Largest part of the energy so far [J].
    moved_by_script : bool
        True where bodies, pins or wind do work on the cloth, so that a rise is not an error.
    estimate : ErrorEstimate
        Estimated error of the result.
    asked : float
        Error requested by the user [m]; 0 where a dt was given.
    fastest_speed : float
        Largest speed of a cloth vertex in the last step [m/s]; nan without inertia.
    at_rest : bool
        True where the cloth was at rest at the last frame (see `stepping.time_loop`), and slow since then.
    unstable : UnstableEquilibria
        Those that were found (see `stepping.time_loop`).
    flypapered : PinchRecord or None
        Vertices that were flypapered through a pinch; None without that policy.
    pinched : Pinches
        Vertices that bodies pressed from opposite sides, in the frames so far.
    stiffness : EnergyChanges
        Energy of the changes of the contact stiffness.
    material : EnergyChanges or None
        Work done by the change of a material over time; None where no material changes.
    checks : Effort
        Tests of the exact check; no fact of the run, as a resumed one tests all pairs once more.
    """

    intersections: IntersectionHistory = field(default_factory=IntersectionHistory)
    gap: float = np.inf
    stretch_min: float = np.inf
    stretch_max: float = 0.0
    residual: float = 0.0
    relative_residual: float = 0.0
    energy: float = np.nan
    energy_rise: float = 0.0
    step_rise: float = 0.0
    energy_scale: float = 0.0
    moved_by_script: bool = False
    estimate: ErrorEstimate = field(default_factory=ErrorEstimate)
    asked: float = 0.0
    fastest_speed: float = np.nan
    at_rest: bool = False
    unstable: UnstableEquilibria = field(default_factory=UnstableEquilibria)
    flypapered: "PinchRecord | None" = None
    pinched: Pinches = field(default_factory=Pinches)
    stiffness: EnergyChanges = field(default_factory=EnergyChanges)
    material: EnergyChanges | None = None
    checks: Effort = field(default_factory=Effort)

    def after(
        self, world: World, report: StepReport, before: State, energies: Mapping[str, Energy] | None = None
    ) -> Self:
        """Return the certificate after one more step, which started at `before`; energies: of the scene, not bound.

        Both energies are of the potential of this step: what a barrier made stiffer between two steps adds is not a
        rise, but stands in `stiffness`, and what another material adds in `material`.
        """
        changing = {name: each for name, each in (energies or {}).items() if isinstance(each, ChangingMaterial)}
        material = self.material
        if changing:
            times, bound = (before.time, report.state.time), report.potential.energies
            work = sum(each.work_of_change(before.positions, *times, bound[name]) for name, each in changing.items())
            material = (material or EnergyChanges()).after(work)
        x = report.state.positions
        stretches = world_stretches(world, x)
        end = mechanical_energy(world, report.potential, report.state)
        incremental = end.incremental
        if report.switches:  # of the solve; the displacement after it is none of its steps
            solved = replace(report.state, positions=report.result.x)
            incremental = mechanical_energy(world, report.potential, solved).incremental
        start = mechanical_energy(world, report.potential, before)
        return replace(
            self,
            gap=min(self.gap, report.minimum_gap),
            stretch_min=float(stretches[:, 1].min(initial=self.stretch_min)),
            stretch_max=float(stretches[:, 0].max(initial=self.stretch_max)),
            residual=report.result.residual,
            relative_residual=max(self.relative_residual, report.result.relative_residual),
            energy=end.total,
            energy_rise=max(self.energy_rise, end.total - start.total),
            step_rise=max(self.step_rise, incremental - start.incremental),
            energy_scale=max(self.energy_scale, end.scale),
            estimate=self.estimate.after(report),
            fastest_speed=np.nan if report.error is None else report.fastest,
            at_rest=report.state.at_rest,
            unstable=self.unstable.after(report),
            stiffness=self.stiffness.after(stiffness_energy(report.potential, before)),
            material=material,
        )

    def as_dict(self, coverage: Mapping[str, str], completed: bool = True) -> dict[str, Any]:
        """Return the entry of the summary. coverage: see `IntersectionCheck.coverage`; completed: the whole run."""
        scale, scripted = self.energy_scale or 1.0, "bodies, pins or wind do work"
        return {
            "intersection_free": self.intersections.intersection_free,
            **coverage,
            **({} if self.flypapered is None else {"carried": self.flypapered.as_dict()}),
            "intersections": self.intersections.as_dict(),
            "intersecting_frames": list(self.intersections.frames),
            "minimum_gap": self.gap,
            "stretch_min": self.stretch_min,
            "stretch_max": self.stretch_max,
            "residual": self.residual,
            "relative_residual": self.relative_residual,
            "at_rest": self.at_rest,
            "fastest_speed": self.fastest_speed,
            "unstable_equilibria": asdict(self.unstable),
            "pinched": asdict(self.pinched),
            "energy_drift": scripted if self.moved_by_script else self.energy_rise / scale,
            "step_energy_rise": scripted if self.moved_by_script else self.step_rise / scale,
            "stiffness_changes": self.stiffness.as_dict(),
            **({} if self.material is None else {"material_changes": self.material.as_dict()}),
            "error_estimate": self.estimate.as_dict(self.asked, completed),
        }

    def as_json(self) -> dict[str, Any]:
        """Return every field, for the checkpoint."""
        parts = {
            "estimate": asdict(self.estimate),
            "intersections": self.intersections.as_json(),
            "unstable": asdict(self.unstable),
            **({} if self.flypapered is None else {"flypapered": asdict(self.flypapered)}),
            "pinched": asdict(self.pinched),
            "stiffness": asdict(self.stiffness),
            "material": None if self.material is None else asdict(self.material),
            "checks": asdict(self.checks),
        }
        return {**{name: getattr(self, name) for name in self.__dataclass_fields__}, **parts}


def certificate_from(fields: dict[str, Any]) -> Certificate:
    """Return the certificate that `as_json` wrote; older ones did not check all pairs."""
    older = {**asdict(IntersectionHistory(complete=False)), "frames": fields.get("intersecting_frames", ())}
    parts = {
        "estimate": ErrorEstimate(**fields.get("estimate", {})),
        "intersections": history_from(fields.get("intersections", older)),
        "unstable": UnstableEquilibria(**fields.get("unstable", {})),
        "flypapered": _pinch_record(fields.get("flypapered", fields.get("carried"))),
        "pinched": Pinches(**fields.get("pinched", {})),
        "stiffness": EnergyChanges(**fields.get("stiffness", {})),
        "material": EnergyChanges(**fields["material"]) if fields.get("material") else None,
        "checks": Effort(**fields.get("checks", {})),
    }
    return Certificate(
        **{**{name: fields[name] for name in fields if name in Certificate.__dataclass_fields__}, **parts}
    )


def _pinch_record(fields: Mapping[str, Any] | None) -> "PinchRecord | None":
    if fields is None:
        return None
    from clothsim.solve.pinch.flypaper import record_from  # runs without the policy do not import it

    return record_from(fields)
