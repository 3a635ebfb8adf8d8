"""Lengths that a scene leaves to its mesh or its frames, written out: d_hat and dt."""

from math import ceil

from clothsim.physics.energies.protocols import ContactGap
from clothsim.scene import paths
from clothsim.scene.assembly.scene_world import Built
from clothsim.scene.effects import CONTACTS
from clothsim.scene.scene import Scene


def steps_per_frame(scene: Scene) -> tuple[int, float]:
    """Number of steps a frame of `scene`, and duration of a frame [s]."""
    run = scene.run_settings
    frame = min(1 / run.frames_per_second, run.duration)
    return max(1, ceil(frame / scene.solver_settings.dt - 1e-9)), frame


def fixed(scene: Scene, built: Built) -> Scene:
    """`scene` with what it leaves to the mesh written out, so that a finer mesh changes the mesh alone.

    The d_hat of each contact that is on; dt as the steps that a frame is divided into.
    """
    for name, energy in built.energies.items():
        if isinstance(energy, ContactGap):
            scene = paths.replace(scene, f"effects.{name}.d_hat", float(energy.d_hat))
    if "error" not in scene.solver:
        pieces, frame = steps_per_frame(scene)
        scene = paths.replace(scene, "solver.dt", frame / pieces)
    return paths.replace(scene, "solver.threads", 1)


def d_hats(scene: Scene) -> dict[str, float]:
    """The d_hat of each contact effect that gives a number [m]."""
    values = {name: scene.effects[name].d_hat for name in CONTACTS if name in scene.effects}
    return {name: float(value) for name, value in values.items() if not isinstance(value, str)}
