"""Seams: borders drawn together over time, then held together; the effect `seams`.

Vertices are matched along the lengths of both borders (`mesh.stitches`), and each stitch is a string that shortens over
time (`seam_strings`). The default stiffness of a stitch is 100 times the fabric's in stretch: at a strain of 1 % the
gap is a ten-thousandth of an edge. The summary of a run lists the final gap of each seam.

Where the vertices of both borders correspond one to one, the closed seam also resists bending, with hinges across it
(`hinge_bending`). With self_contact the strings end at d_hat + offset, where the barrier begins, and not at 0, where
the barrier is infinite and the cloth intersects itself.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points, as_positive
from clothsim.base.errors import InputError
from clothsim.mesh.edge_paths import path_along
from clothsim.mesh.stitches import Line, hinges_across, line_of, nearest_stitches, stitches
from clothsim.mesh.topology import border_edges
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.protocols import ContactGap
from clothsim.physics.energies.selection import (
    as_flag,
    check_tables,
    cloth_number,
    of_pattern,
    selected_vertices,
    vertex_numbers,
)

if TYPE_CHECKING:
    from clothsim.physics.energies.seam_strings import Seam

KEYS = ("from", "to", "start", "end", "stiffness", "flip", "bends", "match")
MATCHES = ("length", "vertices")
OF_PATTERN = ("start", "end", "stiffness", "bends")
SIDE = ("cloth", "side", "through", "vertices", "panel", "edge", "nearest")
WAYS = ("side", "through", "vertices", "panel", "nearest")
NEAREST = {"nearest": True}
"""The `to` of a seam whose vertices are each stitched to the nearest edge of another piece."""
SIDES = ("left", "right", "top", "bottom")
STIFFER = 100.0
"""Ratio of the default stiffness of a stitch to that of the fabric in stretch."""


def seams(
    world: World,
    *,
    seam: Sequence[Mapping[str, Any]] = (),
    pattern: Mapping[str, Any] | bool = False,
    built: Mapping[str, Energy] | None = None,
) -> Energy | Off:
    """Seams from a list of tables.

    Parameters
    ----------
    seam : sequence of tables
        Each has `from` and `to`, two lines of vertices, and optionally `start` and `end` of closing [s] (0 and 1),
        `stiffness` [N/m] of a stitch (100 times the fabric's), `flip` = true to reverse `to`, `bends` = false for a
        seam that folds freely, and `match` = "vertices" for lines of equally many vertices that meet one by one, or a
        single one ("length": at equal fractions of their lengths). A line is a table of `cloth`, its name, if there
        are several, and one of `side` ("left", "right", from bottom to top, or "bottom", "top", from left to right),
        `through`, points [[x, y, z], ...] along the border in the coordinates of the mesh before its placement [m],
        and `vertices`, numbers in their order.
        A line of a sewing pattern is `panel` with its `edge`.
        `to` = { nearest = true } stitches each vertex of `from` to the nearest edge of another piece of cloth at rest.
    pattern : table or False
        All seams of sewing patterns that are open as placed, with `start`, `end`, `stiffness` and `bends` for each.
    built : mapping, optional
        The energies built so far: seams bend if bending is on, and leave a gap for self_contact.

    Returns
    -------
    Seams, or Off without a seam.

    Raises
    ------
    InputError
        Names the seam and line.
    """
    check_tables("effects.seams.seam", seam, KEYS, ("from", "to"))
    tables = {f"effects.seams.seam[{k}]": keys for k, keys in enumerate(seam)}
    if pattern is not False:
        tables |= pattern_tables(world, pattern if isinstance(pattern, Mapping) else {})
    if not tables:
        return Off("there is no seam")
    from clothsim.physics.energies.seam_strings import (  # after the last Off: no kernel for a zero
        Seams,
        bending_across,
        those,
    )

    on = built or {}
    parts = [_seam(name, world, keys, "bending" in on) for name, keys in tables.items()]
    rows, weights, stiffness, hinges, beside = (np.concatenate([part[k] for part in parts]) for k in range(1, 6))
    contact = on.get("self_contact")
    gap = contact.activation_distance if isinstance(contact, ContactGap) else 0.0
    m, over = len(rows), bending_across(world, hinges, beside)
    links = rows, weights, np.zeros((m, 3)), np.full(m, gap), np.zeros(m), np.ones(m, bool)
    return Seams(*links, tuple(part[0] for part in parts), stiffness, gap, over, those(over, np.zeros(0, np.int64)))


def pattern_tables(world: World, keys: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Tables of the open seams of all patterns by name, each with the `keys`. InputError without a pattern."""
    check_tables("effects.seams.pattern", [keys], OF_PATTERN, ())
    if not any(cloth.lines.edges for cloth in world.cloths):
        raise InputError(
            "effects.seams.pattern: no cloth is of a sewing pattern.", "Give its seams: [[effects.seams.seam]]."
        )
    return {
        f"effects.seams.pattern.{cloth.name}.{name}": {
            "from": {"cloth": cloth.name, "vertices": pairs[:, 0]},
            "to": {"cloth": cloth.name, "vertices": pairs[:, 1]},
            "match": "vertices",
            **keys,
        }
        for cloth in world.cloths
        for name, pairs in cloth.lines.open_seams.items()
    }


def _seam(
    name: str, world: World, keys: Mapping[str, Any], bending: bool
) -> tuple["Seam", Ints, Floats, Floats, Ints, Ints]:
    """A seam with its stitches (rows, weights, stiffnesses), its hinges and the triangles beside them."""
    is_nearest, fewest = keys["to"] == NEAREST, 1 if keys.get("match") == "vertices" else 2
    first = _line(f"{name}.from", world, keys["from"], fewest)
    second = first if is_nearest else _line(f"{name}.to", world, keys["to"], fewest)
    flip, bends = (as_flag(f"{name}.{key}", keys.get(key, usual)) for key, usual in (("flip", False), ("bends", True)))
    if flip:
        second = Line(second.vertices[::-1], 1 - second.parameters[::-1])
    if keys.get("match", "length") not in MATCHES:
        raise InputError(f"{name}.match is {keys['match']!r}.", f"Known: {', '.join(MATCHES)}.")
    if keys.get("match") == "vertices":
        first, second = _one_by_one(name, first, second)
    start, end = (as_positive(f"{name}.{key}", keys.get(key, at), zero=True) for key, at in (("start", 0), ("end", 1)))
    if end <= start:
        raise InputError(f"{name} closes from {start:g} s to {end:g} s.", "Its end must be after its start.")
    rows, weights = _nearest(world, first) if is_nearest else stitches(first, second)
    if not len(rows):
        what = "finds no other piece" if is_nearest else "joins a line to itself"
        raise InputError(f"{name} {what}.", "Give two lines.")
    fabric = np.sqrt(world.per_triangle("stiffness_along_warp") * world.per_triangle("stiffness_along_weft")).max()
    if "stiffness" not in keys and not fabric > 0:
        raise InputError(f"{name} has no stiffness: the fabric has none.", "Give it a stiffness in N/m.")
    stiffness = as_positive(f"{name}.stiffness", keys.get("stiffness", STIFFER * float(fabric)))
    hinges, beside = hinges_across(first, second, world.triangles)
    if is_nearest:
        hinges, beside = hinges[:0], beside[:0]
    n = len(hinges) if bending and bends else 0
    from clothsim.physics.energies.seam_strings import Seam

    made = Seam(name.removeprefix("effects.seams."), start, end, len(rows), n)
    return made, rows, weights, np.full(len(rows), stiffness), hinges[:n], beside[:n]


def _nearest(world: World, line: Line) -> tuple[Ints, Floats]:
    """Stitches of a line to the nearest edges of other pieces, at rest."""
    rest = np.concatenate([cloth.rest_positions for cloth in world.cloths])
    return nearest_stitches(line.vertices, rest, world.triangles)


def _one_by_one(name: str, *lines: Line) -> tuple[Line, ...]:
    """The lines with vertices that meet one by one, whatever the lengths between them."""
    counts = [len(line.vertices) for line in lines]
    if counts[0] != counts[1]:
        raise InputError(f"{name} joins {counts[0]} vertices to {counts[1]} one by one.", 'Leave match = "length".')
    return tuple(Line(line.vertices, np.linspace(0.0, 1.0, counts[0])) for line in lines)


def _line(name: str, world: World, keys: object, fewest: int) -> Line:
    """The line of vertices on one side of a seam; one vertex will do where they meet one by one."""
    if not isinstance(keys, Mapping) or not set(keys) <= set(SIDE):
        raise InputError(f"{name} is {keys!r}.", f"Give a table of {', '.join(SIDE)}.")
    number = cloth_number(name, world, keys.get("cloth"))
    cloth, rows = world.cloths[number], world.cloth_slices[number]
    rest = cloth.rest_positions
    if sum(key in keys for key in WAYS) != 1 or ("panel" in keys) != ("edge" in keys):
        raise InputError(
            f"{name} needs one of {', '.join(WAYS)}; panel with edge.", 'For a rectangle: { side = "left" }.'
        )
    if "nearest" in keys:
        raise InputError(f"{name}.nearest is {keys['nearest']!r}.", "Only `to` may be { nearest = true }.")
    if "side" in keys:
        if keys["side"] not in SIDES:
            raise InputError(f"{name}.side is {keys['side']!r}.", f"Known: {', '.join(SIDES)}.")
        every = selected_vertices(f"{name}.side", world, keys["side"])
        line = every[(every >= rows.start) & (every < rows.stop)] - rows.start
        line = line[np.argsort(rest[line, 1 if keys["side"] in ("left", "right") else 0], kind="stable")]
    elif "panel" in keys:
        every = of_pattern(name, world, {"panel": keys["panel"], "edge": keys["edge"]})
        line = every[(every >= rows.start) & (every < rows.stop)] - rows.start
    elif "through" in keys:
        points = as_points(f"{name}.through", keys["through"])
        line = path_along(f"{name}.through", rest, border_edges(cloth.triangles)[0], points)
    else:
        line = vertex_numbers(f"{name}.vertices", keys["vertices"], len(rest))
    if len(line) < fewest or (fewest > 1 and not np.ptp(rest[line], axis=0).any()):
        raise InputError(f"{name} is no line: it has {len(line)} vertices.", "Give two or more, in order.")
    return line_of(line + rows.start, rest[line])


_SIDES = {"from": {"side": "left"}, "to": {"side": "right"}}
EXAMPLE = Example(
    keys={"seam": [{"from": {"vertices": [0, 1, 2]}, "to": {"vertices": [9, 10, 11]}, "stiffness": 2.0}]},
    in_scene={"seam": [_SIDES]},
    zero={"seam": []},
    idle=Idle(
        always={"seam": [{**_SIDES, "start": 10, "end": 11}]},
        sometimes={"seam": [{**_SIDES, "start": 0.05, "end": 0.5}]},
    ),
)
