"""Cost of adding each effect that a scene does not name, measured on the first steps of the scene."""

import inspect
from dataclasses import dataclass, replace
from statistics import median
from time import perf_counter

from clothsim.base.errors import ClothsimError
from clothsim.run.session import Session, prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.effects import EFFECTS
from clothsim.scene.scene import Scene
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.time_loop import steps as run_steps

ROUNDS = 3
LATE = "not measured: the time was spent"


@dataclass(frozen=True)
class Added:
    """Median seconds of a step with the effect, and their ratio to a step without; nan where `why` has the reason."""

    seconds: float = float("nan")
    ratio: float = float("nan")
    why: str = ""


@dataclass(frozen=True)
class Absent:
    """Cost of the absent effects.

    effects: by name; seconds: of a step of the scene as it is; steps: number of steps of a round; rounds: their number.
    """

    effects: dict[str, Added]
    seconds: float
    steps: int
    rounds: int


def absent_effects(scene: Scene, steps: int = 5, budget: float = 60.0) -> Absent:
    """Measure the first `steps` of a scene as it is and with each absent effect, its keys at their defaults.

    All take turns in at most ROUNDS rounds, until `budget` [s] is spent; a measurement that has begun is completed.
    """
    ends = perf_counter() + budget
    base = prepare(scene, build(scene))
    _seconds(base, 1)  # loads and compiles
    added: dict[str, Added] = {}
    sessions: dict[str, Session] = {}
    for name in (name for name in EFFECTS if name not in scene.effects):
        made = _with(scene, name) if perf_counter() < ends else LATE
        if isinstance(made, str):
            added[name] = Added(why=made)
        else:
            sessions[name] = made
    times: dict[str, list[float]] = {name: [] for name in sessions}
    without: list[float] = []
    while len(without) < ROUNDS and (not without or perf_counter() < ends):
        without.append(_seconds(base, steps))
        for name, session in sessions.items():
            if perf_counter() < ends and name not in added:
                try:
                    times[name].append(_seconds(session, steps))
                except ClothsimError as error:
                    added[name] = Added(why=f"a step fails with it: {error}")
    reference = median(without)
    for name, seen in times.items():
        measured = Added(median(seen), median(seen) / reference) if seen else Added(why=LATE)
        added.setdefault(name, measured)
    return Absent({name: added[name] for name in EFFECTS if name in added}, reference, steps, len(without))


def _with(scene: Scene, name: str) -> Session | str:
    """The scene with one more effect at its defaults, loaded and compiled; or the reason why there is none."""
    needed = [key for key, default in EFFECTS[name].keys().items() if default is inspect.Parameter.empty]
    if needed:
        return f"needs keys: {', '.join(needed)}"
    wider = replace(scene, effects={**scene.effects, name: {}})
    try:
        built = build(wider)
        if name in built.off:
            return f"would be off: {built.off[name]}"
        session = prepare(wider, built)
        _seconds(session, 1)
    except ClothsimError as error:
        return f"does not go with the scene: {error.sentence}"
    return session


def _seconds(session: Session, steps: int) -> float:
    """Seconds per step of the first `steps`, or of as many as the scene has."""
    run, taken, started = session.scene.run_settings, 0, perf_counter()
    state = first_state(session.built.world, session.integrator.dt)
    for taken, report in enumerate(run_steps(session.integrator, state, run.duration, run.frames_per_second), start=1):
        if report.failure is not None:
            raise ClothsimError(report.failure.reason)
        if taken == steps:
            break
    return (perf_counter() - started) / max(taken, 1)
