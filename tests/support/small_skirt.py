"""A skirt of two sewn panels about a ball: its pattern, and the scene in which it hangs from its waist."""

import numpy as np
from sewing_patterns import specification, stitch

from clothsim import Cloth, Scene
from clothsim.mesh.weld import mean_of_parts
from clothsim.patterns.pattern_mesh import PatternMesh, mesh_pattern, sewn_vertices
from clothsim.patterns.specification import pattern_of

WAIST, HEM, LENGTH = 24.0, 30.0, 24.0
"""Widths and length of a panel [cm]."""
SPACING = 0.05


def skirt_entries(curved: bool = False):
    """Entries of the pattern; curved: the hem is a cubic Bezier curve."""
    corners = [[-HEM / 2, 0], [HEM / 2, 0], [WAIST / 2, LENGTH], [-WAIST / 2, LENGTH]]

    def panel():
        edges = [{"endpoints": [k, (k + 1) % 4]} for k in range(4)]
        if curved:
            edges[0]["curvature"] = {"type": "cubic", "params": [[1 / 3, 0.0], [2 / 3, 0.0]]}
        return {"translation": [0, 0, 0], "rotation": [0, 0, 0], "vertices": corners, "edges": edges}

    seams = [stitch(("front", 1), ("back", 3)), stitch(("front", 3), ("back", 1))]
    return specification({"front": panel(), "back": panel()}, seams)


def skirt_mesh(curved: bool = False, spacing: float = SPACING) -> PatternMesh:
    return mesh_pattern(pattern_of(skirt_entries(curved)), spacing)


def hanging_skirt(mesh: PatternMesh, rest=None, steps: int = 8, **run) -> Scene:
    """The skirt, sewn, as a cone about a ball; `rest`: other material coordinates."""
    x, y = mesh.panel_coordinates.T
    down = 1 - y / (LENGTH / 100)
    half = (WAIST + (HEM - WAIST) * down) / 200
    angle = np.pi / 2 * np.clip(x / half, -1, 1)
    angle[mesh.vertices["back"]] += np.pi
    radius = 2 * half / np.pi
    positions = np.column_stack([radius * np.sin(angle), -radius * np.cos(angle), -0.235 * down])
    number = sewn_vertices(mesh, mesh.seams)
    top = np.unique(number[y > LENGTH / 100 - 1e-9])
    cloth = Cloth(
        mean_of_parts(positions, number),
        number[mesh.triangles],
        rest=mesh.material_coordinates if rest is None else rest,
        fabric="cotton",
        bending_stiffness=1e-4,
    )
    effects = {
        "inertia": {},
        "membrane": {},
        "bending": {"model": "hinge"},
        "gravity": {},
        "damping": {"rate": 4.0},
        "pins": {"select": top.tolist()},
        "body_contact": {"d_hat": 4e-3, "stiffness": 3e3},
        "friction": {"coefficient": 0.3, "eps_v": 1e-2},
    }
    ball = {"name": "ball", "mesh": "sphere", "radius": 0.077, "subdivisions": 2, "position": [0.0, 0.0, -0.115]}
    solver = {"dt": 0.05, "threads": 1, "linear": "superlu", "tolerance": 1e-3}
    return Scene(cloth, ball, effects, solver, run={"duration": 0.05 * steps, "frames_per_second": 20, **run})
