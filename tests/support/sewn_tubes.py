"""Skirts of two panels bent to a cylinder, sewn."""

from dataclasses import replace

import numpy as np
from sewing_patterns import panel, specification, stitch

from clothsim.garments.dress.sewing_state import as_placed
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of


def tube(radius: float, low: float, high: float, panels: dict | None = None):
    """State of a skirt of two panels, bent to a cylinder round the axis of y."""
    half = 100 * np.pi * radius
    front = [[0, 0], [half, 0], [half, 100 * (high - low)], [0, 100 * (high - low)]]
    entries = specification(
        {"front": panel(front), "back": panel(front), **(panels or {})},
        [stitch(("front", 1), ("back", 3)), stitch(("front", 3), ("back", 1))],
    )
    mesh = mesh_pattern(pattern_of(entries), 0.04)
    positions = mesh.positions.copy()
    for name, turn in (("front", 0.0), ("back", np.pi)):
        x, y = mesh.panel_coordinates[mesh.vertices[name]].T
        angle = x / radius + turn
        positions[mesh.vertices[name]] = np.column_stack([radius * np.sin(angle), low + y, radius * np.cos(angle)])
    state = as_placed(replace(mesh, positions=positions))
    return state.weld([0, 1])
