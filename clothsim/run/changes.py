"""Changes of a simulation between two steps: keys of effects, fabrics, motions of pins and bodies."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.arrays import Floats, Ints, as_points
from clothsim.base.errors import InputError
from clothsim.keys.value_checks import refuse_absent, refuse_unknown_key
from clothsim.mesh.body import LaterMotion, RigidMotion, motion_of
from clothsim.mesh.world import World, make_world
from clothsim.physics.energies.base import PinnedGroup, PinsConstraint
from clothsim.physics.energies.protocols import BarrierGap
from clothsim.run.session import Session, rebuilt
from clothsim.scene.assembly.meshes import FABRIC, fabric_of
from clothsim.scene.assembly.scene_world import Built, build_effects
from clothsim.scene.effects import EFFECTS
from clothsim.solve.stepping.state import State


@dataclass(frozen=True)
class HandMotions:
    """Motions set by hand that replace those of a scene.

    pins: of each group by its name the rows of x (k,) and their motion, None where the group is released; bodies: the
    motion of each body by its name.
    """

    pins: Mapping[str, tuple[Ints, LaterMotion] | None] = field(default_factory=dict)
    bodies: Mapping[str, LaterMotion] = field(default_factory=dict)

    def applied(self, built: Built) -> Built:
        """Built world with these motions."""
        if self.bodies:
            bodies = tuple(replace(body, motion=self.bodies.get(body.name, body.motion)) for body in built.world.bodies)
            built = replace(built, world=replace(built.world, bodies=bodies))
        if not self.pins:
            return built
        groups = {group.name: group for group in pin_groups(built)}
        for name, pinned in self.pins.items():
            if pinned is None:
                groups.pop(name, None)
            else:
                rows, motion = pinned
                groups[name] = PinnedGroup(rows, motion.positions, motion, name)
        others = {name: constraint for name, constraint in built.constraints.items() if name != "pins"}
        pins = {"pins": PinsConstraint(tuple(groups.values()))} if groups else {}
        return replace(built, constraints={**others, **pins})

    def with_pins(self, name: str, pinned: tuple[Ints, LaterMotion] | None) -> "HandMotions":
        """The motions with those of a group replaced."""
        return replace(self, pins={**self.pins, name: pinned})

    def with_body(self, name: str, motion: LaterMotion) -> "HandMotions":
        """The motions with that of a body replaced."""
        return replace(self, bodies={**self.bodies, name: motion})

    def as_json(self) -> dict[str, Any]:
        """Every number, for a file."""
        pins = {
            name: None if pinned is None else {"rows": pinned[0], **_fields(pinned[1])}
            for name, pinned in self.pins.items()
        }
        return {"pins": pins, "bodies": {name: _fields(motion) for name, motion in self.bodies.items()}}


def hand_motions_from(fields: Mapping[str, Any]) -> HandMotions:
    """The motions that `HandMotions.as_json` wrote."""
    pins = {
        name: None if given is None else (np.array(given["rows"], np.int64), _motion(given))
        for name, given in fields["pins"].items()
    }
    return HandMotions(pins, {name: _motion(given) for name, given in fields["bodies"].items()})


def pin_groups(built: Built) -> tuple[PinnedGroup, ...]:
    """The groups of pinned vertices; none where the scene pins nothing."""
    pins = built.constraints.get("pins")
    return pins.groups if isinstance(pins, PinsConstraint) else ()


def still_from(positions: Floats, time: float) -> LaterMotion:
    """From `time` [s] on at `positions (n, 3)` [m]."""
    return LaterMotion(positions, RigidMotion(np.zeros(3), np.zeros(3), np.zeros(3)), time)


def _fields(motion: LaterMotion) -> dict[str, Any]:
    rigid = motion.motion
    vectors = {"velocity": rigid.velocity, "angular_velocity": rigid.angular_velocity, "centre": rigid.centre}
    return {"places": motion.positions, "since": motion.since, **vectors}


def _motion(given: Mapping[str, Any]) -> LaterMotion:
    velocity, angular_velocity, centre, positions = (
        np.array(given[key], np.float64) for key in ("velocity", "angular_velocity", "centre", "places")
    )
    return LaterMotion(positions.reshape(-1, 3), RigidMotion(velocity, angular_velocity, centre), float(given["since"]))


def with_effect(session: Session, by_hand: HandMotions, effect: str, keys: Mapping[str, Any]) -> Session:
    """The session with keys of an effect changed; the other energies stay the same objects."""
    scene, built = session.scene, session.built
    if effect == "pins":
        raise InputError("Pins are not changed by their keys.", "Use move_pins, drive_pins, add_pins, release_pins.")
    if effect in EFFECTS and effect not in scene.effects:
        raise InputError(f"The scene has no effects.{effect}.", "Name it in the scene; it may be off at the start.")
    refuse_absent("effect", effect, scene.effects)
    scene = replace(scene, effects={**scene.effects, effect: {**scene.effects[effect], **keys}})
    built = build_effects(scene, built.world, before=built, changed=(effect,))
    return rebuilt(session, scene, by_hand.applied(built))


def with_fabric(
    session: Session, by_hand: HandMotions, fabric: str | None, cloth: str | None, keys: Mapping[str, float]
) -> Session:
    """Session with the fabric of a cloth changed: masses, hinges and all energies are rebuilt."""
    world, scene = session.built.world, session.scene
    refuse_unknown_key("A fabric", keys, FABRIC)
    names = [each.name for each in world.cloths]
    k = number_of("cloth", cloth, names)
    table = {**scene.cloths[k], **keys, **({} if fabric is None else {"fabric": fabric})}
    scene = replace(scene, cloth=[table if i == k else each for i, each in enumerate(scene.cloths)])
    made, _ = fabric_of(scene.cloths[k], names[k])
    cloths = tuple(replace(each, fabric=made) if i == k else each for i, each in enumerate(world.cloths))
    unclamped = replace(make_world(cloths, world.prescribed_bodies, world.rigid), origin=world.origin)
    return rebuilt(session, scene, by_hand.applied(build_effects(scene, unclamped)))


def refuse_infeasible(session: Session, before: Session, effect: str, state: State) -> None:
    """InputError where a barrier that was made again is infinite at the state, which no step could leave."""
    for name, energy in session.built.energies.items():
        made_again = energy is not before.built.energies.get(name)
        if made_again and isinstance(energy, BarrierGap) and not np.isfinite(energy.value(state.positions)):
            raise InputError(
                f"The cloth at {state.time:g} s does not satisfy effects.{name} with these keys of {effect}.",
                "Choose a smaller offset or a larger limit, or change it in smaller steps.",
            )


def pins_at(built: Built, state: State, group: str, positions: ArrayLike) -> tuple[Ints, LaterMotion]:
    """The rows of x of a group and the motion that keeps them at `positions` (k, 3) [m] from the next step on."""
    rows = pinned_rows(built, group)
    if (rows >= built.world.n_cloth).any():
        raise InputError(
            f"{group} is clamped, so that positions alone do not determine its rotation.", "Use drive_pins."
        )
    points = _points(f"positions of {group}", positions, len(rows)) - built.world.origin
    return rows, still_from(points, state.time)


def new_pins(
    built: Built, state: State, group: str, vertices: Sequence[int], cloth: str | None
) -> tuple[Ints, LaterMotion]:
    """The rows of x of a new group of pins and the motion that keeps them where they are."""
    world, groups = built.world, pin_groups(built)
    if not isinstance(group, str) or not group:
        raise InputError(f"The name of a group of pins must be text, not {group!r}.", 'Write add_pins("hand", ...).')
    if group in {each.name for each in groups}:
        raise InputError(f"There is a group {group!r} of pins already.", "Choose another name.")
    part = world.cloth_slices[number_of("cloth", cloth, [each.name for each in world.cloths])]
    try:
        own = np.unique(np.asarray(vertices))
    except ValueError:  # a ragged list
        own = np.zeros(0, np.int64)
    if not own.size or own.dtype.kind not in "iu" or own[0] < 0 or own[-1] >= part.stop - part.start:
        raise InputError(f"vertices of {group} must be whole numbers from 0 to {part.stop - part.start - 1}.")
    rows = (own + part.start).astype(np.int64)
    for each in groups:
        if np.isin(rows, each.vertices).any():
            raise InputError(f"A vertex of {group} is pinned by {each.name}.", "Leave it out, or release_pins first.")
    return rows, still_from(state.positions[rows], state.time)


def pinned_rows(built: Built, group: str) -> Ints:
    """The rows of x of a group of pins, with those of the ghosts of a clamp."""
    groups = {each.name: each.vertices for each in pin_groups(built)}
    refuse_absent("group of pins", group, groups)
    return groups[group]


def body_at(world: World, state: State, name: str, positions: ArrayLike) -> LaterMotion:
    """The motion that keeps a body at `positions` (n, 3) [m] from the next step on."""
    rows = rows_of_moved_body(world, name)
    points = _points(f"positions of {name}", positions, rows.stop - rows.start) - world.origin
    return still_from(points, state.time)


def rows_of_moved_body(world: World, name: str) -> slice:
    """The rows of x of a body whose motion is prescribed. InputError for a rigid one, which forces move."""
    if name in [body.name for body in world.rigid]:
        raise InputError(f"{name} is rigid: forces move it.", "Make it a [[body]] to move it by hand.")
    return world.body_slices[number_of("body", name, [each.name for each in world.bodies])]


def driven(
    world: World, state: State, name: str, rows: Ints | slice, keys: Mapping[str, Any], centre: ArrayLike | None
) -> LaterMotion:
    """The rigid motion of `rows` of x from where they are; centre [m]: their mean where it is not given."""
    points: Floats = state.positions[rows]
    about = points.mean(axis=0) + world.origin if centre is None else centre
    return LaterMotion(points, motion_of(f"motion of {name}", {**keys, "centre": about}, world.origin), state.time)


def number_of(kind: str, name: str | None, names: Sequence[str]) -> int:
    """The number of a cloth or body, the only one where no name is given. InputError for one that is not there."""
    if name is None:
        if len(names) != 1:
            raise InputError(f"The scene has {len(names)} cloths.", f"Name one: {', '.join(names)}.")
        return 0
    refuse_absent(kind, name, names)
    return names.index(name)


def _points(name: str, values: ArrayLike, count: int) -> Floats:
    points = as_points(name, values)
    if len(points) != count:
        raise InputError(f"{name}: {len(points)} points for {count} vertices.")
    return points
