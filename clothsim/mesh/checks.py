"""The mesh doctor: all that is wrong with a mesh, found in one pass, each fault with its place and a remedy."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clothsim.arrays import Floats, Ints
from clothsim.errors import InputError
from clothsim.mesh.degenerate import coincidence, duplicates, flat_triangles
from clothsim.mesh.manifold import bow_tie_vertices, fin_edges, joined_half_edges, turned_triangles
from clothsim.mesh.topology import half_edges

Severity = Literal["error", "warning"]
Role = Literal["cloth", "sewn cloth", "body"]
Flags = NDArray[np.bool_]

BAD_INDICES = ("index not whole", "negative index", "index out of range")
BODY_ERRORS = ("shape", "empty", "not finite", *BAD_INDICES, "repeated corner", "no area")
"""The kinds that no mesh may have. Real bodies have the others, so for a body those are warnings."""
OF_SEAMS = ("fin", "bow-tie")
"""The kinds that sewing makes: where panels lie in three layers, and where seams end in one vertex."""


@dataclass(frozen=True)
class Finding:
    """One kind of fault and everywhere it occurs.

    kind: one of BODY_ERRORS, or "duplicate", "flipped duplicate", "isolated vertex", "soup", "fin", "bow-tie",
    "mixed winding", "one-sided", "coincident", "seam"; indices: the vertices or triangles (k,) that `sentence` speaks
    of, for a fin its edges (k, 2), for "shape" and "empty" none.
    """

    severity: Severity
    kind: str
    sentence: str
    remedy: str
    indices: Ints


@dataclass(frozen=True)
class Report:
    """What the doctor found in the mesh `name`."""

    name: str
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """The findings that no simulation may start with."""
        return tuple(finding for finding in self.findings if finding.severity == "error")

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings that a user should know."""
        return tuple(finding for finding in self.findings if finding.severity == "warning")


def examine(name: str, positions: ArrayLike, triangles: ArrayLike, role: Role = "cloth") -> Report:
    """All that is wrong with raw arrays `positions` (n, 3) [m] and `triangles` (m, 3); never raises for their content.

    For a cloth every finding is an error but a "seam" (border vertices at one place that no triangle joins: panels not
    sewn); for a sewn cloth, whose borders were welded, those of OF_SEAMS are none either; for a body only BODY_ERRORS
    are. A triangle with a bad index or a repeated corner is left out of the later
    tests, and so is a duplicate, so that one fault is not reported as three.
    """
    notes = _Notes(role)
    points, faces = notes.table("positions", positions), notes.table("triangles", triangles)
    if points is not None and faces is not None:
        _examine_numbers(points, faces, notes)
    return Report(name, tuple(notes.findings))


def refuse(report: Report) -> None:
    """Raise InputError if the report holds errors: one line for each, then the remedies."""
    if report.errors:
        lines = [f"{report.name}: {finding.sentence}" for finding in report.errors]
        raise InputError("\n".join(lines), " ".join(dict.fromkeys(finding.remedy for finding in report.errors)))


def some(what: str, indices: Ints) -> str:
    """The first five of `indices` in words: 'triangles 3, 8 and 12', 'vertices 0, 1, 2, 3, 4 ... (57 in all)'."""
    plural = {"vertex": "vertices"}.get(what, f"{what}s")
    words = ["-".join(str(i) for i in np.atleast_1d(index)) for index in indices[:5]]
    if len(indices) == 1:
        return f"{what} {words[0]}"
    if len(indices) > 5:
        return f"{plural} {', '.join(words)} ... ({len(indices)} in all)"
    return f"{plural} {', '.join(words[:-1])} and {words[-1]}"


class _Notes:
    """The findings while they are collected."""

    def __init__(self, role: Role) -> None:
        self.role = role
        self.findings: list[Finding] = []

    def add(self, kind: str, sentence: str, remedy: str, indices: Ints | None = None) -> None:
        harmless = kind == "seam" or (self.role == "body" and kind not in BODY_ERRORS)
        harmless |= self.role == "sewn cloth" and kind in OF_SEAMS
        where = np.zeros(0, np.int64) if indices is None else indices
        self.findings.append(Finding("warning" if harmless else "error", kind, sentence, remedy, where))

    def add_some(self, kind: str, says: str, what: str, indices: Ints, remedy: str) -> None:
        """A finding about some vertices, triangles or edges; nothing where there are none."""
        if len(indices):
            self.add(kind, f"{says}: {some(what, indices)}.", remedy, indices)

    def table(self, name: str, values: ArrayLike) -> Floats | None:
        """`values` as a table (n, 3) of float64; None, and a finding, where they are none or have no rows."""
        try:
            if np.iscomplexobj(values):
                raise TypeError("complex numbers")
            table = np.asarray(values, dtype=np.float64)
        except (ValueError, TypeError, OverflowError) as error:
            self.add("shape", f"{name} is no table of numbers ({error}).", "Give three numbers in each row.")
            return None
        if table.size == 0:
            self.add("empty", f"{name} is empty.", "A mesh needs at least one triangle.")
            return None
        if table.ndim != 2 or table.shape[1] != 3:
            self.add("shape", f"{name} has shape {table.shape}, not (n, 3).", "Give three numbers in each row.")
            return None
        return table


