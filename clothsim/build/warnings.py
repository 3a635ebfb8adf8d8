"""What a scene says that may not be meant: nothing is refused for it, and a run prints it before it starts."""

import numpy as np

from clothsim.energies.base import Energy
from clothsim.mesh.motion import FrameMotion
from clothsim.mesh.topology import components
from clothsim.mesh.winding_number import is_inside
from clothsim.mesh.world import World
from clothsim.scene.effects import CONTACTS

INSIDE = 0.9
"""A start closer than this share of d_hat is told."""


def scene_warnings(world: World, energies: dict[str, Energy], dt: float) -> tuple[str, ...]:
    """All of them, of a world that is stepped by at most `dt` [s]."""
    return (
        *_ignored_keys(world, energies),
        *_skipped_frames(world, dt),
        *_starts_inside(world, energies),
        *_wide_activation(world, energies),
        *_close_starts(world, energies),
    )


def _ignored_keys(world: World, energies: dict[str, Energy]) -> list[str]:
    """What the scene says that no effect of it listens to."""
    ignored = []
    moving = [cloth.name for cloth in world.cloths if cloth.velocity.any()]
    if moving and "inertia" not in energies:
        ignored.append(f"{moving[0]}: velocity does nothing without effects.inertia.")
    if len(world.ghosts) and "bending" not in energies:
        ignored.append("pins: clamp does nothing without effects.bending.")
    return ignored


def _skipped_frames(world: World, dt: float) -> list[str]:
    """Bodies whose frames are shorter than a step of `dt` [s]."""
    said = []
    for body in world.bodies:
        motion = body.motion
        if isinstance(motion, FrameMotion) and not motion.still and dt * motion.frames_per_second > 1 + 1e-9:
            frame = 1 / motion.frames_per_second
            said.append(f"{body.name}: within a step of {dt:g} s it moves straight past its frames of {frame:g} s.")
    return said


def _starts_inside(world: World, energies: dict[str, Energy]) -> list[str]:
    """Pieces of cloth that start inside a body without touching it: contact will keep them there."""
    if "body_contact" not in energies:
        return []
    said = []
    for cloth in world.cloths:
        firsts = np.unique(components(cloth.triangles, len(cloth.positions)), return_index=True)[1]
        for body in world.bodies:
            inside = [row for row in firsts if is_inside(cloth.positions[row], body.positions, body.triangles)]
            if inside:
                pieces = "all of it" if len(firsts) == 1 else f"{len(inside)} of its {len(firsts)} pieces"
                where = f"{pieces}, such as vertex {inside[0]}"
                said.append(f"{cloth.name} starts inside {body.name}, {where}: contact keeps it in.")
    return said


def _wide_activation(world: World, energies: dict[str, Energy]) -> list[str]:
    """Contact that begins further away than the mesh is fine."""
    starts = world.start()[world.edges]
    edge = float(np.median(np.linalg.norm(starts[:, 0] - starts[:, 1], axis=1)))
    wide = {name: float(getattr(energies.get(name), "d_hat", 0.0)) for name in CONTACTS}
    return [
        f"{name}: d_hat of {d_hat:g} m is more than the median edge of {edge:.2g} m: what is close at rest is pushed "
        "apart."
        for name, d_hat in wide.items()
        if d_hat > edge
    ]


def _close_starts(world: World, energies: dict[str, Energy]) -> list[str]:
    """Contact that pushes before anything has moved: a gap well inside d_hat is no rest, and its energy is set free."""
    said = []
    for name in CONTACTS:
        d_hat = float(getattr(energies.get(name), "d_hat", 0.0))
        gap = energies[name].minimum_gap(world.start()) if d_hat else np.inf
        if gap < INSIDE * d_hat:
            said.append(
                f"{name}: the start is {gap:.2g} m from contact, inside d_hat of {d_hat:g} m: it is pushed off."
            )
    return said
