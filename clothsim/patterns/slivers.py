"""Collapse of panel edges that are too short for the mesh, each with its partner in a seam.

Edges of a millimetre between long ones, which pattern programs leave, would give triangles with angles below 5 degrees.
"""

from dataclasses import replace

import numpy as np

from clothsim.patterns.pattern import Panel, Pattern, PatternEdge, Side, Stitch

SHORTEST = 0.25
"""Shortest edge that stays, as a fraction of the spacing of the mesh."""
PARTNER = 0.5
"""Longest edge that is collapsed because its partner in a seam is, as a fraction of the spacing."""
SHARE = 0.05
"""Longest edge that is collapsed, as a fraction of the perimeter of its panel: a coarse mesh keeps a small panel."""
FEWEST = 3
"""Edges that a panel keeps."""


def without_slivers(pattern: Pattern, spacing: float) -> Pattern:
    """Copy of a pattern without edges shorter than a quarter of `spacing` [m]; its notes name them.

    Of a run of short edges, such as a curve given as a polyline, edges stay so that no part that is lost is longer.
    """
    partner = {side: other for stitch in pattern.stitches for side, other in (stitch.sides, stitch.sides[::-1])}
    left = {name: len(panel.edges) for name, panel in pattern.panels.items()}
    lengths = {
        Side(name, number): panel.edge_length(number)
        for name, panel in pattern.panels.items()
        for number in range(len(panel.edges))
    }
    perimeters: dict[str, float] = dict.fromkeys(pattern.panels, 0.0)
    for side, length in lengths.items():
        perimeters[side.panel] += length
    collapsed: dict[Side, float] = {}
    for side, length in lengths.items():
        group = {side, partner.get(side, side)}
        short = length < SHORTEST * spacing and max(lengths[each] for each in group) < PARTNER * spacing
        short = short and all(lengths[each] < SHARE * perimeters[each.panel] for each in group)
        spare = all(left[each.panel] - sum(g.panel == each.panel for g in group) >= FEWEST for each in group)
        if side in collapsed or not short or not spare:
            continue
        collapsed |= {each: lengths[each] for each in group}
        if any(_run(each, collapsed, len(pattern.panels[each.panel].edges)) > PARTNER * spacing for each in group):
            for each in group:
                del collapsed[each]
            continue
        for each in group:
            left[each.panel] -= 1
    if not collapsed:
        return pattern
    return _collapsed(pattern, collapsed)


def _run(side: Side, lengths: dict[Side, float], count: int) -> float:
    """Length of the run of edges in `lengths` that `side` is in, of a panel of `count` edges [m]."""
    total = lengths[side]
    for step in (1, -1):
        number = (side.edge + step) % count
        while number != side.edge and Side(side.panel, number) in lengths:
            total += lengths[Side(side.panel, number)]
            number = (number + step) % count
    return total


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
    count, staying = len(panel.edges), set(kept)
    runs: list[list[int]] = []
    for number in kept:  # the loop from each kept edge to the next one
        run = [panel.edges[number].end]
        while (number := (number + 1) % count) not in staying:
            run.append(panel.edges[number].end)
        runs.append(run)
    vertices = np.array([panel.vertices[run].mean(axis=0) for run in runs])
    edges = tuple(
        PatternEdge((row - 1) % len(kept), row, panel.edges[number].curve, panel.edges[number].label)
        for row, number in enumerate(kept)
    )
    return replace(panel, vertices=vertices, edges=edges)
