"""Penetration report of a garment on a body, from files, and its picture from the front and from behind."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clothsim import Finding
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.text import length
from clothsim.engine import intersection_points
from clothsim.garments.inputs import BodyMesh, read_body_mesh, read_garment
from clothsim.garments.penetration import Counts, penetrations
from clothsim.garments.stages import Garment
from clothsim.render import Surface, draw_marks
from transfer.errors import TransferError
from transfer.signed_distance import BodySurface, Closest, body_surface

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
    figure: BodyMesh
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
        hole = (f"{self.figure.name}: open at {open_edges:,} edges; near its holes inside is a guess",)
        return (*self.garment.notes, *self.figure.notes, *(hole if open_edges else ()))


def penetration_report(garment: Garment, figure: BodyMesh) -> PenetrationReport:
    """Check `garment` on the body `figure`. InputError for a body without a volume."""
    try:
        body = body_surface(figure.positions, figure.triangles)
    except TransferError as error:
        raise InputError(f"{figure.name}: {error.sentence}", error.remedy) from error
    counts, with_body, own = penetrations(garment.positions, garment.triangles, body)
    return PenetrationReport(garment, figure, body, counts, body.closest(garment.positions), with_body, own)


def read_penetration_report(
    path: str | Path,
    on: str | Path,
    *,
    scale: float | None = None,
    body_scale: float | None = None,
    body_group: str | None = None,
    part: tuple[int, int] | None = None,
    weld: float = 0.0,
) -> PenetrationReport:
    """The garment in `path` on the body in `on`, checked; keywords as of `read_body_mesh` and `read_garment`.

    scale: metres per unit of both files; body_scale: of the body's, where it is in another unit; then the garment's
    coordinates are in metres unless `scale` is given. MakeHuman clothes are placed by the body, so in its unit.
    """
    figure = read_body_mesh(on, scale=scale if body_scale is None else body_scale, group=body_group)
    own = scale if scale is not None else figure.scale if body_scale is None else 1.0
    on_base = Path(path).suffix.lower() == ".mhclo"
    return penetration_report(
        read_garment(path, on, figure.scale if on_base else own, part=part, weld=weld, body=figure.positions), figure
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
            yield f"vertex {vertex} is {1e3 * depth:.3g} mm deep, at {_at(position)}"
    else:
        nearest = float(report.closest.signed_distance.min())
        yield f"none of {n:,} vertices is inside the body; the nearest is {length(nearest)} away"
    x, own = report.garment.positions, report.garment.triangles
    for who, pairs, other in (
        ("the garment and the body", report.body_pairs, report.body.triangles + n),
        ("the garment and itself", report.self_pairs, own),
    ):
        if len(pairs):
            position = intersection_points(np.concatenate([x, report.body.positions]), own, other, pairs[:1])[0]
            sentence = f"{who} intersect in {len(pairs):,} pairs of triangles, the first near {_at(position)}"
            yield Finding("error", "intersection", sentence, "", pairs)
        else:
            yield f"{who} do not intersect"


def _at(position: Floats) -> str:
    return f"({', '.join(f'{value:.3g}' for value in position)}) m"


def draw_penetrations(report: PenetrationReport, file: Path) -> str:
    """A PNG with a dot where each vertex inside should come out, and intersecting triangles outlined.

    Marks that the body hides are left out: those of the other side are in the other half. The deepest is ringed where
    it is seen. Returns one line that names the renderer.
    """
    garment, figure, body, counts = report.garment, report.figure, report.body, report.counts
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

    front = np.array([0.0, 0.0, 1.0]) if figure.up[1] else np.array([0.0, -1.0, 0.0])
    aside = np.cross(figure.up, front)
    deepest = f", the deepest {1e3 * counts.depth:.3g} mm (pink, ringed)" if counts.penetrating_vertices else ""
    percent = 100 * counts.penetrating_vertices / len(garment.positions)
    return draw_marks(
        file,
        [
            Surface(garment.name, garment.positions, garment.triangles, "cloth", np.zeros((0, 2))),
            Surface(figure.name, figure.positions, figure.triangles, "body", np.zeros((0, 2))),
        ],
        [(np.cos(turn) * front + np.sin(turn) * aside + 0.12 * figure.up, side) for turn, side in TURNS],
        outlined=corners,
        dots=points,
        fractions=depths / depths[-1] if len(depths) else depths,
        visible=lambda camera: (faces_camera(outside, at.normals, camera), faces_camera(points, normals, camera)),
        key=[
            f"dots: {counts.penetrating_vertices:,} vertices ({percent:.3g} %) inside {figure.name}{deepest}",
            f"dark triangles: they intersect the body ({counts.body_pairs:,} pairs) "
            f"or the garment itself ({counts.self_pairs:,} pairs)",
        ],
        size=SIZE,
        up=figure.up,
    )
