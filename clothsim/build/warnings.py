"""Warnings about a scene: keys without effect and unusual starts, printed before a run and no reason to refuse it."""

import numpy as np

from clothsim.energies.base import Energy
from clothsim.mesh.motion import FrameMotion
from clothsim.mesh.topology import components
from clothsim.mesh.winding_number import is_inside
from clothsim.mesh.world import World
from clothsim.scene.effects import CONTACTS

INSIDE = 0.9
"""Gap at the start, as fraction of d_hat, below which a warning is given."""


def scene_warnings(world: World, energies: dict[str, Energy], dt: float) -> tuple[str, ...]:
    """The warnings of a world.

    Parameters
    ----------
    world : World
        Cloths and bodies at the start.
    energies : dict of str to Energy
        The effects that are on.
    dt : float
        Longest time step [s].

    Returns
    -------
    tuple of str
        One sentence each.
    """
    return (
        *_ignored_keys(world, energies),
        *_skipped_frames(world, dt),
        *_starts_inside(world, energies),
        *_wide_activation(world, energies),
        *_close_starts(world, energies),
    )


def _ignored_keys(world: World, energies: dict[str, Energy]) -> list[str]:
    """Keys without effect in this scene."""
    ignored = []
    moving = [cloth.name for cloth in world.cloths if cloth.velocity.any()]
    if moving and "inertia" not in energies:
        ignored.append(f"{moving[0]}: velocity does nothing without effects.inertia.")
    if len(world.ghosts) and "bending" not in energies:
        ignored.append("pins: clamp does nothing without effects.bending.")
    return ignored


def _skipped_frames(world: World, dt: float) -> list[str]:
    """Animated bodies whose frames are shorter than a step of `dt` [s]."""
    sentences = []
    for body in world.bodies:
        motion = body.motion
        if isinstance(motion, FrameMotion) and not motion.still and dt * motion.frames_per_second > 1 + 1e-9:
            frame = 1 / motion.frames_per_second
            sentences.append(
                f"{body.name}: a step of {dt:g} s skips frames of {frame:g} s: it moves in straight lines."
            )
    return sentences


def _starts_inside(world: World, energies: dict[str, Energy]) -> list[str]:
    """Pieces of cloth that start inside a body without intersecting it: contact keeps them there."""
    if "body_contact" not in energies:
        return []
    sentences = []
    for cloth in world.cloths:
        firsts = np.unique(components(cloth.triangles, len(cloth.positions)), return_index=True)[1]
        for body in world.bodies:
            inside = [row for row in firsts if is_inside(cloth.positions[row], body.positions, body.triangles)]
            if inside:
                pieces = "all of it" if len(firsts) == 1 else f"{len(inside)} of its {len(firsts)} pieces"
                where = f"{pieces}, such as vertex {inside[0]}"
                sentences.append(f"{cloth.name} starts inside {body.name}, {where}: contact keeps it in.")
    return sentences


def _wide_activation(world: World, energies: dict[str, Energy]) -> list[str]:
    """Activation distances above the median edge length."""
    starts = world.start()[world.edges]
    edge = float(np.median(np.linalg.norm(starts[:, 0] - starts[:, 1], axis=1)))
    wide = {name: float(getattr(energies.get(name), "d_hat", 0.0)) for name in CONTACTS}
    return [
        f"{name}: d_hat of {d_hat:g} m is more than the median edge of {edge:.2g} m: vertices close at rest "
        "repel each other."
        for name, d_hat in wide.items()
        if d_hat > edge
    ]


def _close_starts(world: World, energies: dict[str, Energy]) -> list[str]:
    """Contact forces at the start: a gap well inside d_hat is no equilibrium, and its energy is released."""
    sentences = []
    for name in CONTACTS:
        d_hat = float(getattr(energies.get(name), "d_hat", 0.0))
        gap = energies[name].minimum_gap(world.start()) if d_hat else np.inf
        if gap < INSIDE * d_hat:
            sentences.append(
                f"{name}: the gap at the start is {gap:.2g} m, inside d_hat of {d_hat:g} m: contact pushes at once."
            )
    return sentences
