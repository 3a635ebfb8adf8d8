"""Forces of a step: of contact and friction on each body, and of each group of pins on the cloth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.run.fields import CONTACTS, FRICTION, acting_forces

if TYPE_CHECKING:
    from clothsim.scene.assembly.scene_world import Built
    from clothsim.solve.stepping.stepping import StepReport


@dataclass(frozen=True)
class Forces:
    """Forces at the ends of the steps of a run.

    Attributes
    ----------
    times : (k,) ndarray
        [s].
    bodies : mapping of str to (k, 3) ndarray
        Force of contact and friction on each body [N].
    pins : mapping of str to (k, 3) ndarray
        Force of each group of pins ("pins", "pins.group[1]") on the cloth [N]: what holds it there.
    """

    times: Floats
    bodies: Mapping[str, Floats]
    pins: Mapping[str, Floats]


def step_forces(built: "Built", report: "StepReport") -> dict[str, dict[str, list[float]]]:
    """Sums of the forces at the end of a step [N], by the name of the body and of the group of pins.

    The reaction of a pin is the gradient of the incremental potential there: a free vertex has none, as forces balance.
    Ghost vertices of a clamp belong to its group.
    """
    world, x, energies = built.world, report.state.positions, report.potential.energies
    contact = acting_forces(energies, (*CONTACTS, FRICTION), x)
    bodies = {
        body.name: contact[rows].sum(axis=0).tolist()
        for body, rows in zip(world.bodies, world.body_slices, strict=True)
    }
    if not built.constraints:
        return {"bodies": bodies, "pins": {}}
    gradient, pins = report.potential.gradient(x), dict[str, Floats]()
    for constraint in built.constraints.values():
        for row in constraint.at(report.state.time).vertices.tolist():
            name = constraint.holder(row)
            pins[name] = pins.get(name, np.zeros(3)) + gradient[row]
    return {"bodies": bodies, "pins": {name: force.tolist() for name, force in pins.items()}}


def forces_of(record: Sequence[Mapping[str, Any]], where: str) -> Forces:
    """The forces in the record of a run. InputError where it holds none."""
    entries = [entry for entry in record if "forces" in entry]
    if not entries:
        raise InputError(f"{where} has no forces.", "Ask for them before the run: [run] forces = true.")
    times = np.array([entry["time"] for entry in entries])

    def columns(kind: str) -> dict[str, Floats]:
        names = entries[0]["forces"][kind]
        return {name: np.array([entry["forces"][kind][name] for entry in entries]) for name in names}

    return Forces(times, columns("bodies"), columns("pins"))
