"""Deformation transfer of a garment to another body as the start of a fit: markers, size, and where it was worn."""

from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.garments.fit.guaranteed_path import smoothed
from clothsim.garments.inputs import BodyMesh, Garment
from clothsim.garments.waistband import with_waistbands
from transfer.correspond import correspond
from transfer.errors import TransferError
from transfer.garment import transfer_garment, with_lengths
from transfer.part_warp import graded_metric, size_factors
from transfer.signed_distance import BodySurface, barycentric

NO_MARKERS = np.zeros((0, 6))
"""No markers: they are derived from the shapes of the bodies."""
FARTHEST = 0.05
"""Largest distance of a marker from the nearest vertex of its body [m]."""
HOW = "Give six numbers a line, in the units of the files: x y z on the garment's own body, x y z on the other."


def read_markers(path: str | Path) -> Floats:
    """The lines of a text file, (k, 6), k > 0: six numbers each; # begins a comment. InputError names the line."""
    rows = []
    try:
        lines = read_regular_file(path, remedy=HOW).decode("utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise InputError(f"The markers in {path} cannot be read: {error}.", HOW) from error
    for number, line in enumerate(lines, start=1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != 6 or not np.isfinite(row).all():
            raise InputError(f"Line {number} of {path} is {line.strip()!r}.", HOW)
        rows.append(row)
    if not rows:
        raise InputError(f"{path} has no marker.", HOW)
    return np.array(rows)


def marked_vertices(points: Floats, source: BodyMesh, target: BodyMesh) -> Ints:
    """The vertices (k, 2) of source and target nearest to the `points` (k, 6), which are in their files' units.

    InputError for a point that is FARTHEST from its body.
    """
    matched = []
    for body, positions in ((source, points[:, :3]), (target, points[:, 3:])):
        used = np.unique(body.triangles)
        far, nearest = cKDTree(body.positions[used]).query(body.scale * positions)
        worst = int(np.argmax(far))
        if far[worst] > FARTHEST:
            raise InputError(
                f"Marker {worst + 1} is {1e3 * far[worst]:.0f} mm away from {body.name}.",
                f"It must lie on the body, in the units of its file ({body.scale:g} m).",
            )
        matched.append(used[nearest])
    return np.column_stack(matched).astype(np.int64)


@dataclass(frozen=True)
class Transferred:
    """Garment positions (n, 3) [m], source body in the target's shape (k, 3) [m], registration in one line."""

    positions: Floats
    body: Floats
    description: str


def transferred(garment: Garment, source: BodyMesh, target: BodyMesh, markers: Floats = NO_MARKERS) -> Transferred:
    """The garment on the target, each triangle deformed as the body below it. TransferError as `transfer` has them.

    markers (k, 6): corresponding points of both (see `markers`); none: derived where the bodies differ in mesh.
    """
    body, description = target.positions, "the bodies share their mesh"
    if not np.array_equal(source.triangles, target.triangles):
        given = marked_vertices(markers, source, target) if len(markers) else None
        bodies = source.positions, source.triangles, target.positions, target.triangles
        parts = None
        if not len(markers):
            with suppress(TransferError):  # one of them is not a standing body
                parts = source.parts, target.parts
        registration = correspond(*bodies, given, parts=parts)
        how = f"with {len(registration.markers)} {'derived' if registration.derived else 'given'} markers"
        how = how if len(registration.markers) else "part by part"
        body, description = registration.positions, f"{source.name} registered to {target.name} {how}"
    elif len(markers):
        description += ", so the markers are not needed"
    placed = transfer_garment(garment.positions, garment.triangles, source.positions, body, source.triangles)
    return Transferred(placed, body, description)


@dataclass(frozen=True)
class Size:
    """Size of a garment on the target: positions (n, 3) [m]; kind "graded", "own" or "transferred"; its factors.

    rest (n, 3) [m]: its rest shape, with waistbands closed where it is graded; else `positions`.
    "transferred": one of the bodies is not a standing body; the garment has the shape that the transfer gave it.
    """

    positions: Floats
    kind: str
    rest: Floats
    factors: dict[str, float] = field(default_factory=dict)

    def as_dict(self) -> dict[str, object]:
        """Entry in summary.json."""
        return {"kind": self.kind, "factors": self.factors}

    def __str__(self) -> str:
        if self.kind == "own":
            return "as it was cut"
        return ", ".join(f"{name.replace('_', ' ')} {value:.2f}" for name, value in self.factors.items())


def sized(
    garment: Garment, source: BodyMesh, target: BodyMesh, positions: Floats, body: BodySurface, graded: bool
) -> Size:
    """The garment near `positions` (n, 3) [m] on the target, `body`, with its own or with graded lengths."""
    try:
        parts = [each.parts for each in (source, target)]
    except TransferError:
        return Size(positions, "transferred", positions)
    triangles, given = garment.triangles, garment.positions
    factors = size_factors(*parts)
    middles = given[triangles].mean(axis=1)
    own = np.broadcast_to(np.eye(3), (len(triangles), 3, 3))
    metric = graded_metric(factors, parts[0], source.positions, middles) if graded else own
    shape = with_lengths(positions, triangles, given, metric, body, parts[1].frame.height)
    if not graded:
        return Size(shape, "own", shape)
    banded = with_waistbands(shape, triangles, target, parts[1])
    named = factors.named | ({"waistband": min(banded.factors)} if banded.factors else {})
    return Size(shape, "graded", banded.rest, named)


def worn_positions(garment: Floats, source: BodySurface, moved: Floats) -> Floats:
    """Garment positions moved from one body to another with the points of the body below them, (n, 3) [m].

    Each vertex keeps its offset from the closest point of the body, turned as the body is turned there. garment (n, 3):
    positions on the source body [m]; moved (k, 3): vertices of that body in the shape and pose of the other one [m].
    """
    below = source.closest(garment)
    corners = source.triangles[below.triangles]
    weights = barycentric(source.positions[corners], below.points)
    # rotations of the body's surface at its vertices: polar factors of smoothed deformation gradients
    before, after = _frames(source.positions[source.triangles]), _frames(moved[source.triangles])
    gradients = after @ np.linalg.pinv(before)
    count = len(source.positions)
    of_vertex = np.zeros((count, 3, 3))
    np.add.at(of_vertex, source.triangles, gradients[:, None])
    smooth = smoothed(of_vertex.reshape(count, 9), source.triangles)
    left, _, right = np.linalg.svd(smooth.reshape(count, 3, 3))
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    turn = (left @ right)[corners]
    turned = np.einsum("nk,nkij,nj->ni", weights, turn, garment - below.points)
    return np.asarray(np.einsum("nk,nkj->nj", weights, moved[corners]) + turned, np.float64)


def _frames(corners: Floats) -> Floats:
    """Two edges and the unit normal of triangles (m, 3, 3), as columns."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(a, b)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([a, b, normal / np.where(length > 0, length, 1.0)], axis=2)
