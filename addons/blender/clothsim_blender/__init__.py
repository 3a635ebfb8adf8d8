"""Blender add-on of clothsim: drapes the active object on the other selected ones, in a process of its own."""

from pathlib import Path

import bpy
import numpy as np

from . import point_cache
from .process import Simulation
from .scene_files import Mesh, Settings, write_scene

bl_info = {
    "name": "clothsim",
    "author": "The clothsim developers",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "3D View > Sidebar > clothsim",
    "description": "Drape selected cloth with clothsim, free of intersections",
    "category": "Physics",
}

MODIFIER = "clothsim"
FABRICS = ("cotton", "wool", "wool_lycra", "polyester", "denim", "interlock", "rib_knit", "ponte_roma", "swimwear")
LOOK = 0.2
"""Time between two looks at the process [s]."""


class ClothsimSettings(bpy.types.PropertyGroup):
    """Settings of the panel, kept in the file."""

    command: bpy.props.StringProperty(
        name="Command",
        default="clothsim",
        description="clothsim in its own environment: a path, or `python -m clothsim`",
    )
    fabric: bpy.props.EnumProperty(name="Fabric", items=[(name, name, "") for name in FABRICS])
    pins: bpy.props.StringProperty(name="Pinned", description="Vertex group whose vertices are held")
    friction: bpy.props.FloatProperty(name="Friction", default=0.3, min=0.0, max=2.0)
    damping: bpy.props.FloatProperty(name="Damping [1/s]", default=2.0, min=0.0, max=100.0)
    self_contact: bpy.props.BoolProperty(name="Self contact", default=True)
    moving: bpy.props.BoolProperty(name="Bodies move", default=False, description="Use the bodies at every frame")


def world_mesh(thing: bpy.types.Object, depsgraph: bpy.types.Depsgraph, own: bool) -> Mesh:
    """An object's mesh in space; own: without its modifiers, so that the vertices keep their numbers."""
    held = thing if own else thing.evaluated_get(depsgraph)
    mesh = held.data if own else held.to_mesh()
    flat = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", flat)
    matrix = np.array(held.matrix_world)
    faces = [tuple(polygon.vertices) for polygon in mesh.polygons]
    made = Mesh(thing.name, point_cache.moved(flat.reshape(-1, 3), matrix), faces)
    if not own:
        held.to_mesh_clear()
    return made


def body_frames(bodies: list[bpy.types.Object], scene: bpy.types.Scene, moving: bool) -> list[list[Mesh]]:
    """The meshes of each body: of every frame of the scene where they move, else of this one."""
    current = scene.frame_current
    frames: list[list[Mesh]] = [[] for _ in bodies]
    for number in range(scene.frame_start, scene.frame_end + 1) if moving else [current]:
        scene.frame_set(number)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        for kept, body in zip(frames, bodies, strict=True):
            kept.append(world_mesh(body, depsgraph, own=False))
    scene.frame_set(current)
    return frames


def pinned_vertices(cloth: bpy.types.Object, group: str) -> list[int]:
    """Vertices of a vertex group with a weight of at least a half. RuntimeError where there is no such group."""
    if not group:
        return []
    if group not in cloth.vertex_groups:
        raise RuntimeError(f"{cloth.name} has no vertex group {group!r}.")
    number = cloth.vertex_groups[group].index
    return [
        vertex.index
        for vertex in cloth.data.vertices
        if any(entry.group == number and entry.weight >= 0.5 for entry in vertex.groups)
    ]


def folder_of(cloth: bpy.types.Object) -> Path:
    """Directory of the files: beside the .blend file, or Blender's temporary one."""
    base = Path(bpy.path.abspath("//")) if bpy.data.filepath else Path(bpy.app.tempdir)
    return base / "clothsim" / bpy.path.clean_name(cloth.name)


def begin(context: bpy.types.Context) -> Simulation:
    """Write the scene of the selection and start the process. RuntimeError for a selection that is not a scene."""
    cloth, scene = context.active_object, context.scene
    if cloth is None or cloth.type != "MESH" or not len(cloth.data.polygons):
        raise RuntimeError("Make the cloth the active object: a mesh with faces.")
    bodies = [thing for thing in context.selected_objects if thing is not cloth and thing.type == "MESH"]
    asked, rate = scene.clothsim, scene.render.fps / scene.render.fps_base
    frames = scene.frame_end - scene.frame_start
    if frames < 1:
        raise RuntimeError("The scene has one frame: set its end.")
    settings = Settings(
        fabric=asked.fabric,
        duration=frames / rate,
        frames_per_second=rate,
        friction=asked.friction,
        self_contact=asked.self_contact,
        damping=asked.damping,
        pins=pinned_vertices(cloth, asked.pins),
    )
    own = world_mesh(cloth, context.evaluated_depsgraph_get(), own=True)
    file = write_scene(folder_of(cloth), own, body_frames(bodies, scene, asked.moving), settings)
    try:
        return Simulation(asked.command, file)
    except OSError as error:
        raise RuntimeError(f"{asked.command!r} cannot be started ({error}): set the command of clothsim.") from error


