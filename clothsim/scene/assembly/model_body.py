"""Bodies of body models: the mannequin, rigged glTF files and SMPL-family files, posed and in skeletal motion."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, as_vector
from clothsim.base.errors import InputError
from clothsim.base.inputs import as_table, is_number
from clothsim.files.characters.character import Character, mannequin_character, smpl_character
from clothsim.files.characters.clip import SkeletonMotion, Timeline, timeline
from clothsim.files.characters.gait import CLIPS, KINDS, is_packaged, packaged_clip
from clothsim.files.characters.gltf_character import read_character
from clothsim.files.characters.keep_apart import kept_apart
from clothsim.files.characters.motion_files import read_amass, read_animation, read_bvh
from clothsim.files.characters.retarget import retargeted
from clothsim.files.characters.skeleton import Pose
from clothsim.keys.generator_keys import Proportions
from clothsim.keys.mesh_keys import ClipKeys, ModelTable, PlacedKeys
from clothsim.keys.schema import keys_of
from clothsim.mesh.body import Body, PosedMotion, make_body
from clothsim.mesh.generators.mannequin.generator import turns_of
from clothsim.scene import paths
from clothsim.scene.assembly.shapes import Shape, checked_notes, existing_file, name_of, placed
from clothsim.scene.scene import Scene
from transfer.body_model import PosedBody

# Motion of a body model: its clip, retargeted where it is of another skeleton, on a timeline.

OWN = "own"
UP = {"y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}


def motion_of_model(
    keys: ModelTable, where: str, directory: Path, character: Character, first: Pose
) -> tuple[Timeline, tuple[str, ...]]:
    """The timeline of the key `motion`, and notes for the user. InputError names a bad clip."""
    given = keys.motion
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
        motion = kept_apart(character, motion, first, span, clip.loop)
        apart = f", limbs turned by up to {np.degrees(motion.largest.max(initial=0.0)):.3g} degrees to keep apart"
    from_rest = (clip.place or ("clip" if clip.clip == OWN else "start")) == "start"
    made = timeline(character.skeleton, motion, first, clip.lead_in, span, clip.loop, from_rest, UP[character.up])
    rests = "in a loop" if clip.loop else f"then it rests, from {made.duration:.4g} s on"
    return made, (
        f"{note}: {clip.lead_in:g} s from its pose to the clip, {end - clip.start:.4g} s of it, {rests}{apart}",
    )


def _motion(
    clip: ClipKeys, keys: ModelTable, where: str, directory: Path, character: Character
) -> tuple[SkeletonMotion, str]:
    """The motion of the character's skeleton that a clip is, and its name."""
    if is_packaged(clip.clip):
        own = keys.model == "mannequin" and not keys.shape
        shipped = packaged_clip(clip.clip)
        motion = shipped if own else retargeted(shipped, character.skeleton, clip.scale)
        return motion, f"motion {clip.clip}"
    ending, label = Path(clip.clip).suffix.lower(), f"motion {Path(clip.clip).name}"
    model = directory / keys.model
    if clip.clip == OWN and model.suffix.lower() in (".glb", ".gltf"):
        own_clip = read_animation(model, character.skeleton, clip.animation)
        return own_clip, f"motion {own_clip.name}"
    if ending in (".bvh", ".npz"):
        path = existing_file(f"{where}.motion", directory, clip.clip)
        if ending == model.suffix.lower():  # AMASS moves a model of the SMPL family joint by joint
            return read_amass(path, character.skeleton), label
        read = read_bvh(path) if ending == ".bvh" else read_amass(path)
        return retargeted(read, character.skeleton, clip.scale), label
    drawn = ", ".join(f"{kind}:SEED" for kind in KINDS)
    raise InputError(
        f"{where}.motion is {clip.clip!r}.", f"Known: {', '.join(CLIPS)}, {drawn}; or a .bvh or .npz file."
    )


MANNEQUIN = "mannequin"
RIGS, MODELS = (".glb", ".gltf"), (".npz",)
"""Endings of rigged meshes, and of body models."""


