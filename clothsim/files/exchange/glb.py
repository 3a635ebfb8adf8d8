"""Binary glTF 2.0 (.glb) with a morph target for each frame but the first.

A node and a mesh a surface. Frame 0 is the mesh, each later frame a morph target of displacements from it and of
changes of the normals, whose weight is 1 at the time of the frame and 0 at all others, linear between them. Colours
are those of the last frame: readers agree on none that change.
Vertices are split where texture coordinates differ: the first n rows are the vertices of the run in their order, the
copies follow. Panels are primitives of one mesh, which share its vertices, with a material each.
Source: Khronos Group, glTF 2.0 specification, 3.7.2.2 (morph targets), 3.6.1 and appendix C (animation).
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.safe_files.atomic import write_atomically
from clothsim.files.exchange.animation import Animation, Part, PartFrame, linear_rgb, split_vertices
from clothsim.files.exchange.glb_buffer import GlbBuffer

MOST_TARGETS = 4_000
"""Largest number of morph targets: the weights grow with its square."""
CLOTH_COLOUR, BODY_COLOUR = (0.8, 0.8, 0.8, 1.0), (0.5, 0.5, 0.5, 1.0)


def files(animation: Animation, target: Path) -> list[Path]:
    """One file."""
    return [target]


def write(animation: Animation, target: Path) -> None:
    """Write the file. InputError where it would have too many morph targets or bytes."""
    frames = len(animation.times)
    if frames - 1 > MOST_TARGETS and any(part.moving for part in animation.parts):
        raise InputError(
            f"{frames:,} frames are more morph targets than a glTF file should have ({MOST_TARGETS:,}).",
            "Take fewer by --fps, or export USD or a point cache.",
        )
    write_atomically(target, glb_bytes(animation))


def glb_bytes(animation: Animation) -> bytes:
    """The content of the file."""
    buffer, bases, last = GlbBuffer(), animation.at(0), animation.at(len(animation.times) - 1)
    splits = [split_vertices(part, len(base.points)) for part, base in zip(animation.parts, bases, strict=True)]
    meshes = [
        _base(buffer, part, replace(base, colours=end.colours), split)
        for part, base, end, split in zip(animation.parts, bases, last, splits, strict=True)
    ]
    moving = [number for number, part in enumerate(animation.parts) if part.moving and len(animation.times) > 1]
    for k in range(1, len(animation.times)):
        shapes = animation.at(k)
        for number in moving:
            target = _target(buffer, bases[number], shapes[number], splits[number][0])
            for primitive in meshes[number]["primitives"]:
                primitive.setdefault("targets", []).append(target)
    return buffer.glb(_document(animation, meshes, _animation(buffer, animation, meshes, moving)))


def _base(buffer: GlbBuffer, part: Part, shape: PartFrame, split: tuple[Ints, Ints, Floats]) -> dict[str, Any]:
    """The mesh of a part in the first frame."""
    vertices, triangles, texture = split
    attributes = {
        "POSITION": buffer.floats(shape.points[vertices], bounds=True),
        "NORMAL": buffer.floats(shape.normals[vertices]),
    }
    if len(texture):
        attributes["TEXCOORD_0"] = buffer.floats(texture * [1.0, -1.0] + [0.0, 1.0])  # v counts from the top
    if len(shape.colours):
        attributes["COLOR_0"] = buffer.colours(linear_rgb(shape.colours[vertices]))
    return {
        "name": part.name,
        "primitives": [
            {"attributes": attributes, "indices": buffer.indices(triangles[faces]), "panel": name}
            for name, faces in panels(part).items()
        ],
    }


def panels(part: Part) -> dict[str, Ints]:
    """Triangles of each primitive by name: the panels, each triangle in its first, and the rest under the part's."""
    free, found = np.ones(len(part.triangles), bool), {}
    for name, own in part.groups.items():
        rows = own[free[own]]
        free[rows] = False
        if len(rows):
            found[name] = rows
    rest = np.flatnonzero(free)
    return {**found, **({part.name: rest} if len(rest) else {})}


def _target(buffer: GlbBuffer, base: PartFrame, shape: PartFrame, vertices: Ints) -> dict[str, int]:
    """A morph target: what `shape` differs by from the base as it is stored."""
    stored = base.points.astype(np.float32).astype(np.float64)
    return {
        "POSITION": buffer.floats((shape.points - stored)[vertices], bounds=True),
        "NORMAL": buffer.floats((shape.normals - base.normals)[vertices]),
    }


def _animation(
    buffer: GlbBuffer, animation: Animation, meshes: list[dict[str, Any]], moving: list[int]
) -> list[dict[str, Any]]:
    """The animation of the weights, which all moving parts share."""
    count = len(animation.times)
    if not moving:
        return []
    weights = np.eye(count)[:, 1:]
    for number in moving:
        meshes[number]["weights"] = [0.0] * (count - 1)
    times = buffer.floats((animation.times - animation.times[0])[:, None], bounds=True)
    sampler = {"input": times, "output": buffer.floats(weights.reshape(-1, 1)), "interpolation": "LINEAR"}
    channels = [{"sampler": 0, "target": {"node": number, "path": "weights"}} for number in moving]
    return [{"name": "cloth", "samplers": [sampler], "channels": channels}]


def _document(animation: Animation, meshes: list[dict[str, Any]], moves: list[dict[str, Any]]) -> dict[str, Any]:
    """All of the JSON but for buffers; takes the names of the panels out of the primitives."""
    materials: list[dict[str, Any]] = []
    for part, mesh in zip(animation.parts, meshes, strict=True):
        colour = CLOTH_COLOUR if part.role == "cloth" else BODY_COLOUR
        coloured = "COLOR_0" in mesh["primitives"][0]["attributes"]
        for primitive in mesh["primitives"]:
            primitive["material"] = len(materials)
            surface = {"baseColorFactor": [1.0] * 4 if coloured else list(colour), "metallicFactor": 0.0}
            materials.append(
                {
                    "name": primitive.pop("panel"),
                    "doubleSided": part.role == "cloth",
                    "pbrMetallicRoughness": {**surface, "roughnessFactor": 0.9},
                }
            )
    origin = [float(x) for x in animation.origin]
    place = {"translation": origin} if any(origin) else {}
    nodes = [{"name": part.name, "mesh": number, **place} for number, part in enumerate(animation.parts)]
    return {
        "asset": {"version": "2.0", "generator": "clothsim"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        **({"animations": moves} if moves else {}),
    }
