"""Borders of panels: samples of their edges by arc length, equally many on both sides of a seam; self-crossing ones.

Edges that are too short for the mesh are collapsed first, each with its partner in a seam: edges of a millimetre
between long ones, which pattern programs leave, would give triangles with angles below 5 degrees.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.patterns.pattern import Panel, Pattern, PatternEdge, Side, Stitch

# Finer samples where a panel is much narrower than the spacing of the mesh, on both sides of each seam there.

NARROW = 2.5
"""Length of a segment of the border from which on it is divided, as a multiple of the width of the panel there."""
LENGTH = 1.5
"""Length of its parts, as a multiple of the width."""
MOST = 6
"""Bound on the parts of a segment."""
SHORTEST = 1e-100
"""Length of a segment without one: what is wrong with it is said where it is meshed [m]."""
BLOCK = 2**20
"""Largest number of pairs of segments, or of sides, that are held at once."""
WAY = 15.0
"""Way along the border to what faces a point, as a multiple of the width: less is a corner, not a neck."""


def with_necks(pattern: Pattern, fractions: Mapping[Side, Floats]) -> dict[Side, Floats]:
    """Fractions of arc length of the samples of each edge, finer at necks; edges far from any neck stay as they are."""
    parts = {side: np.ones(len(rows) - 1, np.int64) for side, rows in fractions.items()}
    for panel in pattern.panels.values():
        parts |= _count_parts(panel, fractions)
    for stitch in pattern.stitches:
        order = slice(None, None, 1 if stitch.right_wrong else -1)
        most = np.maximum(parts[stitch.first], parts[stitch.second][order])
        parts[stitch.first], parts[stitch.second] = most, most[order]
    divided = {}
    for side, rows in fractions.items():  # each gap evenly
        inner = [a + (b - a) * np.arange(k) / k for a, b, k in zip(rows, rows[1:], parts[side], strict=False)]
        divided[side] = np.concatenate([*inner, rows[-1:]]) if parts[side].max() > 1 else rows
    return divided


def _count_parts(panel: Panel, fractions: Mapping[Side, Floats]) -> dict[Side, Ints]:
    """Number of parts of each segment of the edges of a panel."""
    edges = [panel.edge_points(k, fractions[Side(panel.name, k)]) for k in range(len(panel.edges))]
    start = np.concatenate([points[:-1] for points in edges])
    side = np.concatenate([np.diff(points, axis=0) for points in edges])
    lengths = np.maximum(np.linalg.norm(side, axis=1), SHORTEST)
    # distance from the middle of each segment of the loop to the nearest one that faces it, (k,) [m]; inf for none
    middle, ends = start + side / 2, np.cumsum(lengths)
    found = []
    block = max(1, BLOCK // len(start))
    for first in range(0, len(start), block):
        rows = slice(first, first + block)
        offset = middle[rows, None] - start
        along = np.clip((offset * side).sum(axis=2) / lengths**2, 0, 1)
        distance = np.linalg.norm(offset - along[:, :, None] * side, axis=2)
        way = np.abs((ends - lengths / 2)[rows, None] - (ends - (1 - along) * lengths))
        way = np.minimum(way, ends[-1] - way)
        facing = way > WAY * distance
        facing[np.arange(len(facing)), first + np.arange(len(facing))] = False
        found.append(np.where(facing, distance, np.inf).min(axis=1))
    width = np.maximum(np.concatenate(found), lengths / (LENGTH * MOST))
    parts = np.where(lengths > NARROW * width, np.ceil(lengths / (LENGTH * width) - 1e-9), 1).astype(np.int64)
    pieces = np.split(parts, np.cumsum([len(points) - 1 for points in edges])[:-1])
    return {Side(panel.name, k): piece for k, piece in enumerate(pieces)}


@dataclass(frozen=True)
class Border:
    """Sampled loop of a panel.

    Attributes
    ----------
    points : (k, 2) array
        Samples in the order of the loop [m].
    starts : (e + 1,) int array
        Sample at which each edge starts; the last entry is k.
    fractions : tuple of (k,) array
        Of each edge, the fractions of its arc length at which its samples are, from 0 to 1.
    graded : bool
        True where some segments are divided at a neck.
    """

    points: Floats
    starts: Ints
    fractions: tuple[Floats, ...]
    graded: bool = False

    def along(self, edge: int) -> Ints:
        """Samples of an edge from its start to its end."""
        return np.arange(self.starts[edge], self.starts[edge + 1] + 1) % len(self.points)

    @property
    def counter_clockwise(self) -> bool:
        """True where the loop encloses a positive area."""
        return enclosed_area(self.points) > 0


def enclosed_area(points: Floats) -> float:
    """Area inside a closed polygon (k, 2) [m2], positive counter-clockwise."""
    following = np.roll(points, -1, axis=0)
    return float((points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]).sum() / 2)


def segments(pattern: Pattern, spacing: float) -> dict[Side, int]:
    """Number of segments of each edge: segments of a length of at most `spacing` [m] on the longer side of a seam."""
    counts = {
        Side(name, number): max(1, int(np.ceil(panel.edge_length(number) / spacing - 1e-9)))
        for name, panel in pattern.panels.items()
        for number in range(len(panel.edges))
    }
    for stitch in pattern.stitches:
        counts[stitch.first] = counts[stitch.second] = max(counts[side] for side in stitch.sides)
    return counts


def borders(pattern: Pattern, spacing: float) -> dict[str, Border]:
    """Border of each panel, with the segments of `segments`, which are divided at necks."""
    even = {side: np.arange(count + 1) / count for side, count in segments(pattern, spacing).items()}
    fractions = with_necks(pattern, even)
    return {name: _border(panel, fractions, even) for name, panel in pattern.panels.items()}


def _border(panel: Panel, fractions: Mapping[Side, Floats], even: Mapping[Side, Floats]) -> Border:
    sides = [Side(panel.name, number) for number in range(len(panel.edges))]
    rows = tuple(fractions[side] for side in sides)
    points = [panel.edge_points(side.edge, row[:-1]) for side, row in zip(sides, rows, strict=True)]
    starts = np.cumsum([0, *(len(row) - 1 for row in rows)])
    graded = any(len(row) > len(even[side]) for side, row in zip(sides, rows, strict=True))
    return Border(np.concatenate(points), starts, rows, graded)


THINNEST = 1e-6
"""Area of a panel below which it has none, as a fraction of its squared perimeter: a strip of 1 m by 4 micrometres."""


def refuse_self_crossing(panel: Panel, border: Border) -> None:
    """InputError for a border that crosses or touches itself, with the two edges and the place, or encloses no area."""
    crossing = crossing_sides(border.points)
    if not len(crossing):
        perimeter = np.linalg.norm(np.diff(border.points, axis=0, append=border.points[:1]), axis=1).sum()
        if abs(enclosed_area(border.points)) < THINNEST * perimeter**2:
            raise InputError(f"Panel {panel.name} has no area: its edges lie on one line.", "Move a vertex of it.")
        return
    first, second = crossing[0]
    edges = np.searchsorted(border.starts, [first, second], side="right") - 1
    x, y = border.points[first]
    where = f"edges {edges[0]} and {edges[1]} meet" if edges[0] != edges[1] else f"edge {edges[0]} meets itself"
    raise InputError(
        f"Panel {panel.name} crosses itself: {where} near ({x:.3g}, {y:.3g}) m.",
        "Move a vertex or a control point of one of them.",
    )


MENDED = 2.5e-3
"""Largest displacement of a sample that mends a border [m]."""
BRIDGE = 1e-3
"""Width of the cloth that is left between a mended corner and an edge [m]."""
OPENING = np.radians(2.5)
"""Angle that is left between two edges at a corner where they would cross beside it [rad]."""
MENDINGS = 4
"""Bound on the places of a panel that are mended."""


def mended(panel: Panel, border: Border) -> tuple[Border, str]:
    """Border without crossings of a millimetre, and a note on what moved; as it is, with "", where that is not enough.

    Pattern programs draw darts and slits a fraction of a millimetre past the edge that they end at, and necklines that
    leave their corner just outside the shoulder. The corner is drawn back, or the curve is bent inside.
    """
    points, crossed = border.points, []
    for _ in range(MENDINGS):
        crossing = crossing_sides(points)
        if not len(crossing):
            break
        sides = crossing[0]
        edges = np.searchsorted(border.starts, sides, side="right") - 1
        apart = (edges[1] - edges[0]) % len(panel.edges)
        beside = apart in (1, len(panel.edges) - 1)
        moved = _opened(panel, border, points, edges, sides) if beside else _drawn_back(border, points, sides)
        largest = float(np.linalg.norm(moved - points, axis=1).max())
        if not 0 < largest <= MENDED:
            return border, ""
        points = moved
        crossed.append(f"edges {edges[0]} and {edges[1]} by {1e3 * largest:.1g} mm")
    if not crossed or len(crossing_sides(points)):
        return border, ""
    return replace(border, points=points), f"{panel.name} crossed itself and was mended: {', '.join(crossed)}"


def _opened(panel: Panel, border: Border, points: Floats, edges: Ints, sides: Ints) -> Floats:
    """Samples of which those of the more curved of two neighbouring edges are bent away from the other's line."""
    first, second = (int(edge) for edge in (edges if (edges[1] - edges[0]) == 1 else edges[::-1]))
    before, after = border.along(first)[::-1], border.along(second)  # both from their common corner
    bows = [_bow(points[rows]) for rows in (before, after)]
    line, curve = (after, before) if bows[0] > bows[1] else (before, after)
    corner = points[line[0]]
    along = points[line[-1]] - corner
    along = along / np.linalg.norm(along)
    offset = points[curve] - corner
    reach = offset @ along
    beyond = offset @ np.array([-along[1], along[0]])
    inner = np.sign(beyond[np.argmax(np.abs(beyond))])
    until = np.flatnonzero((beyond * inner > 0) & (np.abs(beyond) > np.tan(OPENING) * np.abs(reach)))
    near = np.arange(1, until[0] if len(until) else 1)
    lack = np.tan(OPENING) * np.abs(reach[near]) - inner * beyond[near]
    moved = points.copy()
    moved[curve[near]] += (inner * np.maximum(lack, 0.0))[:, None] * np.array([-along[1], along[0]])
    return moved


