"""Saved simulations: state, scene, motions set by hand, and the files that the scene names."""

import atexit
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

from clothsim.base.errors import InputError
from clothsim.files.runs.checkpoint import Checkpoint
from clothsim.run.archive import refuse_functions
from clothsim.run.certificate.certificate import Certificate, certificate_from
from clothsim.run.certificate.intersection_history import IntersectionHistory
from clothsim.run.hand_motions import HandMotions, hand_motions_from
from clothsim.run.session import Session, prepare
from clothsim.run.summary import checkpoint_of, state_of
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.named_files import named_files, refuse_outside, relocated
from clothsim.scene.scene import scene_from_text
from clothsim.solve.stepping.state import State


def saved_simulation(session: Session, state: State, by_hand: HandMotions, history: IntersectionHistory) -> Checkpoint:
    """The checkpoint of a simulation, with the files that its scene names.

    Raises
    ------
    InputError
        A key of an effect is a Python function, which no file holds, or a file of the scene is not there any more.
    """
    refuse_functions("effects", session.scene.effects)
    saved = checkpoint_of(session, state, Certificate(intersections=history))
    saved = replace(saved, counters={**saved.counters, "by_hand": by_hand.as_json()})
    if not named_files(session.scene):
        return saved
    text, sources = relocated(session.scene)
    return replace(saved, scene_text=text, files={name: source.read_bytes() for name, source in sources.items()})


def restored_simulation(
    saved: Checkpoint, name: str, here: Path
) -> tuple[Session, State, HandMotions, IntersectionHistory]:
    """Session, state, motions and intersections so far of a checkpoint of `saved_simulation`, or of a run.

    Parameters
    ----------
    saved : Checkpoint
        The state.
    name : str
        Of the file, for messages.
    here : Path
        Folder of the run, where a checkpoint of a run without its own files starts.

    Raises
    ------
    InputError
        The mesh of the scene is not that of the state.
    """
    scene = scene_from_text(saved.scene_text, _written_files(saved) if saved.files else here)
    by_hand = hand_motions_from(saved.counters.get("by_hand", HandMotions().as_json()))
    built = by_hand.applied(build(scene))
    if len(saved.positions) != built.world.n_vertices:
        raise InputError(f"{name} is of another mesh than its scene.", "Restore the mesh files of the scene.")
    history = certificate_from(saved.counters["certificate"]).intersections
    return prepare(scene, built), state_of(saved), by_hand, history


def _written_files(saved: Checkpoint) -> Path:
    """A temporary folder with the files of a checkpoint."""
    refuse_outside(saved.scene_text, saved.files)
    folder = Path(tempfile.mkdtemp(prefix="clothsim-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)  # not earlier: a changed effect reads its files again
    for name, content in saved.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder
