"""Penetration of a garment: vertices inside the body, pairs of the exact check of intersections; report and picture."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clothsim import Finding
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.text import length_text
from clothsim.engine import intersecting_pairs, intersection_points
from clothsim.garments.inputs import BodyMesh, Garment, read_body_mesh, read_garment
from clothsim.render import Surface, draw_marks
from transfer.errors import TransferError
from transfer.signed_distance import BodySurface, Closest, body_surface


@dataclass(frozen=True)
class Counts:
    """Penetration counts of a garment on a body.

    Attributes
    ----------
    penetrating_vertices : int
        Garment vertices inside the body.
    depth : float
        Depth of the deepest [m].
    body_pairs, self_pairs : int
        Intersecting triangle pairs of garment and body, and of the garment with itself.
    position : ndarray (3,) or None
        Position of the worst [m]; None where `clean`.
    flypapered : int
        Vertices that the body carries where it overlaps itself; what they penetrate is not counted.
    """

    penetrating_vertices: int
    depth: float
    body_pairs: int
    self_pairs: int
    position: Floats | None
    flypapered: int = 0

    @property
    def on_body(self) -> bool:
        """True where garment and body are disjoint, the state that contact requires and preserves."""
        return not (self.penetrating_vertices or self.body_pairs)

    @property
    def clean(self) -> bool:
        """True without penetration and intersections."""
        return self.on_body and not self.self_pairs

    @property
    def rank(self) -> tuple[int, int]:
        """Number of penetrations of the body, then of intersections with itself: the smaller, the better."""
        return self.penetrating_vertices + self.body_pairs, self.self_pairs

    @property
    def where(self) -> str:
        """Position of the worst penetration as text."""
        return (
            "nowhere" if self.position is None else f"near ({', '.join(f'{value:.3g}' for value in self.position)}) m"
        )

    def __str__(self) -> str:
        inside = f"{self.penetrating_vertices:,} vertices inside"
        deep = f" (to {1e3 * self.depth:.3g} mm)" if self.penetrating_vertices else ""
        held = f"; {self.flypapered:,} vertices carried" if self.flypapered else ""
        return f"{inside}{deep}, {self.body_pairs:,} pairs with the body, {self.self_pairs:,} with itself{held}"


NO_ROWS: Ints = np.zeros(0, np.int64)


def count_penetrations(garment: Floats, triangles: Ints, body: BodySurface, flypapered: Ints = NO_ROWS) -> Counts:
    """Penetration counts of `garment (n, 3)` [m] with `triangles (m, 3)` on `body`; arguments of `penetrations`."""
    return penetrations(garment, triangles, body, flypapered)[0]


def penetrations(
    garment: Floats, triangles: Ints, body: BodySurface, flypapered: Ints = NO_ROWS
) -> tuple[Counts, Ints, Ints]:
    """The counts, and the pairs (p, 2) of intersecting triangles: of garment and body, of the garment with itself.

    flypapered (k,): vertices that the body carries where it overlaps itself. Left out are they, the pairs of their
    triangles with the body, and those of two of their triangles.
    """
    free = np.ones(len(garment), bool)
    free[flypapered] = False
    within = body.penetration(garment[free])
    x = np.concatenate([garment, body.positions])
    faces = body.triangles + len(garment)
    own, with_body = intersecting_pairs(x, triangles), intersecting_pairs(x, triangles, faces)
    whole = np.asarray(free[triangles].all(axis=1))
    own, with_body = own[whole[own].any(axis=1)], with_body[whole[with_body[:, 0]]]
    position = None
    if within.count:
        position = garment[free][within.worst]
    elif len(with_body):
        position = intersection_points(x, triangles, faces, with_body[:1])[0]
    elif len(own):
        position = intersection_points(x, triangles, triangles, own[:1])[0]
    return Counts(within.count, within.depth, len(with_body), len(own), position, len(flypapered)), with_body, own


SIZE = (720, 1080)
"""Size of each view of a picture in pixels."""
CLEAR = 2e-3
"""Height of a mark above its surface for the visibility test, relative to the body's size."""
TURNS = ((0.3, "from the front"), (np.pi + 0.3, "from behind"))
"""Positions of the camera: turned about the body from its front [rad]."""


@dataclass(frozen=True)
class PenetrationReport:
    """Garment on a body and its penetrations: counts; closest (n,): of the garment's vertices to the body.

    body_pairs (p, 2): intersecting triangles of garment and body; self_pairs (q, 2): of the garment with itself.
    """

    garment: Garment
    wearer: BodyMesh
    body: BodySurface
    counts: Counts
    closest: Closest
    body_pairs: Ints
    self_pairs: Ints

    @property
    def inside(self) -> Ints:
        """The garment's vertices inside the body, the deepest first."""
        distance = self.closest.signed_distance
        order = np.argsort(distance, kind="stable")
        return order[distance[order] < 0].astype(np.int64)

    @property
    def notes(self) -> tuple[str, ...]:
        """Defaults used in reading both files, and a warning for an open body."""
        open_edges = self.body.open_edges
        hole = (f"{self.wearer.name}: open at {open_edges:,} edges; near its holes inside is a guess",)
        return (*self.garment.notes, *self.wearer.notes, *(hole if open_edges else ()))


def penetration_report(garment: Garment, wearer: BodyMesh) -> PenetrationReport:
    """Check `garment` on the body `wearer`. InputError for a body without a volume."""
    try:
        body = body_surface(wearer.positions, wearer.triangles)
    except TransferError as error:
        raise InputError(f"{wearer.name}: {error.sentence}", error.remedy) from error
    counts, with_body, own = penetrations(garment.positions, garment.triangles, body)
    return PenetrationReport(garment, wearer, body, counts, body.closest(garment.positions), with_body, own)