def load(cloth: bpy.types.Object, scene: bpy.types.Scene, simulation: Simulation) -> int:
    """Give the cloth the frames of the simulation as a point cache; their number."""
    rate = scene.render.fps / scene.render.fps_base
    frames = point_cache.read_cache(simulation.export(rate))
    if frames.shape[1] != len(cloth.data.vertices):
        raise RuntimeError(f"The simulation has {frames.shape[1]} vertices, {cloth.name} {len(cloth.data.vertices)}.")
    inverse = np.linalg.inv(np.array(cloth.matrix_world))
    point_cache.write_cache(simulation.cache, point_cache.moved(frames, inverse))
    modifier = cloth.modifiers.get(MODIFIER) or cloth.modifiers.new(MODIFIER, "MESH_CACHE")
    modifier.cache_format = "PC2"
    modifier.filepath = str(simulation.cache)
    modifier.frame_start = scene.frame_start
    while cloth.modifiers[0] != modifier:  # before a subdivision, whose vertices are not simulated
        cloth.modifiers.move(cloth.modifiers.find(MODIFIER), 0)
    return len(frames)


class ClothsimDrape(bpy.types.Operator):
    """Drape the active object on the other selected ones."""

    bl_idname = "clothsim.drape"
    bl_label = "Drape"

    def execute(self, context):
        """Simulate and wait: without a window, and in scripts."""
        try:
            simulation = begin(context)
            while simulation.running():
                simulation.wait(LOOK)
            frames = load(context.active_object, context.scene, simulation)
        except (RuntimeError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{frames} frames: {simulation.reason()}")
        return {"FINISHED"}

    def invoke(self, context, event):
        """Simulate while Blender stays responsive; Escape ends it."""
        try:
            self._simulation, self._cloth = begin(context), context.active_object
        except RuntimeError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        manager = context.window_manager
        self._timer = manager.event_timer_add(LOOK, window=context.window)
        manager.progress_begin(0.0, 1.0)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Look at the process."""
        if event.type == "ESC":
            self._simulation.stop()
        if event.type not in {"TIMER", "ESC"}:
            return {"PASS_THROUGH"}
        if self._simulation.running():
            context.window_manager.progress_update(self._simulation.fraction)
            context.workspace.status_text_set(f"clothsim: {self._simulation.message}; Escape ends it")
            return {"RUNNING_MODAL"}
        manager = context.window_manager
        manager.event_timer_remove(self._timer)
        manager.progress_end()
        context.workspace.status_text_set(None)
        try:
            frames = load(self._cloth, context.scene, self._simulation)
        except (RuntimeError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{frames} frames: {self._simulation.reason()}")
        return {"FINISHED"}


class ClothsimPanel(bpy.types.Panel):
    """Panel in the sidebar of the 3D view."""

    bl_idname = "VIEW3D_PT_clothsim"
    bl_label = "clothsim"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "clothsim"

    def draw(self, context):
        """Settings and the button."""
        asked, cloth = context.scene.clothsim, context.active_object
        column = self.layout.column()
        column.label(text=f"Cloth: {cloth.name if cloth else 'none'}")
        others = [thing.name for thing in context.selected_objects if thing is not cloth and thing.type == "MESH"]
        column.label(text=f"Bodies: {', '.join(others) or 'none'}")
        for name in ("fabric", "friction", "damping", "self_contact", "moving"):
            column.prop(asked, name)
        if cloth is not None and cloth.type == "MESH":
            column.prop_search(asked, "pins", cloth, "vertex_groups")
        column.prop(asked, "command")
        column.operator(ClothsimDrape.bl_idname)


CLASSES = (ClothsimSettings, ClothsimDrape, ClothsimPanel)


def register():
    """Add the panel and the operator."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.clothsim = bpy.props.PointerProperty(type=ClothsimSettings)


def unregister():
    """Take them away."""
    del bpy.types.Scene.clothsim
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
