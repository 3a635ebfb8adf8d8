"""Seams: borders drawn together over time, then held together; the effect `seams`.

Vertices are matched along the lengths of both borders (`mesh.lines`), and each stitch is a string that shortens over
time . The default stiffness of a stitch is 100 times the fabric's in stretch: at a strain of 1 % the
gap is a ten-thousandth of an edge. The summary of a run lists the final gap of each seam.

Where the vertices of both borders correspond one to one, the closed seam also resists bending, with hinges across it
(`hinge_bending`). With self_contact the strings end at d_hat + offset, where the barrier begins, and not at 0, where
the barrier is infinite and the cloth intersects itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points
from clothsim.base.errors import InputError
from clothsim.keys.effect_tables import PatternSeams, Seam, SeamLine
from clothsim.keys.typed_effects import Seams
from clothsim.mesh.cloth import stiffness_in_series
from clothsim.mesh.lines import Line, hinges_across, line_of, nearest_stitches, path_along, stitches
from clothsim.mesh.topology import border_edges
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.hinge_bending import HingeBending
from clothsim.physics.energies.key_values import (
    cloth_number,
    of_pattern,
    selected_vertices,
    vertex_numbers,
)
from clothsim.physics.energies.links import Links
from clothsim.physics.energies.protocols import (
    ContactGap,
    Coupling,
    Driven,
    EnergyReport,
    Joining,
    PastSensitivity,
    StartDerivatives,
)

WAYS = ("side", "through", "vertices", "panel", "nearest")
STIFFNESS_RATIO = 100.0
"""Ratio of the default stiffness of a stitch to that of the fabric in stretch."""


def seams(world: World, keys: Seams, *, built: Mapping[str, Energy] | None = None) -> Energy | Off:
    """Seams of the tables of a scene; off without one.

    built: the energies built so far; seams bend if bending is on, and leave a gap for self_contact.

    Raises
    ------
    InputError
        Names the seam and line.
    """
    tables = {f"effects.seams.seam[{k}]": each for k, each in enumerate(keys.seam)}
    if keys.pattern is not False:
        tables |= pattern_seams(world, keys.pattern if isinstance(keys.pattern, PatternSeams) else PatternSeams())
    if not tables:
        return Off("there is no seam")
    on = built or {}
    parts = [_seam(name, world, each, "bending" in on) for name, each in tables.items()]
    rows, weights, stiffness, hinges, beside = (np.concatenate([part[k] for part in parts]) for k in range(1, 6))
    contact = on.get("self_contact")
    gap = contact.activation_distance if isinstance(contact, ContactGap) else 0.0
    m, over = len(rows), bending_across(world, hinges, beside)
    links = rows, weights, np.zeros((m, 3)), np.full(m, gap), np.zeros(m), np.ones(m, bool)
    made, none = tuple(StitchedSeam(*part[0]) for part in parts), np.zeros(0, np.int64)
    return SeamsEnergy(*links, made, stiffness, gap, over, those(over, none))


def pattern_seams(world: World, keys: PatternSeams) -> dict[str, Seam]:
    """The open seams of all patterns by name, each with the `keys`. InputError without a pattern."""
    if not any(cloth.lines.edges for cloth in world.cloths):
        raise InputError(
            "effects.seams.pattern: no cloth is of a sewing pattern.", "Give its seams: [[effects.seams.seam]]."
        )
    given = {key: getattr(keys, key) for key in keys.given}
    return {
        f"effects.seams.pattern.{cloth.name}.{name}": Seam(
            from_=SeamLine(cloth=cloth.name, vertices=pairs[:, 0].tolist()),
            to=SeamLine(cloth=cloth.name, vertices=pairs[:, 1].tolist()),
            match="vertices",
            **given,
        )
        for cloth in world.cloths
        for name, pairs in cloth.lines.open_seams.items()
    }


def _seam(
    name: str, world: World, keys: Seam, bending: bool
) -> tuple[tuple[str, float, float, int, int], Ints, Floats, Floats, Ints, Ints]:
    """What a `StitchedSeam` has, stitches (rows, weights, stiffnesses), hinges and the triangles beside them."""
    is_nearest, fewest = keys.to.nearest and keys.to.given == ("nearest",), 1 if keys.match == "vertices" else 2
    first = seam_line(f"{name}.from", world, keys.from_, fewest)
    second = first if is_nearest else seam_line(f"{name}.to", world, keys.to, fewest)
    if keys.flip:
        second = second.reversed()
    if keys.match == "vertices":  # they meet one by one, whatever the lengths between them
        n, other = len(first.vertices), len(second.vertices)
        if n != other:
            raise InputError(f"{name} joins {n} vertices to {other} one by one.", 'Leave match = "length".')
        first, second = (Line(line.vertices, np.linspace(0.0, 1.0, n)) for line in (first, second))
    if keys.end <= keys.start:
        raise InputError(f"{name} closes from {keys.start:g} s to {keys.end:g} s.", "Its end must be after its start.")
    if is_nearest:
        rest = np.concatenate([cloth.rest_positions for cloth in world.cloths])
        rows, weights = nearest_stitches(first.vertices, rest, world.triangles)
    else:
        rows, weights = stitches(first, second)
    if not len(rows):
        what = "finds no other piece" if is_nearest else "joins a line to itself"
        raise InputError(f"{name} {what}.", "Give two lines.")
    stiffness = stitch_stiffness(name, world) if keys.stiffness is None else keys.stiffness
    hinges, beside = hinges_across(first, second, world.triangles)
    if is_nearest:
        hinges, beside = hinges[:0], beside[:0]
    n = len(hinges) if bending and keys.bends else 0
    numbers = name.removeprefix("effects.seams."), keys.start, keys.end, len(rows), n
    return numbers, rows, weights, np.full(len(rows), stiffness), hinges[:n], beside[:n]


def stitch_stiffness(name: str, world: World) -> float:
    """Stiffness of a stitch, or tie, where the scene gives none [N/m]. InputError names that of fabric without any."""
    along = world.per_triangle("stiffness_along_warp") * world.per_triangle("stiffness_along_weft")
    fabric = np.sqrt(along).max(initial=0.0)
    if not fabric > 0:
        raise InputError(f"{name} has no stiffness: the fabric has none.", "Give it a stiffness in N/m.")
    return STIFFNESS_RATIO * float(fabric)


def seam_line(name: str, world: World, keys: SeamLine, fewest: int) -> Line:
    """The line of vertices on one side of a seam; one vertex will do where they meet one by one."""
    number = cloth_number(name, world, keys.cloth)
    cloth, rows = world.cloths[number], world.cloth_slices[number]
    rest = cloth.rest_positions
    if sum(key in keys.given for key in WAYS) != 1 or (keys.panel is None) != (keys.edge is None):
        raise InputError(
            f"{name} needs one of {', '.join(WAYS)}; panel with edge.", 'For a rectangle: { side = "left" }.'
        )
    if "nearest" in keys.given:
        raise InputError(f"{name}.nearest is {keys.nearest!r}.", "Only `to` may be { nearest = true }.")
    if keys.side is not None:
        every = selected_vertices(f"{name}.side", world, keys.side)
        line = every[(every >= rows.start) & (every < rows.stop)] - rows.start
        line = line[np.argsort(rest[line, 1 if keys.side in ("left", "right") else 0], kind="stable")]
    elif keys.panel is not None:
        every = of_pattern(name, world, {"panel": keys.panel, "edge": keys.edge})
        line = every[(every >= rows.start) & (every < rows.stop)] - rows.start
    elif "through" in keys.given:
        points = as_points(f"{name}.through", keys.through)
        line = path_along(f"{name}.through", rest, border_edges(cloth.triangles)[0], points)
    else:
        line = vertex_numbers(f"{name}.vertices", keys.vertices, len(rest))
    if len(line) < fewest or (fewest > 1 and not np.ptp(rest[line], axis=0).any()):
        where = " in one place" if len(line) > 1 else ""
        raise InputError(f"{name} is not a line: it has {len(line)} vertices{where}.", "Give two or more, in order.")
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


# Each stitch is a string (`Links`) whose length falls from the gap at `start` to 0 at `end`,
#
#     E = sum k/2 max(|r| - L, 0)^2,   L(t + dt) = |r(t)| (1 - u(t + dt)) / (1 - u(t)),
#     u = (t - start) / (end - start),
#
# so that all gaps close linearly without impulses; the force of a seam that is held open is largest at its end. From
# then on L = 0 and a stitch is a spring of stiffness k, no exact weld: under the force f it gapes by f/k.


@dataclass(frozen=True)
class StitchedSeam:
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
class SeamsEnergy(Links, Coupling, Driven, Joining, EnergyReport, PastSensitivity):
    """Strings of all seams, and hinges across the closed ones.

    Parameters
    ----------
    seams : tuple of StitchedSeam
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

    seams: tuple[StitchedSeam, ...]
    stiffness: Floats
    gap: float
    across: HingeBending
    bending: HingeBending

    @property
    def drives(self) -> bool:
        """True: closing a seam does external work."""
        return True

    @property
    def joined_rows(self) -> Ints:
        """The vertices of each stitch, (m, 3)."""
        return self.rows

    @property
    def idle(self) -> bool:
        """True where no stitch acts and no closed seam bends."""
        return super().idle and not self._bends

    def reads_beyond(self, n: int) -> bool:
        """True where a stitch, or a hinge across a closed seam, has a row from n on."""
        return super().reads_beyond(n) or self.bending.reads_beyond(n)

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
            bending=those(self.across, np.flatnonzero(closed)),
        )

    def past_sensitivity(self, step: Step, x: Floats, adjoint: Floats) -> StartDerivatives:
        """By the gaps at the start, of which the lengths of the strings are fractions."""
        active, lines, distances = self._active(x)
        gaps = self.lines(step.positions)[active]
        wide, open_gaps = np.linalg.norm(gaps, axis=1), np.maximum(np.linalg.norm(gaps, axis=1) - self.gap, 0.0)
        ratios = np.divide(self.lengths[active] - self.gap, open_gaps, out=np.zeros_like(wide), where=open_gaps > 0.0)
        moves = np.einsum("mj,mjp->mp", self.weights[active], adjoint[self.rows[active]])
        tension = self.stiffnesses[active] / np.maximum(distances, np.finfo(float).tiny)
        by_gaps = -ratios * tension * (lines * moves).sum(axis=1) / np.maximum(wide, np.finfo(float).tiny)
        by_start = np.zeros_like(x)
        parts = self.weights[active][:, :, None] * (by_gaps[:, None] * gaps)[:, None]
        np.add.at(by_start, self.rows[active].ravel(), parts.reshape(-1, 3))
        return StartDerivatives(positions=by_start)

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

    def final_notes(self, x: Floats, time: float) -> tuple[str, ...]:
        """The largest gap of each seam at x."""
        gaps = np.split(np.linalg.norm(self.lines(x), axis=1), np.cumsum([seam.stitches for seam in self.seams])[:-1])
        return tuple(
            f"{seam.name} gapes by {1e3 * gap.max():.3g} mm at most" for seam, gap in zip(self.seams, gaps, strict=True)
        )


def bending_across(world: World, hinges: Ints, triangles: Ints) -> HingeBending:
    """The energy of hinges (h, 4) across closed seams between triangles (h, 2), weighted as all hinges."""
    rest = np.concatenate([cloth.rest_positions for cloth in world.cloths])
    edges = rest[hinges[:, 1]] - rest[hinges[:, 0]]
    areas = world.rest_areas[triangles]
    stiffness = stiffness_in_series(world.per_triangle("bending_stiffness")[triangles], areas)
    weights = stiffness * np.einsum("ij,ij->i", edges, edges) / areas.sum(axis=1)
    return HingeBending(hinges, np.zeros(len(hinges)), weights)


def those(hinges: HingeBending, chosen: Ints) -> HingeBending:
    """The `chosen (k,)` of the hinges."""
    return HingeBending(hinges.vertices[chosen], hinges.rest_angles[chosen], hinges.stiffnesses[chosen])


def _four(rows: Ints) -> Ints:
    """Rows (m, 3) with the last column twice."""
    return np.column_stack([rows, rows[:, -1]])
