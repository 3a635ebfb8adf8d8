"""Contact against ipctk, its oracle: processor time of the same work on the same places and Newton steps.

They are those about which the Newton solve of one time step asks contact, in their order: body and self contact.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import cast

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from clothsim.physics.contact import barrier_kernels as kernels
from clothsim.physics.contact.barrier import Barrier
from clothsim.run.session import Session, prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.solve.linear.sparsity import extended
from clothsim.solve.stepping.state import State, first_state
from clothsim.solve.stepping.stepping import advance
from tests.benchmarks.bench.bench_cases import Case
from tests.benchmarks.bench.leads import lead
from tests.benchmarks.bench.sides import PARTS, Ipctk, Ours, Seconds, Side, loaded

CONTACTS = ("body_contact", "self_contact")
AGREE = 1e-10
"""Relative difference of the energies above which the two have not done the same work."""

NewtonStep = tuple[Floats, Floats]
"""Positions x and Newton step dx from them, both (N, 3) [m]."""


@dataclass(frozen=True)
class Compared:
    """CPU seconds of each part per iteration, medians; vertices of the cloth, Newton steps, and the most pairs of one.

    own_pairs: the most of cloth with cloth; energy [J]: sum over all steps, for a stiffness of 1 Pa.
    """

    vertices: int
    newton_steps: int
    pairs: int
    own_pairs: int
    energy: float
    ours: Seconds
    ipctk: Seconds

    def ratio(self, part: str | None = None) -> float:
        """Ratio of ipctk's processor time to ours, for a part or in all."""
        ours, theirs = (sum(side.values()) if part is None else side[part] for side in (self.ours, self.ipctk))
        return theirs / ours if ours > 0 else np.inf


def compared(case: Case, states: Path, repeats: int, announce: Callable[[str], None]) -> Compared:
    """Both implementations on the Newton steps of a case, `repeats` times; ClothsimError for different energies.

    states: folder of the stored initial states; announce: called with a line at the start of the case.
    """
    loaded()
    announce(f"{case.name} against ipctk ...")
    assert case.scene is not None
    session = prepare(case.scene, build(case.scene))
    newton_steps = recorded(session, settled(session, case, states))
    bound = [cast("Barrier", session.built.energies[name]) for name in CONTACTS]
    barriers = [replace(barrier, stiffness=1.0) for barrier in bound]
    active = [[barrier.candidates.active(x).elements for barrier in barriers] for x, _ in newton_steps]
    n_cloth = session.built.world.n_cloth
    pattern = extended(session.integrator.system.base, [rows for _, rows in active])
    sides: dict[str, Side] = {"ours": Ours(barriers, pattern), "ipctk": Ipctk(barriers, n_cloth)}
    for side in sides.values():
        taken(side, newton_steps[:1])  # compiles
    rounds = [{name: taken(side, newton_steps) for name, side in sides.items()} for _ in range(repeats)]
    theirs = rounds[0]["ipctk"][0]
    ours = sum(energy_of_all_pairs(barrier, x) for x, _ in newton_steps for barrier in barriers)
    if abs(ours - theirs) > AGREE * abs(theirs):
        raise ClothsimError(f"{case.name}: contact finds {ours:.12g} J, and ipctk {theirs:.12g} J.")
    each = {
        name: {part: median(turn[name][1][part] for turn in rounds) / len(newton_steps) for part in PARTS}
        for name in sides
    }
    pairs, own_pairs = max(sum(map(len, found)) for found in active), max(len(found[-1]) for found in active)
    return Compared(n_cloth, len(newton_steps), pairs, own_pairs, ours, each["ours"], each["ipctk"])


def energy_of_all_pairs(barrier: Barrier, x: Floats) -> float:
    """Energy [J] for a stiffness of 1, each active pair counted, as ipctk does here (see `distinct_features`)."""
    pairs = barrier.candidates.active(x)
    records = np.empty((len(pairs), kernels.RECORD_SIZE))
    arguments = pairs.elements, pairs.weights, pairs.thresholds, pairs.n_points, barrier.offset, barrier.d_hat
    return float(kernels.evaluate(records, x, *arguments))


def taken(side: Side, newton_steps: Sequence[NewtonStep]) -> tuple[float, Seconds]:
    """Energy of all steps [J], and the seconds of each part."""
    seconds = dict.fromkeys(PARTS, 0.0)
    side.begin(newton_steps[0][0])
    return sum(side.take(x, dx, seconds) for x, dx in newton_steps), seconds


def settled(session: Session, case: Case, states: Path) -> State:
    """Initial state of the case: the stored one advanced by `settle` steps."""
    integrator = session.integrator
    state = first_state(session.built.world, integrator.dt)
    file = lead(case, states)
    if file is not None:
        stored = np.load(file)
        state = replace(
            state, positions=stored["positions"], velocities=stored["velocities"], time=float(stored["time"])
        )
    for _ in range(case.settle):
        state = advance(integrator, state, state.time + integrator.dt).state
    return state


def recorded(session: Session, state: State) -> list[NewtonStep]:
    """Positions and steps at which Newton evaluates body contact in the time step from `state`, each position once.

    A line search that tries longer steps evaluates the same position again, where only the step is new: to repeat the
    energy and its derivatives there would measure caches.
    """
    newton_steps: list[NewtonStep] = []
    candidates = cast("Barrier", session.built.energies[CONTACTS[0]]).candidates
    limit = candidates.step_limit

    def recorded_limit(x: Floats, dx: Floats, most: float = 1.0) -> float:
        if not newton_steps or not np.array_equal(x, newton_steps[-1][0]):
            newton_steps.append((x.copy(), dx.copy()))
        return limit(x, dx, most)

    candidates.step_limit = recorded_limit  # type: ignore[method-assign]
    try:
        advance(session.integrator, state, state.time + session.integrator.dt)
    finally:
        del candidates.step_limit
    return newton_steps
