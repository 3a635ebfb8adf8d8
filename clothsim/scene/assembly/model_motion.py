"""Motion of a body model: its clip, retargeted where it is of another skeleton, on a timeline."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from clothsim.files.characters.character import Character
from clothsim.files.characters.clip import Motion
from clothsim.files.characters.gait import CLIPS, shipped_clip
from clothsim.files.characters.retarget import retargeted
from clothsim.files.characters.skeleton import Pose
from clothsim.files.characters.timeline import Timeline, timeline
from clothsim.keys.model_keys import ClipKeys
from clothsim.scene.assembly.placement import existing_file

OWN = "own"
UP = {"y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}


def motion_of_model(
    keys: Mapping[str, Any], where: str, directory: Path, character: Character, first: Pose
) -> tuple[Timeline, tuple[str, ...]]:
    """The timeline of the key `motion`, and notes for the user. InputError names a bad clip."""
    given = keys["motion"]
    clip = ClipKeys.parsed(f"{where}.motion", {"clip": given} if isinstance(given, str) else given)
    motion, note = _motion(clip, keys, where, directory, character)
    end = motion.duration if clip.end is None else min(clip.end, motion.duration)
    if not clip.start < end and motion.duration > 0:
        raise InputError(
            f"{where}.motion starts at {clip.start:g} s and ends at {end:g} s.",
            f"The clip has {motion.duration:.3g} s.",
        )
    span = (min(clip.start, end), end)
    apart = ""
    if clip.keep_apart:
        from clothsim.files.characters.keep_apart import kept_apart

        motion = kept_apart(character, motion, first, span, clip.loop)
        apart = f", limbs turned by up to {np.degrees(motion.largest.max(initial=0.0)):.3g} degrees to keep apart"
    from_rest = (clip.place or ("clip" if clip.clip == OWN else "start")) == "start"
    made = timeline(character.skeleton, motion, first, clip.lead_in, span, clip.loop, from_rest, UP[character.up])
    rests = "in a loop" if clip.loop else f"then it rests, from {made.duration:.4g} s on"
    return made, (
        f"{note}: {clip.lead_in:g} s from its pose to the clip, {end - clip.start:.4g} s of it, {rests}{apart}",
    )


def _motion(
    clip: ClipKeys, keys: Mapping[str, Any], where: str, directory: Path, character: Character
) -> tuple[Motion, str]:
    """The motion of the character's skeleton that a clip is, and its name."""
    if clip.clip in CLIPS:
        own = keys["model"] == "mannequin" and not keys.get("shape")
        shipped = shipped_clip(clip.clip)
        motion = shipped if own else retargeted(shipped, character.skeleton, clip.scale)
        return motion, f"motion {clip.clip}"
    ending, label = Path(clip.clip).suffix.lower(), f"motion {Path(clip.clip).name}"
    model = directory / keys["model"]
    if clip.clip == OWN and model.suffix.lower() in (".glb", ".gltf"):
        from clothsim.files.characters.gltf_animation import read_animation

        own_clip = read_animation(model, character.skeleton, clip.animation)
        return own_clip, f"motion {own_clip.name}"
    if ending in (".bvh", ".npz"):
        path = existing_file(f"{where}.motion", directory, clip.clip)
        return _of_file(path, model, character, clip.scale), label
    raise InputError(f"{where}.motion is {clip.clip!r}.", f"Known: {', '.join(CLIPS)}; or a .bvh or .npz file.")


def _of_file(path: Path, model: Path, character: Character, scale: float | None) -> Motion:
    """The motion of a .bvh or an AMASS .npz file; that of AMASS moves a model of the SMPL family joint by joint."""
    if path.suffix.lower() == ".bvh":
        from clothsim.files.characters.bvh import read_bvh

        return retargeted(read_bvh(path), character.skeleton, scale)
    from clothsim.files.characters.amass import read_amass

    if model.suffix.lower() == ".npz":
        return read_amass(path, character.skeleton)
    return retargeted(read_amass(path), character.skeleton, scale)
