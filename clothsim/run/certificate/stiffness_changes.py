"""Energy that changes of the contact stiffness between steps add to the cloth, and take from it.

A step is balanced with its own stiffness. The energy stored in contact at its start is then another one than at the end
of the step before: E(n+1) - E(n) is the change in the step and this difference.
"""

from dataclasses import dataclass, replace
from typing import Self

from clothsim.physics.energies.protocols import AdaptiveStiffness
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.state import State


@dataclass(frozen=True)
class StiffnessChanges:
    """Energy of the changes so far.

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

    def after(self, potential: Potential, before: State) -> Self:
        """Return the record after a step from `before` to which `potential` is bound."""
        change = stiffness_energy(potential, before)
        return replace(self, added=self.added + max(change, 0.0), removed=self.removed + max(-change, 0.0), last=change)


def stiffness_energy(potential: Potential, before: State) -> float:
    """Return the energy at the start of a step with the stiffness of the step less that with the one before [J]."""
    return sum(
        energy.stiffness_energy(before.positions, float(before.memory[name]))
        for name, energy in potential.acting.items()
        if isinstance(energy, AdaptiveStiffness) and name in before.memory
    )
