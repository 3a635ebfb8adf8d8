"""Blender's cloth modifier (bpy): springs with the numbers of its preset "Cotton", collision and self collision."""

import math

import numpy as np

from tests.benchmarks.peers.peer_scene import PeerScene, Simulation

PACKAGE, PIP = "bpy", "bpy"
CANNOT = "springs, whose stiffness is no modulus; masses by vertex; distances of contact of 15 mm, its defaults"
FRAME = math.sqrt(1e-3)
"""Time of a frame at `time_scale` 1, from a free fall [s]: it does not depend on the frame rate."""
QUALITY, COLLISION_QUALITY = 5, 2
"""Steps of a frame, and rounds of collisions: those of the preset, and Blender's default."""
COTTON = {
    "mass": 0.3, "air_damping": 1.0, "tension_stiffness": 15.0, "compression_stiffness": 15.0,
    "shear_stiffness": 15.0, "bending_stiffness": 0.5, "tension_damping": 5.0, "compression_damping": 5.0,
    "shear_damping": 5.0, "bending_damping": 0.5,
}  # fmt: skip
"""The preset "Cotton"; the mass is that of a vertex [kg]: with the sheet's own the drag of its preset holds it up."""


def build(scene: PeerScene, quality: int = QUALITY) -> Simulation:
    """The sheet with the modifier and the ball with a collision modifier; a frame is a step."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    world = bpy.context.scene
    world.render.fps, world.render.fps_base = round(1.0 / scene.dt), 1.0
    world.render.threads_mode, world.render.threads = "FIXED", 1
    world.frame_start, world.frame_end = 1, scene.steps + 1
    ball = _added(bpy, "ball", scene.ball_positions, scene.ball_triangles)
    ball.modifiers.new("Collision", "COLLISION")
    ball.collision.cloth_friction = scene.friction
    sheet = _added(bpy, "sheet", scene.positions, scene.triangles)
    cloth = sheet.modifiers.new("Cloth", "CLOTH")
    for name, value in COTTON.items():
        setattr(cloth.settings, name, value)
    cloth.settings.quality, cloth.settings.time_scale = quality, scene.dt / FRAME
    touch = cloth.collision_settings
    touch.use_collision, touch.use_self_collision, touch.collision_quality = True, True, COLLISION_QUALITY
    touch.friction, touch.self_friction = scene.friction, scene.friction
    cloth.point_cache.frame_start, cloth.point_cache.frame_end = 1, scene.steps + 1
    world.frame_set(1)

    def step() -> None:
        world.frame_set(world.frame_current + 1)

    def positions() -> np.ndarray:
        mesh = sheet.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        x = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", x)
        return x.reshape(-1, 3)

    return Simulation(step, positions, f"preset Cotton, quality {quality} a frame of {scene.dt} s, one thread")


def _added(bpy, name, positions, triangles):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(positions.tolist(), [], triangles.tolist())
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made
