"""Mesh checks (docs/results/hard_cases.md, B15): each fault alone, all at once, and sound meshes."""

import numpy as np
import pytest
from meshes import grid, irregular_grid

from clothsim.base.errors import InputError
from clothsim.mesh.checks import MeshReport, examine, index_text, refuse
from clothsim.mesh.generators.shapes import rectangle, tube

NX = 6


def sheet():
    """7 x 7 vertices; vertex (i, j) is 7 i + j; cell (i, j) has triangles 6 i + j and 36 + 6 i + j."""
    return grid(NX, NX)


def kinds(report):
    return {finding.kind: finding.indices.tolist() for finding in report.findings}


def nan_vertex(points, faces):
    points[8, 1] = np.nan
    return points, faces, "not finite", [8]


def infinite_vertex(points, faces):
    points[9, 0] = -np.inf
    return points, faces, "not finite", [9]


def negative_index(points, faces):
    faces[5, 1] = -1
    return points, faces, "negative index", [5]


def index_out_of_range(points, faces):
    faces[4, 2] = len(points)
    return points, faces, "index out of range", [4]


def broken_index(points, faces):
    faces = faces.astype(float)
    faces[4, 2] = 7.5
    return points, faces, "index not whole", [4]


def nan_index(points, faces):
    faces = faces.astype(float)
    faces[4, 2] = np.nan
    return points, faces, "index not whole", [4]


def huge_index(points, faces):
    faces = faces.astype(float)
    faces[4, 2] = 1e300
    return points, faces, "index out of range", [4]


def repeated_corner(points, faces):
    return points, np.vstack([faces, [0, 7, 7]]), "repeated corner", [len(faces)]


def collinear(points, faces):
    points[8] = (points[0] + points[16]) / 2  # on the diagonal of two cells
    points[9] = (points[8] + points[16]) / 2 + (0, 0, 0)
    triangle = int(np.flatnonzero((np.sort(faces, axis=1) == [8, 9, 16]).all(axis=1))[0])
    return points, faces, "no area", [triangle]


def duplicate(points, faces):
    return points, np.vstack([faces, faces[3, [1, 2, 0]]]), "duplicate", [len(faces)]


def flipped_duplicate(points, faces):
    return points, np.vstack([faces, faces[3, ::-1]]), "flipped duplicate", [len(faces)]


def isolated_vertex(points, faces):
    return np.vstack([points, [2.0, 2.0, 2.0]]), faces, "isolated vertex", [len(points)]


def fin(points, faces):
    return np.vstack([points, [0.5, 0.5, 1.0]]), np.vstack([faces, [16, 23, len(points)]]), "fin", [[16, 23]]


def bow_tie_on_the_border(points, faces):
    more = np.vstack([points, points[0] + [[-1, 0, 0], [-1, -1, 0]]])
    return more, np.vstack([faces, [0, len(points), len(points) + 1]]), "bow-tie", [0]


def bow_tie_inside(points, faces):
    """Two cells that touch in vertex 24 are cut out."""
    cell = 7 * np.array([3, 2]) + np.array([3, 2])
    keep = np.delete(np.arange(len(faces)), [6 * 3 + 3, 36 + 6 * 3 + 3, 6 * 2 + 2, 36 + 6 * 2 + 2])
    return points, faces[keep], "bow-tie", [cell[0]]


def mixed_winding(points, faces):
    faces[[3, 20]] = faces[[3, 20], ::-1]
    return points, faces, "mixed winding", [3, 20]


def coincident(points, faces):
    points[24] = points[0] * -0.0 + (0.5, 0.5, 0.0)
    points[17] = points[24]
    return points, faces, "coincident", [17, 24]


