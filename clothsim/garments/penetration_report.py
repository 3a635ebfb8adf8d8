"""Penetration report of a garment on a body, from files."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.garments.inputs import BodyMesh, read_body_mesh, read_garment
from clothsim.garments.penetration import Counts, penetrations
from clothsim.garments.stages import Garment
from transfer.errors import TransferError
from transfer.signed_distance import BodySurface, Closest, body_surface


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
