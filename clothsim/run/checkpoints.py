"""Checkpoints of runs and of simulations: state, scene, motions set by hand, and the files that the scene names."""

import atexit
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from clothsim.base.errors import InputError
from clothsim.files.runs.checkpoint import Checkpoint
from clothsim.physics.energies.key_values import FUNCTION, lost_function
from clothsim.run.certificate import Certificate, certificate_from
from clothsim.run.changes import HandMotions, hand_motions_from
from clothsim.run.intersections import IntersectionHistory
from clothsim.run.session import Session, prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.named_files import refuse_outside, relocated
from clothsim.scene.scene import scene_from_text
from clothsim.solve.stepping.state import State
from clothsim.solve.timers import EffectCounters, Timers


def saved_simulation(session: Session, state: State, by_hand: HandMotions, history: IntersectionHistory) -> Checkpoint:
    """The checkpoint of a simulation, with the files that its scene names.

    InputError: a key of an effect is a Python function, which no file holds, or a file of the scene is not there any
    more.
    """
    refuse_functions("effects", session.scene.effects)
    text, sources = relocated(session.scene) if session.scene.file_names else (scene_text(session), {})
    saved = checkpoint_of(session, state, Certificate(intersections=history), text)
    files = {name: source.read_bytes() for name, source in sources.items()}
    return replace(saved, counters={**saved.counters, "by_hand": by_hand.as_json()}, files=files)


def restored_simulation(
    saved: Checkpoint, name: str, here: Path
) -> tuple[Session, State, HandMotions, IntersectionHistory]:
    """Session, state, motions and intersections so far of a checkpoint of `saved_simulation`, or of a run.

    name: of the file, for messages; here: folder of the run, where a checkpoint of a run without its own files starts.
    InputError: the mesh of the scene is not that of the state.
    """
    if saved.files:
        refuse_outside(saved.scene_text, saved.files)
        here = Path(tempfile.mkdtemp(prefix="clothsim-"))
        atexit.register(shutil.rmtree, here, ignore_errors=True)  # not earlier: a changed effect reads its files again
        for file, content in saved.files.items():
            (here / file).parent.mkdir(parents=True, exist_ok=True)
            (here / file).write_bytes(content)
    scene = scene_from_text(saved.scene_text, here)
    by_hand = hand_motions_from(saved.counters.get("by_hand", HandMotions().as_json()))
    built = by_hand.applied(build(scene))
    if len(saved.state.positions) != built.world.n_vertices:
        raise InputError(f"{name} has another mesh than its scene.", "Restore the mesh files of the scene.")
    history = certificate_from(saved.counters["certificate"]).intersections
    return prepare(scene, built), saved.state, by_hand, history


def scene_text(session: Session, directory: Path | None = None) -> str:
    """The text of the scene for checkpoints, written once a run: meshes in memory are in it; directory: of the run."""
    return session.scene.to_text(names_of_functions=True, here=directory)


def checkpoint_of(session: Session, state: State, certificate: Certificate, text: str) -> Checkpoint:
    """The checkpoint of a run at `state`; text: the `scene_text`."""
    potential = session.integrator.potential
    counters = {
        "certificate": certificate.as_json(),
        "effects": potential.effect_counters(),
        "phases": potential.timers.phases,
        "linear_solves": potential.timers.linear_solves,
    }
    return Checkpoint(state, text, counters)


def restore(timers: Timers, counters: dict[str, Any]) -> None:
    """Set the counters to those of the stopped run."""
    for name, account in counters["effects"].items():
        timers.effects[name] = EffectCounters(**account)
    timers.phases.update(counters["phases"])
    timers.linear_solves = counters["linear_solves"]


def refuse_functions(where: str, keys: Mapping[str, Any]) -> None:
    """InputError for a Python function among the keys: no file holds it."""
    for key, value in keys.items():
        if callable(value):
            raise lost_function(f"{where}.{key}", {FUNCTION: getattr(value, "__qualname__", type(value).__name__)})
        if isinstance(value, Mapping):
            if set(value) == {FUNCTION}:
                raise lost_function(f"{where}.{key}", value)
            refuse_functions(f"{where}.{key}", value)
