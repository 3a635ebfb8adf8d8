"""What a scene says that may not be meant: nothing is refused for it, and a run prints it before it starts."""

import numpy as np

from clothsim.energies.base import Energy
from clothsim.energies.protocols import ContactGap
from clothsim.mesh.motion import FrameMotion
from clothsim.mesh.topology import components
from clothsim.mesh.winding_number import is_inside
from clothsim.mesh.world import World

INSIDE = 0.9
"""A start closer than this share of d_hat is told."""


def remarks(world: World, energies: dict[str, Energy], dt: float) -> tuple[str, ...]:
    """All of them, of a world that is stepped by at most `dt` [s]."""
    return (
        *_without_effect(world, energies),
        *_cut_corners(world, dt),
        *_swallowed(world, energies),
        *_wide(world, energies),
        *_pushed_off(world, energies),
    )


def _without_effect(world: World, energies: dict[str, Energy]) -> list[str]:
    """What the scene says that no effect of it listens to."""
    unheard = []
    moving = [cloth.name for cloth in world.cloths if cloth.velocity.any()]
    if moving and "inertia" not in energies:
        unheard.append(f"{moving[0]}: velocity does nothing without effects.inertia.")
    if len(world.ghosts) and "bending" not in energies:
        unheard.append("pins: clamp does nothing without effects.bending.")
    return unheard


def _cut_corners(world: World, dt: float) -> list[str]:
    """Bodies whose frames are shorter than a step of `dt` [s]."""
    said = []
    for body in world.bodies:
        motion = body.motion
        if isinstance(motion, FrameMotion) and not motion.still and dt * motion.frames_per_second > 1 + 1e-9:
            frame = 1 / motion.frames_per_second
            said.append(f"{body.name}: within a step of {dt:g} s it moves straight past its frames of {frame:g} s.")
    return said


def _swallowed(world: World, energies: dict[str, Energy]) -> list[str]:
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


def _wide(world: World, energies: dict[str, Energy]) -> list[str]:
    """Contact that begins further away than the mesh is fine."""
    starts = world.start()[world.edges]
    edge = float(np.median(np.linalg.norm(starts[:, 0] - starts[:, 1], axis=1)))
    wide = {name: energy.d_hat for name, energy in energies.items() if isinstance(energy, ContactGap)}
    return [
        f"{name}: d_hat of {d_hat:g} m is more than the median edge of {edge:.2g} m: what is close at rest is pushed "
        "apart."
        for name, d_hat in wide.items()
        if d_hat > edge
    ]


def _pushed_off(world: World, energies: dict[str, Energy]) -> list[str]:
    """Contact that pushes before anything has moved: a gap well inside d_hat is no rest, and its energy is set free."""
    said = []
    for name, energy in energies.items():
        if not isinstance(energy, ContactGap):
            continue
        gap, d_hat = energy.minimum_gap(world.start()), energy.d_hat
        if gap < INSIDE * d_hat:
            said.append(
                f"{name}: the start is {gap:.2g} m from contact, inside d_hat of {d_hat:g} m: it is pushed off."
            )
    return said
