"""Check of the add-on within Blender's Python, without a window: an object goes in, its drape comes out.

`BLENDER_PYTHON addons/blender/headless_check.py COMMAND DIR`, where COMMAND starts clothsim in its own environment.
Leaves DIR/scene.blend with the files of the drape beside it, and DIR/seen.npy: the vertices that Blender shows at the
last frame, in space. Prints a line of JSON.
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import clothsim_blender
from clothsim_blender import point_cache


def main(command: str, folder: Path) -> None:
    """Drape a moved and turned grid with a pinned corner over a ball that moves."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    clothsim_blender.register()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, 11, 25
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, segments=32, ring_count=16)
    ball = bpy.context.object
    ball.keyframe_insert("location", frame=1)
    ball.location.x = 0.05
    ball.keyframe_insert("location", frame=11)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=14, y_subdivisions=14, size=1.0, location=(0.02, 0.01, 0.32))
    cloth = bpy.context.object
    cloth.rotation_euler = (0.0, 0.0, 0.4)
    cloth.scale = (0.9, 0.9, 1.0)
    bpy.context.view_layer.update()
    group = cloth.vertex_groups.new(name="held")
    group.add([0], 1.0, "REPLACE")
    cloth.modifiers.new("Smooth", "SUBSURF")
    ball.select_set(True)
    scene.clothsim.command, scene.clothsim.pins, scene.clothsim.moving = command, "held", True
    answer = bpy.ops.clothsim.drape()
    scene.frame_set(11)
    cloth.modifiers["Smooth"].show_viewport = False
    held = cloth.evaluated_get(bpy.context.evaluated_depsgraph_get())
    matrix = np.array(held.matrix_world)
    seen = point_cache.moved(np.array([vertex.co for vertex in held.to_mesh().vertices]), matrix)
    np.save(folder / "seen.npy", seen)
    pinned = point_cache.moved(np.array([cloth.data.vertices[0].co]), matrix)[0]
    report = {
        "answer": sorted(answer),
        "vertices": len(seen),
        "pinned": float(np.abs(seen[0] - pinned).max()),
        "first": cloth.modifiers[0].name,
        "folder": str(Path(cloth.modifiers[0].filepath).parent),
    }
    clothsim_blender.unregister()
    print(json.dumps(report))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
