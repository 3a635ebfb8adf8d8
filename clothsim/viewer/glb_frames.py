"""Coloured meshes as binary glTF."""

import io

import numpy as np
import trimesh

from clothsim.render import vertex_normals
from clothsim.viewer.coloured_frames import ColouredMesh


def as_glb(mesh: ColouredMesh) -> bytes:
    """Binary glTF of a coloured mesh, seen from both sides."""
    colours = np.column_stack([np.round(255 * mesh.colours), np.full(len(mesh.colours), 255)]).astype(np.uint8)
    made = trimesh.Trimesh(
        mesh.positions,
        mesh.triangles,
        vertex_normals=vertex_normals(mesh.positions, mesh.triangles),
        vertex_colors=colours,
        process=False,
    )
    data = io.BytesIO()
    made.export(data, file_type="glb", include_normals=True)
    return data.getvalue()