@dataclass(frozen=True, eq=False)
class PosedDisplacement:
    """Displacement of the vertices of a character since time 0.

    Attributes
    ----------
    character : Character
    timeline : Timeline
    first : (n, 3) ndarray [m]
        Vertices at time 0 in the space of the character.
    linear : (3, 3) ndarray
        From that space to that of the scene.
    """

    character: Character
    timeline: Timeline
    first: Floats
    linear: Floats

    def __call__(self, time: float) -> Floats:
        """Displacements at `time` [s], (n, 3) [m]."""
        return (self.character.vertices(self.timeline.pose(time)) - self.first) @ self.linear.T


@dataclass(frozen=True, eq=False)
class PlacedCharacter:
    """A character in a scene: x = linear v + shift of its posed vertices v.

    Attributes
    ----------
    character : Character
    first : Pose
        Pose at time 0.
    timeline : Timeline or None
        None: it keeps its first pose.
    linear : (3, 3) ndarray
    shift : (3,) ndarray [m]
    notes : tuple of str
    """

    character: Character
    first: Pose
    timeline: Timeline | None
    linear: Floats
    shift: Floats
    notes: tuple[str, ...]

    def pose(self, time: float) -> Pose:
        """Pose at `time` [s]."""
        return self.first if self.timeline is None else self.timeline.pose(time)

    def vertices(self, time: float) -> Floats:
        """Vertices at `time` [s] in the scene, (n, 3) [m]."""
        return self.character.vertices(self.pose(time)) @ self.linear.T + self.shift

    def skinning(self, time: float, reference: Floats) -> PosedBody:
        """Skinning from canonical positions beside `reference` (n, 3) [m], a body in its rest pose, to the scene.

        InputError where the reference is of another body model.
        """
        character, pose = self.character, self.pose(time)
        if character.positions.shape != reference.shape:
            found, wanted = len(character.positions), len(reference)
            raise InputError(f"The body model has {found} vertices, that of the run {wanted}.", "Use the same model.")
        matrices = character.matrices(pose)
        linear = self.linear @ matrices[:, :3, :3]
        moves = matrices[:, :3, 3] @ self.linear.T + self.shift
        offsets = character.positions - reference + character.pose_offsets(pose)
        return PosedBody(character.weights, offsets, linear, moves)


def body_of_model(keys: ModelTable, where: str, directory: Path) -> tuple[Body, tuple[str, ...]]:
    """The body of a table with a `model`, and notes for the user.

    InputError for a bad file, shape, pose or motion, in one sentence.
    """
    label = name_of(keys, where)
    made = placed_character(keys, where, directory)
    first = made.character.vertices(made.first)
    positions = first @ made.linear.T + made.shift
    notes = checked_notes(label, Shape(positions, made.character.triangles, np.zeros((0, 3, 2)), ()), "body")
    if made.timeline is None:
        return make_body(label, positions, made.character.triangles), notes
    displacement = PosedDisplacement(made.character, made.timeline, first, made.linear)
    motion = PosedMotion(displacement, made.timeline.duration)
    notes = (*notes, *(f"{label}: {note}" for note in made.notes))
    return make_body(label, positions, made.character.triangles, motion), notes


def placed_character(keys: ModelTable, where: str, directory: Path) -> PlacedCharacter:
    """The character of a table with a `model`, its place in the scene and its motion; errors as `body_of_model`."""
    character = character_of(keys, where, directory)
    pose = first_pose(keys, where, character)
    up: Any = keys.up or character.up
    turned = PlacedKeys(up=up, rotation_degrees=keys.rotation_degrees)
    linear = keys.scale * placed(turned, np.eye(3)).T
    ground = np.zeros(3)
    if keys.model == MANNEQUIN:
        ground[2] = character.vertices(pose)[:, 2].min()
    shift = placed(turned.with_keys(position=keys.position), np.zeros(3)) - linear @ ground
    if not keys.motion:
        return PlacedCharacter(character, pose, None, linear, shift, ())
    made, notes = motion_of_model(keys, where, directory, character, pose)
    return PlacedCharacter(character, pose, made, linear, shift, notes)