FAULTS = [
    nan_vertex,
    infinite_vertex,
    negative_index,
    index_out_of_range,
    broken_index,
    nan_index,
    huge_index,
    repeated_corner,
    collinear,
    duplicate,
    flipped_duplicate,
    isolated_vertex,
    fin,
    bow_tie_on_the_border,
    bow_tie_inside,
    mixed_winding,
]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_one_fault_is_one_finding_with_its_place(fault):
    points, faces, kind, indices = fault(*sheet())
    report = examine("tee", points, faces)
    assert kinds(report) == {kind: indices}
    assert report.findings[0].severity == "error"
    first = "-".join(map(str, np.atleast_1d(indices[0])))
    with pytest.raises(InputError, match=rf"tee: .*\b{first}\b"):
        refuse(report)


def test_a_sound_mesh_has_no_findings():
    report = examine("tee", *irregular_grid())
    assert report == MeshReport("tee", ())
    refuse(report)


def test_coincident_vertices_of_one_surface_are_an_error():
    points, faces, _, indices = coincident(*sheet())
    found = kinds(examine("tee", points, faces))
    assert found["coincident"] == indices
    flat = np.flatnonzero((np.isin(faces, indices)).sum(axis=1) == 2)
    assert set(flat) <= set(found["no area"])


def test_two_layers_at_one_place_are_an_error():
    points, faces = sheet()
    report = examine("tee", np.vstack([points, points]), np.vstack([faces, faces + len(points)]))
    assert [finding.kind for finding in report.errors] == ["coincident"]
    inner = [7 * i + j for i in range(1, 6) for j in range(1, 6)]
    assert kinds(report)["coincident"] == [*inner, *(i + 49 for i in inner)]


def test_panels_that_share_a_border_are_a_warning_that_names_weld():
    points, faces = sheet()
    beside = points + np.array([1.0, 0.0, 0.0])
    report = examine("tee", np.vstack([points, beside]), np.vstack([faces, faces + len(points)]))
    assert kinds(report) == {"seam": [*range(42, 49), *range(49, 56)]}
    assert report.errors == ()
    assert "weld" in report.warnings[0].remedy
    refuse(report)


def test_soup_is_named_once():
    points, faces = sheet()
    report = examine("tee", points[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))
    assert [finding.kind for finding in report.findings] == ["soup"]
    assert report.errors
    assert "72" in report.errors[0].sentence


def test_all_faults_at_once_are_all_found():
    points, faces = sheet()
    n, m = len(points), len(faces)
    points = np.vstack([points, [[9, 9, 9], [0.5, 0.5, 1], [-1, 0, 0], [-1, -1, 0], [3, 0, 0], [4, 0, 0], [5, 0, 0]]])
    points[48, 2] = np.nan
    extra = [[1, 2, -7], [1, 2, 99], [1, 1, 2], faces[30], faces[31, ::-1], [16, 23, n + 1], [0, n + 2, n + 3]]
    faces = np.vstack([faces, extra, [[n + 4, n + 5, n + 6]]])
    faces[22] = faces[22, ::-1]
    assert kinds(examine("tee", points, faces)) == {
        "not finite": [48],
        "negative index": [m],
        "index out of range": [m + 1],
        "repeated corner": [m + 2],
        "duplicate": [m + 3],
        "flipped duplicate": [m + 4],
        "isolated vertex": [n],
        "fin": [[16, 23]],
        "bow-tie": [0],
        "mixed winding": [22],
        "no area": [m + 7],
    }
    with pytest.raises(InputError) as caught:
        refuse(examine("tee", points, faces))
    assert caught.value.sentence.count("\n") == 10


def test_a_body_may_have_what_real_bodies_have():
    for fault in FAULTS:
        points, faces, kind, _ = fault(*sheet())
        (finding,) = examine("body", points, faces, role="body").findings
        tolerated = {"duplicate", "flipped duplicate", "isolated vertex", "fin", "bow-tie", "mixed winding"}
        assert finding.severity == ("warning" if kind in tolerated else "error")