def _bow(points: Floats) -> float:
    """Largest distance of points (k, 2) from their chord [m]."""
    chord = points[-1] - points[0]
    offset = points - points[0]
    return float(np.abs(chord[0] * offset[:, 1] - chord[1] * offset[:, 0]).max() / np.linalg.norm(chord))


def _drawn_back(border: Border, points: Floats, sides: Ints) -> Floats:
    """Samples of which the corner that reached across another edge is drawn back inside, by BRIDGE."""
    count, moved = len(points), points.copy()
    found: list[tuple[float, int, Floats]] = []
    for own, other in (sides, sides[::-1]):
        a, b = points[other], points[(other + 1) % count]
        normal = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
        for row in (own, (own + 1) % count):
            if row not in border.starts or row in (other, (other + 1) % count):
                continue
            behind = points[[row - 1, (row + 1) % count]].mean(axis=0)  # the neighbours are on the side that it left
            inner = np.sign((behind - a) @ normal)
            found.append((BRIDGE - inner * float((points[row] - a) @ normal), int(row), inner * normal))
    if found:
        lack, row, direction = min(found, key=lambda each: abs(each[0]))
        moved[row] += max(lack, 0.0) * direction
    return moved


def crossing_sides(points: Floats) -> Ints:
    """Pairs (k, 2) of sides of a closed polygon that meet although they are not neighbours.

    Neighbours that fold back onto each other are found as well. A side runs from the point of its number to the next.
    Sides are swept along x, BLOCK pairs at a time; the first block with a crossing ends the search.
    """
    count = len(points)
    following = np.roll(points, -1, axis=0)
    low, high = np.minimum(points, following), np.maximum(points, following)
    order = np.argsort(low[:, 0], kind="stable")
    ends = np.searchsorted(low[order, 0], high[order, 0], side="right")  # sides that begin before this one ends
    partners = np.maximum(ends - np.arange(count) - 1, 0)
    total = np.concatenate([[0], np.cumsum(partners)])
    for begin in range(0, int(total[-1]), BLOCK):
        row = np.arange(begin, min(begin + BLOCK, int(total[-1])))
        own = np.searchsorted(total, row, side="right") - 1
        pairs = np.sort(np.column_stack([order[own], order[own + 1 + row - total[own]]]), axis=1)
        first, second = pairs.T
        beside = (low[first, 1] <= high[second, 1]) & (low[second, 1] <= high[first, 1])
        found = _crossing(points, following, pairs[beside])
        if len(found):
            return found[np.lexsort(found.T[::-1])]
    return np.zeros((0, 2), np.int64)