def read_penetration_report(
    path: str | Path,
    on: str | Path,
    *,
    scale: float | None = None,
    body_scale: float | None = None,
    body_group: str | Sequence[str] | None = None,
    part: tuple[int, int] | None = None,
    weld: float = 0.0,
) -> PenetrationReport:
    """The garment in `path` on the body in `on`, checked; keywords as of `read_body_mesh` and `read_garment`.

    scale: metres per unit of both files; body_scale: of the body's, where it is in another unit; then the garment's
    coordinates are in metres unless `scale` is given. MakeHuman clothes are placed by the body, so in its unit.
    """
    wearer = read_body_mesh(on, scale=scale if body_scale is None else body_scale, group=body_group)
    own = scale if scale is not None else wearer.scale if body_scale is None else 1.0
    on_base = Path(path).suffix.lower() == ".mhclo"
    return penetration_report(
        read_garment(path, on, wearer.scale if on_base else own, part=part, weld=weld, body=wearer.positions), wearer
    )


def deepest_vertices(report: PenetrationReport, count: int = 5) -> list[tuple[int, float, Floats]]:
    """The deepest vertices, at most `count`: number, depth [m], place (3,) [m]."""
    distance, x = report.closest.signed_distance, report.garment.positions
    return [(int(v), -float(distance[v]), x[v]) for v in report.inside[:count]]


def entries(report: PenetrationReport) -> Iterator[Finding | str]:
    """Findings and notes on each kind of penetration."""
    counts, n = report.counts, len(report.garment.positions)
    if counts.penetrating_vertices:
        percent = 100 * counts.penetrating_vertices / n
        sentence = f"{counts.penetrating_vertices:,} of {n:,} vertices ({percent:.1f} %) are inside the body"
        yield Finding("error", "penetration", sentence, "", report.inside)
        for vertex, depth, position in deepest_vertices(report):
            yield f"vertex {vertex} is {1e3 * depth:.3g} mm deep, at {_place(position)}"
    else:
        nearest = float(report.closest.signed_distance.min())
        yield f"none of {n:,} vertices is inside the body; the nearest is {length_text(nearest)} away"
    x, own = report.garment.positions, report.garment.triangles
    for who, pairs, other in (
        ("the garment and the body", report.body_pairs, report.body.triangles + n),
        ("the garment and itself", report.self_pairs, own),
    ):
        if len(pairs):
            position = intersection_points(np.concatenate([x, report.body.positions]), own, other, pairs[:1])[0]
            sentence = f"{who} intersect in {len(pairs):,} pairs of triangles, the first near {_place(position)}"
            yield Finding("error", "intersection", sentence, "", pairs)
        else:
            yield f"{who} do not intersect"


def _place(position: Floats) -> str:
    return f"({', '.join(f'{value:.3g}' for value in position)}) m"


def draw_penetrations(report: PenetrationReport, file: Path) -> str:
    """A PNG with a dot where each vertex inside should come out, and intersecting triangles outlined.

    Marks that the body hides are left out: those of the other side are in the other half. The deepest is ringed where
    it is seen. Returns one line that names the renderer.
    """
    garment, wearer, body, counts = report.garment, report.wearer, report.body, report.counts
    bad = np.unique(np.concatenate([report.body_pairs[:, 0], report.self_pairs.ravel()]))
    corners = garment.positions[garment.triangles[bad]]
    middles = corners.mean(axis=1)
    at = body.closest(middles)
    outside = np.where(at.inside[:, None], at.points, middles)
    inside = report.inside[::-1]
    points, normals = report.closest.points[inside], report.closest.normals[inside]
    depths = -report.closest.signed_distance[inside]

    def faces_camera(places: Floats, directions: Floats, camera: Floats) -> np.ndarray:
        rays = camera - places
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        facing = (rays * directions).sum(axis=1) > 0
        distance, _ = body.exits(places + CLEAR * body.size * directions, rays)
        return np.logical_and(facing, ~np.isfinite(distance))

    front = np.array([0.0, 0.0, 1.0]) if wearer.up[1] else np.array([0.0, -1.0, 0.0])
    aside = np.cross(wearer.up, front)
    deepest = f", the deepest {1e3 * counts.depth:.3g} mm (pink, ringed)" if counts.penetrating_vertices else ""
    percent = 100 * counts.penetrating_vertices / len(garment.positions)
    return draw_marks(
        file,
        [
            Surface(garment.name, garment.positions, garment.triangles, "cloth", np.zeros((0, 2))),
            Surface(wearer.name, wearer.positions, wearer.triangles, "body", np.zeros((0, 2))),
        ],
        [(np.cos(turn) * front + np.sin(turn) * aside + 0.12 * wearer.up, side) for turn, side in TURNS],
        outlined=corners,
        dots=points,
        fractions=depths / depths[-1] if len(depths) else depths,
        visible=lambda camera: (faces_camera(outside, at.normals, camera), faces_camera(points, normals, camera)),
        key=[
            f"dots: {counts.penetrating_vertices:,} vertices ({percent:.3g} %) inside {wearer.name}{deepest}",
            f"dark triangles: they intersect the body ({counts.body_pairs:,} pairs) "
            f"or the garment itself ({counts.self_pairs:,} pairs)",
        ],
        size=SIZE,
        up=wearer.up,
    )
