"""Mesh checks: all faults of a triangle mesh in one pass, each with its indices and a remedy."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.memo import known_for_arrays
from clothsim.mesh.topology import coincidence, duplicates, flat_triangles, half_edges
from clothsim.mesh.winding import bow_tie_vertices, fin_edges, joined_half_edges, one_sided_edge, turned_triangles

Severity = Literal["error", "warning"]
Role = Literal["cloth", "sewn cloth", "body"]
Flags = NDArray[np.bool_]

BAD_INDICES = ("index not whole", "negative index", "index out of range")
BODY_ERRORS = ("shape", "empty", "not finite", *BAD_INDICES, "repeated corner", "no area")
"""Kinds of fault that no mesh may have. Real bodies have the others, so for a body those are warnings."""
OF_SEAMS = ("fin", "bow-tie")
"""Kinds that sewing produces: where panels lie in three layers, and where seams end in one vertex."""


@dataclass(frozen=True)
class Finding:
    """One kind of fault and its occurrences.

    Parameters
    ----------
    severity : str
        "error" or "warning".
    kind : str
        One of BODY_ERRORS, or "duplicate", "flipped duplicate", "isolated vertex", "soup", "fin", "bow-tie", "mixed
        winding", "one-sided", "coincident", "seam".
    sentence : str
        Message with the first indices.
    remedy : str
        Message.
    indices : (k,) int64
        Vertices or triangles; edges (k, 2) for a fin; empty for "shape" and "empty".
    """

    severity: Severity
    kind: str
    sentence: str
    remedy: str = ""
    indices: Ints = field(default_factory=lambda: np.zeros(0, np.int64))


@dataclass(frozen=True)
class MeshReport:
    """Findings of a check of the mesh `name`."""

    name: str
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that a simulation cannot start with."""
        return tuple(finding for finding in self.findings if finding.severity == "error")

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that it can start with."""
        return tuple(finding for finding in self.findings if finding.severity == "warning")


def examine(name: str, positions: ArrayLike, triangles: ArrayLike, role: Role = "cloth") -> MeshReport:
    """Check raw arrays for all faults; their content raises no error.

    For a cloth every finding is an error but a "seam" (border vertices at one position that no triangle joins: panels
    not sewn); for a sewn cloth, whose borders were welded, those of OF_SEAMS are warnings too; for a body only
    BODY_ERRORS are errors. A triangle with a bad index or a repeated corner is left out of the later checks, and so is
    a duplicate, so that one fault is not reported as three.

    Parameters
    ----------
    name : str
        Name in the messages.
    positions : (n, 3) array_like
        Vertices [m].
    triangles : (m, 3) array_like
        Vertex indices.
    role : str
        "cloth", "sewn cloth" or "body".

    Returns
    -------
    Report
        Its `findings`, split into `errors` and `warnings`.

    Examples
    --------
    >>> [finding.kind for finding in examine("sheet", [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]).errors]
    ['no area']
    """
    findings = _Findings(role)
    points, faces = findings.table("positions", positions), findings.table("triangles", triangles)
    if points is not None and faces is not None:
        findings.entries += _found(points, faces, role)
    return MeshReport(name, tuple(findings.entries))


@known_for_arrays
def _found(points: Floats, faces: Floats, role: Role) -> tuple["Finding", ...]:
    """Findings of tables of numbers."""
    findings = _Findings(role)
    _examine_numbers(points, faces, findings)
    return tuple(findings.entries)


def refuse(report: MeshReport) -> None:
    """Raise InputError where the report has errors: one line for each, then the remedies."""
    if report.errors:
        lines = [f"{report.name}: {finding.sentence}" for finding in report.errors]
        raise InputError("\n".join(lines), " ".join(dict.fromkeys(finding.remedy for finding in report.errors)))


def index_text(what: str, indices: Ints) -> str:
    """Format the first five of `indices`.

    >>> index_text("vertex", np.array([3, 8, 12]))
    'vertices 3, 8 and 12'
    """
    plural = {"vertex": "vertices"}.get(what, f"{what}s")
    words = ["-".join(str(i) for i in np.atleast_1d(index)) for index in indices[:5]]
    if len(indices) == 1:
        return f"{what} {words[0]}"
    if len(indices) > 5:
        return f"{plural} {', '.join(words)} ... ({len(indices)} in all)"
    return f"{plural} {', '.join(words[:-1])} and {words[-1]}"


class _Findings:
    """Findings collected so far."""

    def __init__(self, role: Role) -> None:
        self.role = role
        self.entries: list[Finding] = []

    def add(self, kind: str, sentence: str, remedy: str, indices: Ints | None = None) -> None:
        harmless = kind == "seam" or (self.role == "body" and kind not in BODY_ERRORS)
        harmless |= self.role == "sewn cloth" and kind in OF_SEAMS
        where = np.zeros(0, np.int64) if indices is None else indices
        self.entries.append(Finding("warning" if harmless else "error", kind, sentence, remedy, where))

    def add_if_any(self, kind: str, message: str, what: str, indices: Ints, remedy: str) -> None:
        """Add a finding about vertices, triangles or edges where there are any."""
        if len(indices):
            self.add(kind, f"{message}: {index_text(what, indices)}.", remedy, indices)

    def table(self, name: str, values: ArrayLike) -> Floats | None:
        """`values` as a table (n, 3) of float64; else None and a finding."""
        try:
            if np.iscomplexobj(values):
                raise TypeError("complex numbers")
            table = np.asarray(values, dtype=np.float64)
        except (ValueError, TypeError, OverflowError) as error:
            self.add("shape", f"{name} is not an array of numbers ({error}).", "Give three numbers in each row.")
            return None
        if table.size == 0:
            self.add("empty", f"{name} is empty.", "A mesh needs at least one triangle.")
            return None
        if table.ndim != 2 or table.shape[1] != 3:
            self.add("shape", f"{name} has shape {table.shape}, not (n, 3).", "Give three numbers in each row.")
            return None
        return table


def _examine_numbers(points: Floats, raw: Floats, findings: _Findings) -> None:
    finite: Flags = np.all(np.isfinite(points), axis=1)
    findings.add_if_any(
        "not finite", "not finite (NaN or infinite)", "vertex", np.flatnonzero(~finite), "Correct the coordinates."
    )
    whole: Flags = np.equal(raw, np.trunc(np.where(np.isfinite(raw), raw, 0.5)))
    negative, beyond = whole & (raw < 0), whole & (raw >= len(points))
    for kind, bad in zip(BAD_INDICES, (~whole, negative, beyond), strict=True):
        rows = np.flatnonzero(bad.any(axis=1))
        findings.add_if_any(kind, f"{kind} (vertices are 0..{len(points) - 1})", "triangle", rows, "Correct the index.")
    in_range = whole & ~negative & ~beyond
    faces = np.where(in_range, raw, 0).astype(np.int64)
    sound: Flags = np.all(in_range, axis=1)
    repeated: Flags = sound & np.any(np.equal(faces, np.roll(faces, 1, axis=1)), axis=1)
    findings.add_if_any(
        "repeated corner", "the same vertex twice", "triangle", np.flatnonzero(repeated), "Remove the triangle."
    )
    used = np.zeros(len(points), bool)
    used[faces[in_range]] = True
    remedy = "Remove it, or read one part of the file (component = 0)."
    findings.add_if_any("isolated vertex", "in no triangle", "vertex", np.flatnonzero(~used), remedy)
    rows = np.flatnonzero(sound & ~repeated)
    same, mirrored = duplicates(faces[rows])
    findings.add_if_any("duplicate", "given twice", "triangle", rows[same], "Remove the repetition.")
    message = "given twice with opposite winding"
    findings.add_if_any("flipped duplicate", message, "triangle", rows[mirrored], "Remove one of the two.")
    rows = np.delete(rows, np.concatenate([same, mirrored]))  # a triangle counts once
    measurable = rows[np.all(finite[faces[rows]], axis=1)]
    flat = measurable[flat_triangles(points, faces[measurable])]
    findings.add_if_any("no area", "no area (collinear or coincident corners)", "triangle", flat, "Remove or repair.")
    if len(rows):
        whole_around = np.ones(len(points), bool)  # a fan without one of its triangles would look like a bow-tie
        whole_around[faces[(~sound | repeated)[:, None] & in_range]] = False
        _examine_surface(points, faces, rows, finite & used, whole_around=whole_around, findings=findings)


def _examine_surface(
    points: Floats, faces: Ints, rows: Ints, placed: Flags, *, whole_around: Flags, findings: _Findings
) -> None:
    """Check the connectivity of the triangles `rows`.

    placed: vertices that are used and finite; whole_around: vertices none of whose triangles was left out.
    """
    triangles = faces[rows]
    if len(rows) > 1 and np.bincount(triangles.ravel()).max() == 1:
        remedy = "Merge coincident vertices (clothsim.mesh.weld.merge_coincident)."
        findings.add(
            "soup", f"a triangle soup: none of its {len(rows)} triangles shares a vertex with another.", remedy, rows
        )
        return
    joined = joined_half_edges(triangles)
    fins = fin_edges(triangles, joined)
    layers = (
        "a seam of three layers or more"
        if findings.role == "sewn cloth"
        else "non-manifold: three or more triangles at one edge"
    )
    findings.add_if_any("fin", layers, "edge", fins, "Remove the extra triangles.")
    ties = bow_tie_vertices(triangles, joined, len(points))
    message = "non-manifold: pieces that touch only in a vertex"
    findings.add_if_any("bow-tie", message, "vertex", ties[whole_around[ties]], "Give each piece its own vertex.")
    turned, one_sided = turned_triangles(triangles, joined)
    message = "winding inconsistent with the neighbours"
    findings.add_if_any("mixed winding", message, "triangle", rows[turned], "Swap two corners of each.")
    message = "in a non-orientable surface (a Moebius strip)"
    if len(one_sided):
        edge = "-".join(str(vertex) for vertex in one_sided_edge(triangles, joined))
        message += f", which cannot be wound consistently over edge {edge}"
    findings.add_if_any("one-sided", message, "triangle", rows[one_sided], "Cut it open, for example along that edge.")
    single = np.ones(triangles.size, bool)
    single[joined[0]] = single[joined[1]] = False
    border = np.zeros(len(points), bool)
    border[half_edges(triangles)[single]] = True
    _examine_coincidence(points, triangles, border, placed, findings)


def _examine_coincidence(points: Floats, triangles: Ints, border: Flags, placed: Flags, findings: _Findings) -> None:
    """Check vertices at one position: admissible where two borders meet, an error inside a surface or triangle."""
    vertices = np.flatnonzero(placed)
    if not len(vertices):
        return
    group, size = np.full(len(points), -1), np.ones(len(points), np.int64)
    group[vertices], size[vertices] = coincidence(points[vertices])
    inside = np.zeros(len(points) + 1, bool)  # by group; the last entry is that of group -1
    inside[group[~border]] = True
    corner_groups = group[triangles]
    alike = (corner_groups == np.roll(corner_groups, 1, axis=1)) & (corner_groups >= 0)
    inside[corner_groups[alike]] = True
    together = placed & (size > 1)
    message, seam = "coincident inside the surface", "coincident on borders (panels not sewn)"
    findings.add_if_any(
        "coincident", message, "vertex", np.flatnonzero(together & inside[group]), "Merge or move them."
    )
    remedy = "Sew them with weld = (a small distance in m), or leave them open."
    findings.add_if_any("seam", seam, "vertex", np.flatnonzero(together & ~inside[group]), remedy)