def _crossing(points: Floats, following: Floats, pairs: Ints) -> Ints:
    """Those of the pairs (k, 2) of sides that meet away from a common vertex, or fold onto each other."""
    count = len(points)
    first, second = pairs.T
    beside = (second - first == 1) | ((first == 0) & (second == count - 1))
    a, b, c, d = points[first], following[first], points[second], following[second]
    sides = np.array([_turn(a, b, c), _turn(a, b, d), _turn(c, d, a), _turn(c, d, b)])
    proper = (sides[0] * sides[1] < 0) & (sides[2] * sides[3] < 0)
    touching = _on(a, b, c, sides[0]) | _on(a, b, d, sides[1]) | _on(c, d, a, sides[2]) | _on(c, d, b, sides[3])
    ahead = (second - first == 1)[:, None]  # of neighbours the common vertex is b, else, at the end of the loop, a
    common = np.where(ahead, b, a)
    u, v = np.where(ahead, a, b) - common, np.where(ahead, d, c) - common
    folded = beside & (u[:, 0] * v[:, 1] == u[:, 1] * v[:, 0]) & ((u * v).sum(axis=1) > 0)
    return np.asarray(pairs[(~beside & (proper | touching)) | folded], np.int64)


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    """Twice the signed area of the triangles a b c, (k,)."""
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])