@pytest.mark.parametrize(
    ("points", "faces", "kind"),
    [
        ([], [], "empty"),
        (np.zeros((4, 3)), np.zeros((0, 3), int), "empty"),
        ([[0, 0]], [[0, 0, 0]], "shape"),
        ([[0, 0, 0], [1, 0]], [[0, 1, 2]], "shape"),
        ([["a", "b", "c"]], [[0, 1, 2]], "shape"),
        (None, None, "shape"),
        (np.eye(3), [[0, 1, None]], "index not whole"),
        (np.eye(3), [[0, 1, 10**400]], "shape"),
        (np.eye(3), [0, 1, 2], "shape"),
        (np.full((3, 3), np.nan), [[0, 1, 2]], "not finite"),
        (np.eye(3), [[-1, -2, -3]], "negative index"),
    ],
)
def test_raw_arrays_of_any_kind_are_survived(points, faces, kind):
    assert kind in kinds(examine("tee", points, faces))


@pytest.mark.parametrize("factor", [1e-200, 1e-3, 1.0, 1e3, 1e200])
def test_flat_triangles_are_found_and_slivers_kept_at_every_scale(factor):
    sliver = [[0, 0, 0], [1, 0, 0], [0.5, 1e-7, 0]]
    assert examine("sliver", factor * np.array(sliver), [[0, 1, 2]]).findings == ()
    flat = np.array([[0, 0, 0], [0.1, 0.1, 0.3], [0.3, 0.3, 0.9]])
    assert kinds(examine("flat", factor * flat, [[0, 1, 2]])) == {"no area": [0]}


def test_flat_triangles_are_found_far_from_the_origin():
    flat = np.array([[0, 0, 0], [0.1, 0.1, 0.3], [0.3, 0.3, 0.9]]) + 1e6
    assert kinds(examine("flat", flat, [[0, 1, 2]])) == {"no area": [0]}
    assert examine("sound", sheet()[0] + 1e6, sheet()[1]).findings == ()


def test_a_moebius_strip_has_one_side():
    _, faces = tube(cells=(9, 2))
    points, _ = tube(cells=(9, 2))
    last = np.flatnonzero((faces // 3 == 8).any(axis=1) & (faces // 3 == 0).any(axis=1))
    turned = np.where(faces // 3 == 0, 2 - faces, faces)
    faces[last] = turned[last]
    assert set(kinds(examine("strip", points, faces))) >= {"one-sided"}


def test_of_two_pieces_the_smaller_part_of_each_is_turned():
    points, faces = rectangle(cells=(4, 4))
    two = np.vstack([faces[:, ::-1], faces + len(points)])
    two[[1, 40, 41]] = two[[1, 40, 41], ::-1]
    assert kinds(examine("two", np.vstack([points, points + 5.0]), two)) == {"mixed winding": [1, 40, 41]}


def test_indices_in_words():
    assert index_text("triangle", np.array([4])) == "triangle 4"
    assert index_text("vertex", np.array([4, 7])) == "vertices 4 and 7"
    assert index_text("edge", np.array([[4, 7], [1, 2]])) == "edges 4-7 and 1-2"
    assert index_text("vertex", np.arange(9)) == "vertices 0, 1, 2, 3, 4 ... (9 in all)"


def test_a_mesh_that_was_examined_before_is_known_by_its_numbers_and_its_role():
    points, triangles = rectangle()
    flipped = triangles.copy()
    flipped[0] = flipped[0, ::-1]
    for role in ("cloth", "body"):
        for faces in (triangles, flipped, triangles, flipped):
            report = examine("sheet", points, faces, role)
            kinds = [finding.kind for finding in report.findings]
            assert kinds == ([] if faces is triangles else ["mixed winding"])
            assert {finding.severity for finding in report.findings} <= {"error" if role == "cloth" else "warning"}
    first, second = (examine(name, points, flipped) for name in ("a", "b"))
    assert (first.name, second.name) == ("a", "b")
    assert first.findings[0] is second.findings[0]
