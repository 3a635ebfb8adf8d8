"""Seams: borders drawn together over time, then held together; the effect `seams`.

Vertices are matched along the lengths of both borders (`mesh.stitches`). Each stitch is a string (`links`) whose length
falls from the gap at `start` to 0 at `end`,

    E = sum k/2 max(|r| - L, 0)^2,   L(t + dt) = |r(t)| (1 - u(t + dt)) / (1 - u(t)),   u = (t - start) / (end - start),

so that all gaps close linearly without impulses; the force of a seam that is held open is largest at its end. From then
on L = 0 and a stitch is a spring of stiffness k, no exact weld: under the force f it gapes by f/k. The default k is 100
times the fabric's stiffness in stretch: at a strain of 1 % the gap is a ten-thousandth of an edge. The summary of a run
lists the final gap of each seam.

Where the vertices of both borders correspond one to one, the closed seam also resists bending, with hinges across it
(`hinge_bending`). With self_contact the strings end at d_hat + offset, where the barrier begins, and not at 0, where
the barrier is infinite and the cloth intersects itself.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from clothsim.arrays import Floats, Ints, as_points, as_positive
from clothsim.energies.base import Energy, Off
from clothsim.energies.example import Example, Idle
from clothsim.energies.hessians import ElementHessian
from clothsim.energies.hinge_bending import HingeBending
from clothsim.energies.links import Links
from clothsim.energies.protocols import ContactGap, Coupling, Driven, Report
from clothsim.energies.selection import as_flag, check_tables, cloth_number, selected_vertices, vertex_numbers
from clothsim.energies.step import Step
from clothsim.errors import InputError
from clothsim.mesh.edge_paths import path_along
from clothsim.mesh.stitches import Line, hinges_across, line_of, stitches
from clothsim.mesh.topology import border_edges
from clothsim.mesh.world import World

KEYS = ("from", "to", "start", "end", "stiffness", "flip", "bends")
SIDE = ("cloth", "side", "through", "vertices")
SIDES = ("left", "right", "top", "bottom")
STIFFER = 100.0
"""Ratio of the default stiffness of a stitch to that of the fabric in stretch."""


@dataclass(frozen=True)
class Seam:
    """One seam: its name in the scene, start and end of closing [s], numbers of stitches and hinges."""

    name: str
    start: float
    end: float
    stitches: int
    hinges: int

    def open_fraction(self, time: float) -> float:
        """Fraction 1 - u of the initial gap at `time` [s], from 1 to 0."""
        return float(1 - np.clip((time - self.start) / (self.end - self.start), 0.0, 1.0))


@dataclass(frozen=True)
class Seams(Links, Coupling, Driven, Report):
    """Strings of all seams, and hinges across the closed ones.

    Parameters
    ----------
    seams : tuple of Seam
        The seams, in the order of their stitches.
    stiffness : (m,) array
        k of the stitches [N/m].
    gap : float
        Final length of the strings [m].
    across : HingeBending
        Hinges across all seams.
    bending : HingeBending
        Those of the seams that are closed in this step.
    """

    seams: tuple[Seam, ...]
    stiffness: Floats
    gap: float
    across: HingeBending
    bending: HingeBending

    @property
    def drives(self) -> bool:
        """True: closing a seam does external work."""
        return True

    @property
    def idle(self) -> bool:
        """True where no stitch acts and no closed seam bends."""
        return super().idle and not self._bends

    def begin(self, step: Step) -> Self:
        """A copy with the lengths of the strings at the end of the step."""
        now, then = step.time, step.time + step.dt
        counts = [seam.stitches for seam in self.seams]
        fractions = [(seam.open_fraction(now), seam.open_fraction(then)) for seam in self.seams]
        active = np.repeat([after < 1 for _, after in fractions], counts)
        ratios = np.repeat([after / before if before else 0.0 for before, after in fractions], counts)
        gaps = np.linalg.norm(self.lines(step.positions), axis=1)
        closed = np.repeat([after == 0 for _, after in fractions], [seam.hinges for seam in self.seams])
        return replace(
            self,
            lengths=self.gap + ratios * np.maximum(gaps - self.gap, 0.0),
            stiffnesses=np.where(active, self.stiffness, 0.0),
            bending=_those(self.across, np.flatnonzero(closed)),
        )

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        stitched = super().value(x)
        return stitched + self.bending.value(x) if self._bends else stitched

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        stitched = super().gradient(x)
        return stitched + self.bending.gradient(x) if self._bends else stitched

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (m, 9, 9) of the stitches [N/m]; with hinges 12 x 12, stitches with a fourth vertex of weight 0."""
        stitched = super().hessian(x, project)
        if not self._bends:
            return stitched
        bent = self.bending.hessian(x, project)
        blocks = np.zeros((len(stitched.elements), 12, 12))
        blocks[:, :9, :9] = stitched.blocks
        rows = np.concatenate([_four(stitched.elements), bent.elements])
        return ElementHessian(rows, np.concatenate([blocks, bent.blocks]))

    def couplings(self, x: Floats, dx: Floats) -> Ints:
        """The rows (m, 4) of the active stitches and of the hinges across closed seams."""
        return np.concatenate([_four(self.rows[self.stiffnesses > 0]), self.bending.vertices])

    @property
    def _bends(self) -> bool:
        return len(self.bending.stiffnesses) > 0

    def defaults_used(self) -> tuple[str, ...]:
        """Number and stiffness of the stitches, their final gap, and the hinges."""
        bent = sum(seam.hinges for seam in self.seams)
        gap = f", to a gap of {self.gap:g} m for self_contact" if self.gap else ""
        over = f"{bent} hinges across them" if bent else "no hinges across them: they fold freely"
        return (f"{len(self.rows)} stitches of {self.stiffness.max():.3g} N/m at most{gap}; {over}",)

    def final_notes(self, x: Floats) -> tuple[str, ...]:
        """The largest gap of each seam at x."""
        gaps = np.split(np.linalg.norm(self.lines(x), axis=1), np.cumsum([seam.stitches for seam in self.seams])[:-1])
        return tuple(
            f"{seam.name} gapes by {1e3 * gap.max():.3g} mm at most" for seam, gap in zip(self.seams, gaps, strict=True)
        )


