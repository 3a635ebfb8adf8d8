"""Round trip through Blender: a character rigged and moved there, dressed here, and opened there again.

    python -m tests.benchmarks.blender_character inputs DIR             # here: the mannequin and its joints
    BPY -m tests.benchmarks.blender_character rig DIR                   # a Python with bpy: DIR/character.glb
    clothsim run DIR/scene.toml -o DIR/run
    clothsim export DIR/run -o DIR/dressed.glb (or .usdc, .pc2)
    BPY -m tests.benchmarks.blender_character open DIR                  # figures of what Blender reads, and a still
    python -m tests.benchmarks.blender_character compare DIR            # here: against the frames of the run

BPY is the Python of an environment of its own with `pip install bpy numpy`; the module runs from a clone.
"""

import json
import sys
from pathlib import Path

import numpy as np

BONES = {
    "hips": ("pelvis", "spine"), "spine": ("spine", "chest"), "chest": ("chest", "neck"), "head": ("neck", "head"),
    "upper_arm.L": ("left_shoulder", "left_elbow"), "forearm.L": ("left_elbow", "left_wrist"),
    "upper_arm.R": ("right_shoulder", "right_elbow"), "forearm.R": ("right_elbow", "right_wrist"),
    "thigh.L": ("left_hip", "left_knee"), "shin.L": ("left_knee", "left_ankle"),
    "thigh.R": ("right_hip", "right_knee"), "shin.R": ("right_knee", "right_ankle"),
}  # fmt: skip
"""Head and tail of each bone, by the mannequin's joints."""
PARENTS = {
    "spine": "hips", "chest": "spine", "head": "chest", "upper_arm.L": "chest", "forearm.L": "upper_arm.L",
    "upper_arm.R": "chest", "forearm.R": "upper_arm.R", "thigh.L": "hips", "shin.L": "thigh.L", "thigh.R": "hips",
    "shin.R": "thigh.R",
}  # fmt: skip
FRAMES, RATE = 24, 24
TURNS = {
    "spine": (0, 18, 0), "chest": (0, 12, 0), "upper_arm.L": (20, 0, 15), "forearm.L": (25, 0, 0),
    "upper_arm.R": (-15, 0, -10), "thigh.R": (-25, 0, 0), "shin.R": (35, 0, 0),
}  # fmt: skip
"""Euler angles of the bones in their own axes at the middle of the action [degrees]."""
SCENE = """\
[cloth]
name = "shirt"
mesh = "shirt"
ease = 0.02
edge = 0.035
fabric = "cotton"
[[body]]
name = "character"
model = "character.glb"
motion = { clip = "own", lead_in = 0.0 }
[effects.inertia]
[effects.membrane]
[effects.bending]
[effects.gravity]
[effects.damping]
rate = 3.0
[effects.body_contact]
[effects.self_contact]
[effects.friction]
coefficient = 0.3
[solver]
dt = 0.0208333333333333
[contact]
pinch = "carry"
[run]
duration = 1.0
frames_per_second = 24
"""


def inputs(directory: Path) -> None:
    """Write the mannequin as OBJ, its joints and the scene."""
    from clothsim.files.characters.known_bodies import mannequin_character
    from clothsim.files.meshes.obj_writer import write_obj

    directory.mkdir(parents=True, exist_ok=True)
    character = mannequin_character()
    write_obj(directory / "body.obj", character.positions, character.triangles)
    joints = dict(zip(character.skeleton.names, character.skeleton.rest_positions().tolist(), strict=True))
    (directory / "joints.json").write_text(json.dumps(joints))
    (directory / "scene.toml").write_text(SCENE)


