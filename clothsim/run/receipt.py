"""Receipt: counters and CPU seconds of each effect, of a run or of a scene's first steps, and of those not named."""

import inspect
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.process_memory import held_bytes
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.run.results import open_run
from clothsim.run.session import Session, prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.effects import EFFECTS
from clothsim.scene.scene import Scene, scene_from_text
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.stepping import StepReport
from clothsim.solve.stepping.time_loop import steps as run_steps
from clothsim.solve.timers import EffectCounters

ROUNDS = 3
LATE = "not measured: the time was spent"


@dataclass(frozen=True)
class Added:
    """Median CPU seconds of a step with the effect, and their ratio to one without; nan where `why` has the reason."""

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


@dataclass(frozen=True)
class Receipt:
    """Counters of all effects.

    effects: every name of the table, and what comes with rigid bodies: on, reason, summary and counters; of a scene
    also bytes, of the arrays that the effect alone holds, and where it was measured adding, the cost of an effect that
    is not named (`Added`).
    phases: seconds that belong to no effect; "step control" is the remainder. seconds: of all of them together, which
    is all of the measured time; source: the run or the steps that were measured; absent: where it was measured, the
    cost of the effects that a scene does not name. All are CPU seconds: a loaded machine has the same.
    """

    effects: dict[str, dict[str, Any]]
    phases: dict[str, float]
    seconds: float
    source: str
    absent: Absent | None = None


def explain(target: Scene | Path, steps: int = 5, budget: float | None = None) -> Receipt:
    """The receipt of a run, or of the first `steps` of a scene.

    budget: time to measure also the effects that the scene does not name in [s].
    """
    if isinstance(target, Path):
        return explain_run(target)
    receipt = explain_scene(target, steps)
    return receipt if budget is None else with_absent(receipt, absent_effects(target, steps, budget))


def explain_scene(scene: Scene, steps: int = 5) -> Receipt:
    """The receipt of the first `steps` of a scene, after one step on a copy, which loads and compiles the kernels."""
    duration = scene.run_settings.duration
    taken, reason = 0, ""
    report: StepReport | None = None
    for count in (1, steps):
        session = prepare(scene, build(scene, affordable=True))
        state = first_state(session.built.world, session.integrator.dt)
        frequency = scene.run_settings.frames_per_second
        for taken, report in enumerate(run_steps(session.integrator, state, duration, frequency), start=1):
            reason = "" if report.failure is None else f" {report.failure.reason}"
            if taken == count:
                break
    potential = session.integrator.potential
    source = f"the first {taken} step{'' if taken == 1 else 's'} of the scene.{reason}"
    receipt = _receipt(scene.effects, session.built.off, potential.effect_counters(), potential.timers.phases, source)
    bound = potential.energies if report is None else report.potential.energies
    for name, energy in bound.items():
        others = [session.built.world, *(other for key, other in potential.energies.items() if key != name)]
        receipt.effects[name]["bytes"] = held_bytes(energy, others)
    return receipt


def with_absent(receipt: Receipt, absent: Absent) -> Receipt:
    """The receipt with the cost of each absent effect."""
    added = {name: {**receipt.effects[name], "adding": asdict(each)} for name, each in absent.effects.items()}
    return replace(receipt, effects={**receipt.effects, **added}, absent=absent)


def explain_run(directory: Path) -> Receipt:
    """The receipt of all steps of a run, or of those up to the last checkpoint of one that was stopped."""
    run = open_run(directory)
    saved = read_checkpoint(directory / CHECKPOINT_NAME)
    counters = run.summary or saved.counters
    if "effects" not in counters or "phases" not in counters:
        raise InputError(f"The summary in {directory} has no receipt.", "Run the scene with this version.")
    named = scene_from_text(saved.scene_text).effects
    steps = run.summary.get("steps", saved.state.step)
    source = f"{steps} steps of a run that is {run.status}, with the time to load and compile their kernels."
    return _receipt(named, counters.get("off", {}), counters["effects"], counters["phases"], source)


def _receipt(
    named: Collection[str],
    off: Mapping[str, str],
    effect_counters: Mapping[str, Mapping[str, Any]],
    phases: Mapping[str, float],
    source: str,
) -> Receipt:
    seconds = sum(account["seconds"] for account in effect_counters.values()) + sum(phases.values())
    effects = {}
    implied = [name for name in effect_counters if name not in EFFECTS]
    for name in (*EFFECTS, *implied):
        on = (name in named or name in implied) and name not in off
        account = {**asdict(EffectCounters()), **effect_counters.get(name, {})}
        reason = _describe_activity(account) if on else off.get(name, "not named in the scene")
        reason = "comes with [[rigid]]" if name in implied else reason
        fraction = account["seconds"] / seconds if seconds else 0.0
        summary = EFFECTS[name].summary if name in EFFECTS else ""
        effects[name] = {"on": on, "reason": reason, **account, "share": fraction, "summary": summary}
    return Receipt(effects, dict(phases), seconds, source)


def _describe_activity(account: Mapping[str, Any]) -> str:
    if not account["idle_steps"]:
        return "named in the scene"
    return f"named; had nothing to do in {account['idle_steps']} of {account['steps']} steps"


def absent_effects(scene: Scene, steps: int = 5, budget: float = 60.0) -> Absent:
    """Measure the first `steps` of a scene as it is and with each absent effect, its keys at their defaults.

    All take turns in at most ROUNDS rounds, until `budget` [s] is spent; a measurement that has begun is completed.
    """
    ends = perf_counter() + budget
    base = prepare(scene, build(scene, affordable=True))
    _seconds_a_step(base, 1)  # loads and compiles
    added: dict[str, Added] = {}
    sessions: dict[str, Session] = {}
    for name in (name for name in EFFECTS if name not in scene.effects):
        made = _session_with(scene, name) if perf_counter() < ends else LATE
        if isinstance(made, str):
            added[name] = Added(why=made)
        else:
            sessions[name] = made
    times: dict[str, list[float]] = {name: [] for name in sessions}
    without: list[float] = []
    while len(without) < ROUNDS and (not without or perf_counter() < ends):
        without.append(_seconds_a_step(base, steps))
        for name, session in sessions.items():
            if perf_counter() < ends and name not in added:
                try:
                    times[name].append(_seconds_a_step(session, steps))
                except ClothsimError as error:
                    added[name] = Added(why=f"a step fails with it: {error}")
    reference = median(without)
    for name, seen in times.items():
        measured = Added(median(seen), median(seen) / reference) if seen else Added(why=LATE)
        added.setdefault(name, measured)
    return Absent({name: added[name] for name in EFFECTS if name in added}, reference, steps, len(without))


def _session_with(scene: Scene, name: str) -> Session | str:
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
        _seconds_a_step(session, 1)
    except ClothsimError as error:
        return f"does not go with the scene: {error.sentence}"
    return session


def _seconds_a_step(session: Session, steps: int) -> float:
    """CPU seconds per step of the first `steps`, or of as many as the scene has."""
    run, taken, started = session.scene.run_settings, 0, process_time()
    state = first_state(session.built.world, session.integrator.dt)
    for taken, report in enumerate(run_steps(session.integrator, state, run.duration, run.frames_per_second), start=1):
        if report.failure is not None:
            raise ClothsimError(report.failure.reason)
        if taken == steps:
            break
    return (process_time() - started) / max(taken, 1)