def seams(
    world: World, *, seam: Sequence[Mapping[str, Any]] = (), built: Mapping[str, Energy] | None = None
) -> Energy | Off:
    """Seams from a list of tables.

    Parameters
    ----------
    seam : sequence of tables
        Each has `from` and `to`, two lines of vertices, and optionally `start` and `end` of closing [s] (0 and 1),
        `stiffness` [N/m] of a stitch (100 times the fabric's), `flip` = true to reverse `to`, and `bends` = false for a
        seam that folds freely. A line is a table of `cloth`, its name, if there are several, and one of `side` ("left",
        "right", from bottom to top, or "bottom", "top", from left to right), `through`, points [[x, y, z], ...] along
        the border in the coordinates of the mesh before its placement [m], and `vertices`, numbers in their order.
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
    if not seam:
        return Off("there is no seam")
    on = built or {}
    parts = [_seam(f"effects.seams.seam[{k}]", world, keys, "bending" in on) for k, keys in enumerate(seam)]
    rows, weights, stiffness, hinges, beside = (np.concatenate([part[k] for part in parts]) for k in range(1, 6))
    contact = on.get("self_contact")
    gap = contact.activation_distance if isinstance(contact, ContactGap) else 0.0
    m, over = len(rows), _bending(world, hinges, beside)
    links = rows, weights, np.zeros((m, 3)), np.full(m, gap), np.zeros(m), np.ones(m, bool)
    return Seams(*links, tuple(part[0] for part in parts), stiffness, gap, over, _those(over, np.zeros(0, np.int64)))


def _seam(
    name: str, world: World, keys: Mapping[str, Any], bending: bool
) -> tuple[Seam, Ints, Floats, Floats, Ints, Ints]:
    """A seam with its stitches (rows, weights, stiffnesses), its hinges and the triangles beside them."""
    first, second = (_line(f"{name}.{key}", world, keys[key]) for key in ("from", "to"))
    flip, bends = (as_flag(f"{name}.{key}", keys.get(key, usual)) for key, usual in (("flip", False), ("bends", True)))
    if flip:
        second = Line(second.vertices[::-1], 1 - second.parameters[::-1])
    start, end = (as_positive(f"{name}.{key}", keys.get(key, at), zero=True) for key, at in (("start", 0), ("end", 1)))
    if end <= start:
        raise InputError(f"{name} closes from {start:g} s to {end:g} s.", "Its end must be after its start.")
    rows, weights = stitches(first, second)
    if not len(rows):
        raise InputError(f"{name} joins a line to itself.", "Give two lines.")
    fabric = np.sqrt(world.per_triangle("stiffness_along_warp") * world.per_triangle("stiffness_along_weft")).max()
    if "stiffness" not in keys and not fabric > 0:
        raise InputError(f"{name} has no stiffness: the fabric has none.", "Give it a stiffness in N/m.")
    stiffness = as_positive(f"{name}.stiffness", keys.get("stiffness", STIFFER * float(fabric)))
    hinges, beside = hinges_across(first, second, world.triangles)
    n = len(hinges) if bending and bends else 0
    made = Seam(name.removeprefix("effects.seams."), start, end, len(rows), n)
    return made, rows, weights, np.full(len(rows), stiffness), hinges[:n], beside[:n]


def _line(name: str, world: World, keys: object) -> Line:
    """The line of vertices on one side of a seam."""
    if not isinstance(keys, Mapping) or not set(keys) <= set(SIDE):
        raise InputError(f"{name} is {keys!r}.", f"Give a table of {', '.join(SIDE)}.")
    number = cloth_number(name, world, keys.get("cloth"))
    cloth, rows = world.cloths[number], world.cloth_slices[number]
    rest = cloth.rest_positions
    if sum(key in keys for key in SIDE[1:]) != 1:
        raise InputError(f"{name} needs one of {', '.join(SIDE[1:])}.", 'For a rectangle: { side = "left" }.')
    if "side" in keys:
        if keys["side"] not in SIDES:
            raise InputError(f"{name}.side is {keys['side']!r}.", f"Known: {', '.join(SIDES)}.")
        every = selected_vertices(f"{name}.side", world, keys["side"])
        line = every[(every >= rows.start) & (every < rows.stop)] - rows.start
        line = line[np.argsort(rest[line, 1 if keys["side"] in ("left", "right") else 0], kind="stable")]
    elif "through" in keys:
        points = as_points(f"{name}.through", keys["through"])
        line = path_along(f"{name}.through", rest, border_edges(cloth.triangles)[0], points)
    else:
        line = vertex_numbers(f"{name}.vertices", keys["vertices"], len(rest))
    if len(line) < 2 or not np.ptp(rest[line], axis=0).any():
        raise InputError(f"{name} is no line: it has {len(line)} vertices.", "Give two or more, in order.")
    return line_of(line + rows.start, rest[line])


def _bending(world: World, hinges: Ints, triangles: Ints) -> HingeBending:
    """The energy of hinges (h, 4) across closed seams between triangles (h, 2), weighted as all hinges."""
    rest = np.concatenate([cloth.rest_positions for cloth in world.cloths])
    edges = rest[hinges[:, 1]] - rest[hinges[:, 0]]
    stiffness = world.per_triangle("bending_stiffness")[triangles].mean(axis=1)
    weights = stiffness * np.einsum("ij,ij->i", edges, edges) / world.rest_areas[triangles].sum(axis=1)
    return HingeBending(hinges, np.zeros(len(hinges)), weights)


def _those(hinges: HingeBending, chosen: Ints) -> HingeBending:
    return HingeBending(hinges.vertices[chosen], hinges.rest_angles[chosen], hinges.stiffnesses[chosen])


def _four(rows: Ints) -> Ints:
    """Rows (m, 3) with the last column twice."""
    return np.column_stack([rows, rows[:, -1]])


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
