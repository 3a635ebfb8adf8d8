"""Motions of pins and bodies that are set between two steps."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.body import LaterMotion, RigidMotion
from clothsim.physics.energies.pins import PinnedGroup, PinsConstraint
from clothsim.scene.assembly.scene_world import Built


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


def standing(positions: Floats, time: float) -> LaterMotion:
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