def _examine_numbers(points: Floats, raw: Floats, notes: _Notes) -> None:
    finite: Flags = np.all(np.isfinite(points), axis=1)
    notes.add_some(
        "not finite", "not finite (NaN or infinite)", "vertex", np.flatnonzero(~finite), "Correct the coordinates."
    )
    whole: Flags = np.equal(raw, np.trunc(np.where(np.isfinite(raw), raw, 0.5)))
    negative, beyond = whole & (raw < 0), whole & (raw >= len(points))
    for kind, bad in zip(BAD_INDICES, (~whole, negative, beyond), strict=True):
        rows = np.flatnonzero(bad.any(axis=1))
        notes.add_some(kind, f"{kind} (vertices are 0..{len(points) - 1})", "triangle", rows, "Correct the index.")
    in_range = whole & ~negative & ~beyond
    faces = np.where(in_range, raw, 0).astype(np.int64)
    sound: Flags = np.all(in_range, axis=1)
    repeated: Flags = sound & np.any(np.equal(faces, np.roll(faces, 1, axis=1)), axis=1)
    notes.add_some(
        "repeated corner", "the same vertex twice", "triangle", np.flatnonzero(repeated), "Remove the triangle."
    )
    used = np.zeros(len(points), bool)
    used[faces[in_range]] = True
    remedy = "Remove it, or read one part of the file (component = 0)."
    notes.add_some("isolated vertex", "in no triangle", "vertex", np.flatnonzero(~used), remedy)
    rows = _distinct(faces, np.flatnonzero(sound & ~repeated), notes)
    measurable = rows[np.all(finite[faces[rows]], axis=1)]
    flat = measurable[flat_triangles(points, faces[measurable])]
    notes.add_some("no area", "no area (corners collinear or at one place)", "triangle", flat, "Remove or repair it.")
    if len(rows):
        whole_around = np.ones(len(points), bool)  # a triangle left out of a fan would look like a bow-tie
        whole_around[faces[(~sound | repeated)[:, None] & in_range]] = False
        _examine_surface(points, faces, rows, finite & used, whole_around=whole_around, notes=notes)


def _distinct(faces: Ints, rows: Ints, notes: _Notes) -> Ints:
    """Those of `rows` that repeat no earlier one."""
    same, flipped = duplicates(faces[rows])
    notes.add_some("duplicate", "given twice", "triangle", rows[same], "Remove the repetition.")
    says = "given twice with opposite winding"
    notes.add_some("flipped duplicate", says, "triangle", rows[flipped], "Remove one of the two.")
    return np.delete(rows, np.concatenate([same, flipped]))


def _examine_surface(
    points: Floats, faces: Ints, rows: Ints, placed: Flags, *, whole_around: Flags, notes: _Notes
) -> None:
    """How the triangles `rows` hang together; vertices `placed`: used, finite; `whole_around`: no triangle left out."""
    triangles = faces[rows]
    if len(rows) > 1 and np.bincount(triangles.ravel()).max() == 1:
        remedy = "Merge the vertices at one place (clothsim.mesh.weld.merge_coincident)."
        notes.add("soup", f"a soup: none of its {len(rows)} triangles shares a vertex with another.", remedy, rows)
        return
    joined = joined_half_edges(triangles)
    fins = fin_edges(triangles, joined)
    layers = "a seam of three layers or more" if notes.role == "sewn cloth" else "three or more triangles at one edge"
    notes.add_some("fin", layers, "edge", fins, "Remove the extra triangles.")
    ties = bow_tie_vertices(triangles, joined, len(points))
    says = "pieces that touch only in a vertex"
    notes.add_some("bow-tie", says, "vertex", ties[whole_around[ties]], "Give each piece its own vertex.")
    turned, one_sided = turned_triangles(triangles, joined)
    says = "wound against their neighbours"
    notes.add_some("mixed winding", says, "triangle", rows[turned], "Swap two corners of each.")
    says = "in a surface with one side only (a Moebius strip)"
    notes.add_some("one-sided", says, "triangle", rows[one_sided], "Cut it open.")
    single = np.ones(triangles.size, bool)
    single[joined[0]] = single[joined[1]] = False
    border = np.zeros(len(points), bool)
    border[half_edges(triangles)[single]] = True
    _examine_places(points, triangles, border, placed, notes)


def _examine_places(points: Floats, triangles: Ints, border: Flags, placed: Flags, notes: _Notes) -> None:
    """Vertices at one place: harmless where two borders meet, an error inside a surface or within a triangle."""
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
    says, seam = "coincident inside the surface", "coincident on borders (panels not sewn)"
    notes.add_some("coincident", says, "vertex", np.flatnonzero(together & inside[group]), "Merge or move them.")
    remedy = "Sew them with weld = (a small distance in m), or leave them open."
    notes.add_some("seam", seam, "vertex", np.flatnonzero(together & ~inside[group]), remedy)
