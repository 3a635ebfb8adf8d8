"""Collapse of panel edges that are too short for the mesh, each with its partner in a seam.

Edges of a millimetre between long ones, which pattern programs leave, would give triangles with angles below 5 degrees.
"""

from dataclasses import replace

import numpy as np

from clothsim.mesh.pattern.pattern import Panel, Pattern, PatternEdge, Side, Stitch

SHORTEST = 0.25
"""Shortest edge that stays, as a fraction of the spacing of the mesh."""
PARTNER = 0.5
"""Longest edge that is collapsed because its partner in a seam is, as a fraction of the spacing."""
FEWEST = 3
"""Edges that a panel keeps."""


def without_slivers(pattern: Pattern, spacing: float) -> Pattern:
    """Copy of a pattern without edges shorter than a quarter of `spacing` [m]; its notes name them."""
    partner = {side: other for stitch in pattern.stitches for side, other in (stitch.sides, stitch.sides[::-1])}
    left = {name: len(panel.edges) for name, panel in pattern.panels.items()}
    collapsed: dict[Side, float] = {}
    for name, panel in pattern.panels.items():
        for number in range(len(panel.edges)):
            side, length = Side(name, number), panel.edge_length(number)
            group = {side, partner.get(side, side)}
            lengths = {each: pattern.panels[each.panel].edge_length(each.edge) for each in group}
            short = length < SHORTEST * spacing and max(lengths.values()) < PARTNER * spacing
            spare = all(left[each.panel] - sum(g.panel == each.panel for g in group) >= FEWEST for each in group)
            if side in collapsed or not short or not spare:
                continue
            collapsed |= lengths
            for each in group:
                left[each.panel] -= 1
    if not collapsed:
        return pattern
    return _collapsed(pattern, collapsed)


def _collapsed(pattern: Pattern, sides: dict[Side, float]) -> Pattern:
    numbers: dict[Side, Side] = {}
    panels = {}
    for name, panel in pattern.panels.items():
        kept = [number for number in range(len(panel.edges)) if Side(name, number) not in sides]
        numbers |= {Side(name, number): Side(name, new) for new, number in enumerate(kept)}
        panels[name] = panel if len(kept) == len(panel.edges) else _without(panel, kept)
    stitches = tuple(
        Stitch(numbers[stitch.first], numbers[stitch.second], stitch.right_wrong)
        for stitch in pattern.stitches
        if stitch.first in numbers
    )
    named = ", ".join(f"{side} ({1e3 * length:.2g} mm)" for side, length in sides.items())
    return replace(pattern, panels=panels, stitches=stitches, notes=(*pattern.notes, f"collapsed: {named}"))


def _without(panel: Panel, kept: list[int]) -> Panel:
    """Panel with the edges `kept`; the ends of each run of the others merge in the middle of them."""
    count = len(panel.edges)
    runs: list[list[int]] = []
    for number in kept:  # the loop from each kept edge to the next one
        run = [panel.edges[number].end]
        while (number := (number + 1) % count) not in kept:
            run.append(panel.edges[number].end)
        runs.append(run)
    vertices = np.array([panel.vertices[run].mean(axis=0) for run in runs])
    edges = tuple(
        PatternEdge((row - 1) % len(kept), row, panel.edges[number].curve, panel.edges[number].label)
        for row, number in enumerate(kept)
    )
    return replace(panel, vertices=vertices, edges=edges)