def _on(a: Floats, b: Floats, c: Floats, turn: Floats) -> np.ndarray:
    """Mask (k,) of the points c that lie on the segment a b."""
    return (turn == 0) & (np.minimum(a, b) <= c).all(axis=1) & (c <= np.maximum(a, b)).all(axis=1)


SHORTEST_EDGE = 0.25
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
        short = length < SHORTEST_EDGE * spacing and max(lengths[each] for each in group) < PARTNER * spacing
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
    numbers: dict[Side, Side] = {}
    panels = {}
    for name, panel in pattern.panels.items():
        kept = [number for number in range(len(panel.edges)) if Side(name, number) not in collapsed]
        numbers |= {Side(name, number): Side(name, new) for new, number in enumerate(kept)}
        panels[name] = panel if len(kept) == len(panel.edges) else _remove_edges(panel, kept)
    stitches = tuple(
        Stitch(numbers[stitch.first], numbers[stitch.second], stitch.right_wrong)
        for stitch in pattern.stitches
        if stitch.first in numbers
    )
    named = ", ".join(f"{side} ({1e3 * length:.2g} mm)" for side, length in lengths.items() if side in collapsed)
    return replace(pattern, panels=panels, stitches=stitches, notes=(*pattern.notes, f"collapsed: {named}"))


def _run(side: Side, lengths: dict[Side, float], count: int) -> float:
    """Length of the run of edges in `lengths` that `side` is in, of a panel of `count` edges [m]."""
    total = lengths[side]
    for step in (1, -1):
        number = (side.edge + step) % count
        while number != side.edge and Side(side.panel, number) in lengths:
            total += lengths[Side(side.panel, number)]
            number = (number + step) % count
    return total


def _remove_edges(panel: Panel, kept: list[int]) -> Panel:
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
