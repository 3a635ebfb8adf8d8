"""Contact pairs of recorded states, for a pass over the steps of a run that searches for none."""

from dataclasses import replace

from clothsim.base.arrays import Floats, Ints
from clothsim.base.memo import Memo
from clothsim.gradients.recorded_step import RecordedStep
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.contact.candidates import Candidates
from clothsim.physics.contact.pair_list import Pairs
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.stepping import Integrator


class RememberedPairs(Candidates):
    """Candidates that know the active pairs of the last two states, the ends of a step."""

    def __init__(self, like: Candidates) -> None:
        super().__init__(like.surface, like.activation_distance, like.skin, like.offset)
        self._known = Memo[Pairs]()

    def remember(self, x: Floats, keys: Ints) -> None:
        """Take the pairs with given keys for the active set at x."""
        self._known.at(x, lambda x: self.search.of_keys(keys))

    def active(self, x: Floats) -> Pairs:
        """Active set at x, the same as that of `Candidates`."""
        self._active = self._known.at(x, super().active)
        self._active_at, self._gap = x, None
        return self._active


def with_remembered_pairs(integrator: Integrator) -> Integrator:
    """Return an integrator whose barriers can `remember` the pairs of recorded steps."""
    potential = integrator.potential
    energies = {
        name: replace(each, candidates=RememberedPairs(each.candidates)) if isinstance(each, Barrier) else each
        for name, each in potential.energies.items()
    }
    return replace(integrator, potential=Potential(energies, potential.timers))


def remember(integrator: Integrator, record: RecordedStep) -> None:
    """Tell the barriers the pairs at the solution of a step."""
    for name, each in integrator.potential.energies.items():
        if isinstance(each, Barrier) and isinstance(each.candidates, RememberedPairs) and name in record.pairs:
            each.candidates.remember(record.solution, record.pairs[name])