def character_of_scene(scene: Scene) -> tuple[PlacedCharacter, str]:
    """The only body model of a scene and its name. InputError where it has none or several."""
    models = [(k, keys) for k, keys in enumerate(scene.bodies) if isinstance(keys, ModelTable)]
    if len(models) != 1:
        raise InputError(
            f"The scene has {len(models)} body models.", 'It needs one: [[body]] model = "mannequin", for instance.'
        )
    k, keys = models[0]
    where = "body" if len(scene.bodies) == 1 else f"body[{k}]"
    return placed_character(keys, where, scene.directory), keys.name or where


def value_of(scene: Scene, path: str) -> Any:
    """The value of a key, as of `paths.get`; of a measure that a mannequin's `shape` leaves out, the usual one.

    Examples
    --------
    >>> scene = Scene(cloth={"mesh": "shirt"}, body={"model": "mannequin", "shape": {"height": 1.8}})
    >>> value_of(scene, "body.shape.height"), value_of(scene, "body.shape.chest")
    (1.8, 1.0)
    """
    section, number, keys = paths.located(scene, path)
    table = scene.bodies[int(number or 0)] if section == "body" else None
    if isinstance(table, ModelTable) and table.model == MANNEQUIN and keys[0] == "shape" and len(keys) > 1:
        usual = keys_of(Proportions)
        if keys[1] in usual and keys[1] not in (table.shape or {}):
            return usual[str(keys[1])].default
    return paths.get(scene, path)


def character_of(keys: ModelTable, where: str, directory: Path) -> Character:
    """The character of the keys `model`, `shape` and `group`. InputError names a bad file or shape."""
    name, shape = keys.model, keys.shape
    ending = Path(name).suffix.lower()
    if name == MANNEQUIN:
        return mannequin_character(**_by_name(f"{where}.shape", shape))
    if ending in RIGS:
        path = existing_file(f"{where}.model", directory, name)
        return read_character(path, _by_name(f"{where}.shape", shape), keys.group)
    if ending in MODELS:
        if isinstance(shape, Mapping):
            raise InputError(f"{where}.shape is a table.", "Give the shape parameters (betas) as a list of numbers.")
        return smpl_character(existing_file(f"{where}.model", directory, name), [] if shape is None else shape)
    if ending == ".pkl":
        raise InputError(
            f"{where}.model is {name}: a pickled file may run code, and is not read.",
            "Save its arrays with numpy.savez as .npz.",
        )
    raise InputError(f"{where}.model is {name!r}.", 'Give "mannequin", a rigged .glb or .gltf, or an .npz of SMPL.')


def first_pose(keys: ModelTable, where: str, character: Character) -> Pose:
    """The pose of the key `pose`: named, of the mannequin, or rotation vectors from rest by joint [degrees]."""
    pose, skeleton = keys.pose, character.skeleton
    if pose is None:
        return skeleton.rest
    if isinstance(pose, str):
        if keys.model != MANNEQUIN:
            raise InputError(f"{where}.pose is {pose!r}.", "Give a table of joints with rotation vectors [degrees].")
        return skeleton.turned(dict(turns_of(pose, None)))
    turns = {
        name: np.radians(as_vector(f"{where}.pose.{name}", turn))
        for name, turn in as_table(f"{where}.pose", pose).items()
    }
    try:
        return skeleton.turned(turns)
    except InputError as error:
        raise InputError(f"{where}.pose: {error.sentence}", error.remedy) from error


def _by_name(where: str, shape: Any) -> dict[str, float]:
    """A shape as numbers by name."""
    if shape is None:
        return {}
    if not isinstance(shape, Mapping):
        raise InputError(f"{where} is a list.", 'Give numbers by name: { height = 1.8 } or { "morph target" = 1.0 }.')
    for name, value in shape.items():
        if not is_number(value) or not np.isfinite(value):
            raise InputError(f"{where}.{name} is {value!r}.", "Give a number.")
    return {str(name): float(value) for name, value in shape.items()}