def rig(directory: Path) -> None:
    """Build an armature in Blender, bind the body by automatic weights, key an action and write GLB."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.obj_import(filepath=str(directory / "body.obj"), forward_axis="Y", up_axis="Z")
    body = bpy.context.selected_objects[0]
    joints = json.loads((directory / "joints.json").read_text())
    armature = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    bpy.context.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for name, (head, tail) in BONES.items():
        bone = armature.data.edit_bones.new(name)
        bone.head, bone.tail = joints[head], joints[tail]
        if name in PARENTS:
            bone.parent = armature.data.edit_bones[PARENTS[name]]
    bpy.ops.object.mode_set(mode="OBJECT")
    body.select_set(True)
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")
    bpy.context.view_layer.objects.active = body
    bpy.ops.object.vertex_group_limit_total(limit=4)  # as glTF has them
    bpy.ops.object.vertex_group_normalize_all(lock_active=False)
    bpy.context.scene.render.fps = RATE
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 0, FRAMES
    for name, turn in TURNS.items():
        bone = armature.pose.bones[name]
        bone.rotation_mode = "XYZ"
        for frame, part in ((0, 0.0), (FRAMES // 2, 1.0), (FRAMES, 0.0)):
            bone.rotation_euler = np.radians(turn) * part
            bone.keyframe_insert("rotation_euler", frame=frame)
    armature.animation_data.action.name = "turn and step"
    bpy.ops.export_scene.gltf(filepath=str(directory / "character.glb"), export_animations=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(directory / "character.blend"))
    np.savez(directory / "posed_there.npz", **{f"frame{k}": evaluated(body, k) for k in (0, 6, 12, 18, 24)})
    weights = [len(vertex.groups) for vertex in body.data.vertices]
    print(f"{len(weights)} vertices, {min(weights)} to {max(weights)} bones each, bpy {bpy.app.version_string}")


def evaluated(thing, frame: int, steps: float = 0.0) -> np.ndarray:
    """World positions of an object's evaluated mesh at a frame."""
    import bpy

    bpy.context.scene.frame_set(frame, subframe=steps)
    mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    points = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", points)
    matrix = np.array(thing.matrix_world)
    return points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def opened(directory: Path) -> None:
    """Read the dressed frames into the scene of the character, keep their positions, and render a still."""
    import bpy

    for file in sorted(directory.glob("dressed.*")):
        if file.suffix not in (".glb", ".usdc"):
            continue
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.context.scene.render.fps = RATE
        if file.suffix == ".glb":
            bpy.ops.import_scene.gltf(filepath=str(file))
        else:
            bpy.ops.wm.usd_import(filepath=str(file))
        meshes = [thing for thing in bpy.context.scene.objects if thing.type == "MESH"]
        found = {f"{mesh.name}.{k}": evaluated(mesh, k) for mesh in meshes for k in (0, 6, 12, 18, 24)}
        np.savez(directory / f"opened_{file.suffix[1:]}.npz", **found)
        print(file.name, {mesh.name: len(mesh.data.vertices) for mesh in meshes})
        _still(directory / f"opened_{file.suffix[1:]}.png", meshes)


def _still(path: Path, meshes) -> None:
    import bpy

    scene = bpy.context.scene
    scene.frame_set(12)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location, camera.rotation_euler = (1.6, -3.6, 1.3), (np.radians(86), 0, np.radians(24))
    light = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    light.rotation_euler, light.data.energy = (0.7, 0.3, 0.4), 3.0
    for thing in (camera, light):
        scene.collection.objects.link(thing)
    scene.camera, scene.render.engine, scene.cycles.samples = camera, "CYCLES", 12
    scene.world = bpy.data.worlds.new("world")
    scene.world.color = (0.6, 0.6, 0.6)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.filepath = 480, 640, str(path)
    for mesh in meshes:
        material = bpy.data.materials.new(mesh.name)
        material.use_nodes = True
        colour = (0.2, 0.35, 0.6, 1) if "shirt" in mesh.name else (0.7, 0.6, 0.5, 1)
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = colour
        mesh.data.materials.clear()
        mesh.data.materials.append(material)
    bpy.ops.render.render(write_still=True)


def compare(directory: Path) -> None:
    """Print how far the positions there are from those here."""
    from scipy.spatial import cKDTree

    from clothsim.run.results import open_run

    run = open_run(directory / "run")
    there = np.load(directory / "posed_there.npz")
    off = [cKDTree(next(iter(run[k].bodies.values()))).query(there[f"frame{k}"])[0].max() for k in (0, 6, 12, 18, 24)]
    print(f"body posed there against here: {1e3 * max(off):.2g} mm")
    for file in sorted(directory.glob("opened_*.npz")):
        found = np.load(file)
        for name in {key.rsplit(".", 1)[0] for key in found}:
            here = [{**run[k].positions, **run[k].bodies} for k in (0, 6, 12, 18, 24)]
            own = next(key for key in here[0] if key in name)
            off = [
                cKDTree(points[own]).query(found[f"{name}.{k}"])[0].max()
                for points, k in zip(here, (0, 6, 12, 18, 24), strict=True)
            ]
            print(f"{file.name}: {name}: {[f'{1e3 * o:.2g} mm' for o in off]}")


if __name__ == "__main__":
    {"inputs": inputs, "rig": rig, "open": opened, "compare": compare}[sys.argv[1]](Path(sys.argv[2]))
