"""DXF drawings as sewing patterns: the same panels and sewn topology as the specification that they were drawn from."""

import numpy as np
import pytest
from dxf_files import sewing_text, write_drawing
from real_data import DATA, needs_data
from sewing_patterns import skirt

from clothsim.base.errors import InputError
from clothsim.files.patterns.pattern_file import read_dxf_pattern
from clothsim.patterns.curves import Polyline, Straight
from clothsim.patterns.pattern import Pattern
from clothsim.patterns.pattern_mesh import mesh_pattern, sewn_vertices
from clothsim.patterns.specification import entries_of, pattern_of, read_specification

ezdxf = pytest.importorskip("ezdxf")


def curved_skirt() -> dict:
    """The skirt with a quadratic waist, a cubic side and two arcs."""
    made = skirt()
    front, back = made["pattern"]["panels"].values()
    for each in (front, back):
        each["edges"][0]["curvature"] = {"type": "quadratic", "params": [[0.4, 0.1]]}
        each["edges"][1]["curvature"] = {"type": "circle", "params": [14, 0, 1]}
        each["edges"][2]["curvature"] = {"type": "cubic", "params": [[0.3, -0.1], [0.6, 0.2]]}
        each["edges"][3]["curvature"] = {"type": "circle", "params": [14, 0, 0]}
    return made


def drawn(tmp_path, pattern: Pattern, layer: str = "14") -> Pattern:
    """The pattern written as a drawing with its sewing file, and read."""
    middles = write_drawing(tmp_path / "drawn.dxf", pattern, layer)
    (tmp_path / "drawn.toml").write_text(sewing_text(pattern, middles))
    return read_dxf_pattern(tmp_path / "drawn.dxf")


def compare(read: Pattern, pattern: Pattern, size: float) -> None:
    """Edges in space within 1e-9 m, and the same sewn vertices."""
    assert list(read.panels) == list(pattern.panels)
    assert read.stitches == pattern.stitches
    share = np.linspace(0, 1, 33)
    for name, expected in pattern.panels.items():
        found = read.panels[name]
        assert len(found.edges) == len(expected.edges)
        for number in range(len(found.edges)):
            points = found.placed(found.edge_points(number, share))
            assert np.abs(points - expected.placed(expected.edge_points(number, share))).max() < 1e-9
    meshes = [mesh_pattern(each, size) for each in (read, pattern)]
    assert meshes[0].positions.shape == meshes[1].positions.shape
    assert np.array_equal(*(sewn_vertices(mesh, mesh.seams) for mesh in meshes))
    for side, rows in meshes[1].edges.items():
        assert np.array_equal(meshes[0].edges[side], rows)
        assert np.abs(meshes[0].positions[rows] - meshes[1].positions[rows]).max() < 1e-9


@pytest.mark.parametrize("made", [skirt, curved_skirt])
@pytest.mark.parametrize("layer", ["1", "14"])
def test_a_drawing_is_the_pattern_that_it_was_drawn_from(tmp_path, made, layer):
    pattern = pattern_of(made())
    compare(drawn(tmp_path, pattern, layer), pattern, 0.02)


@needs_data
@pytest.mark.parametrize("name", ["skirt_2_panels.json", "skirt_4_panels.json", "tee.json"])
def test_drawings_of_shared_patterns(tmp_path, name):
    pattern = read_specification(DATA / "patterns" / name)
    compare(drawn(tmp_path, pattern), pattern, 0.02)


def polygon_drawing(path, points, extra=lambda block: None, units=4, name="flap", closed=True):
    """A drawing of one piece whose outline is a polyline on layer 1."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = units
    block = document.blocks.new(name)
    block.add_lwpolyline(points, close=closed, dxfattribs={"layer": "1"})
    extra(block)
    document.modelspace().add_blockref(name, (300, 200))
    document.saveas(path)
    return path


SHEET = [(0, 0), (100, 0), (100, 200), (0, 200)]


def test_notches_and_corners_end_edges_and_dense_curves_do_not(tmp_path):
    round_top = [(50 + 50 * np.cos(a), 200 + 50 * np.sin(a)) for a in np.linspace(0, np.pi, 41)]
    outline = [(0, 0), (100, 0), *round_top]
    notches = lambda block: [block.add_point(p, dxfattribs={"layer": "4"}) for p in ((50, 0), (100, 80), (0, 250))]  # noqa: E731
    file = polygon_drawing(tmp_path / "a.dxf", outline, notches)
    edges = read_dxf_pattern(file, sewn=False).panels["flap"]
    lengths = [edges.edge_length(number) for number in range(len(edges.edges))]
    chords = 2 * 40 * 0.05 * np.sin(np.pi / 80)
    assert [type(edge.curve) for edge in edges.edges] == [Straight, Straight, Straight, Polyline]
    assert np.allclose(lengths, [0.05, 0.05, 0.08, 0.12 + chords + 0.2], atol=1e-12)
    again = pattern_of(entries_of(Pattern({"flap": edges}, ()))).panels["flap"]
    assert np.abs(again.edge_points(3, np.linspace(0, 1, 9)) - edges.edge_points(3, np.linspace(0, 1, 9))).max() < 1e-12


@pytest.mark.parametrize(("units", "factor"), [(1, 25.4), (4, 1), (5, 10), (6, 1000), (0, 1)])
def test_lengths_are_by_the_units_of_the_header(tmp_path, units, factor):
    scaled = [(x / factor, y / factor) for x, y in SHEET]
    pattern = read_dxf_pattern(polygon_drawing(tmp_path / "a.dxf", scaled, units=units), sewn=False)
    assert np.allclose(np.ptp(pattern.panels["flap"].vertices, axis=0), [0.1, 0.2], rtol=1e-12)
    assert len(pattern.notes) == (units == 0)


def test_a_half_is_unfolded_at_its_mirror_line(tmp_path):
    mirror = lambda block: block.add_line((0, -10), (0, 210), dxfattribs={"layer": "6"})  # noqa: E731
    notch = lambda block: (mirror(block), block.add_point((100, 50), dxfattribs={"layer": "4"}))  # noqa: E731
    panel = read_dxf_pattern(polygon_drawing(tmp_path / "a.dxf", SHEET, notch), sewn=False).panels["flap"]
    assert np.allclose(np.ptp(panel.vertices, axis=0), [0.2, 0.2], rtol=1e-12)
    assert np.allclose(sorted(panel.edge_length(k) for k in range(6)), [0.05, 0.05, 0.15, 0.15, 0.2, 0.2], rtol=1e-12)


@pytest.mark.parametrize("clockwise", [False, True])
def test_a_thread_line_becomes_upright_and_loops_run_counter_clockwise(tmp_path, clockwise):
    grain = lambda block: block.add_line((20, 20), (80, 20), dxfattribs={"layer": "7"})  # noqa: E731
    outline = SHEET[::-1] if clockwise else SHEET
    panel = read_dxf_pattern(polygon_drawing(tmp_path / "a.dxf", outline, grain), sewn=False).panels["flap"]
    assert np.allclose(np.ptp(panel.vertices, axis=0), [0.2, 0.1], rtol=1e-12)
    x, y = panel.vertices.T
    assert np.isclose((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2, 0.02, rtol=1e-12)


def test_a_piece_makes_several_panels_one_of_them_mirrored(tmp_path):
    file = polygon_drawing(tmp_path / "a.dxf", [(0, 0), (100, 0), (60, 200), (0, 200)], name="sleeve")
    (tmp_path / "a.toml").write_text(
        '[panels.left]\npiece = "sleeve"\nposition = [0.5, 1, 0]\nlabel = "arm"\n'
        '[panels.right]\npiece = "sleeve"\nposition = [-0.5, 1, 0]\nmirrored = true\nturn_degrees = 90\n'
        '[[seam]]\nfrom = { panel = "left", edge = 1 }\nto = { panel = "right", edge = 1 }\nright_wrong = true\n'
    )
    pattern = read_dxf_pattern(file)
    assert list(pattern.panels) == ["left", "right"]
    assert pattern.panels["left"].label == "arm"
    turned = pattern.panels["left"].vertices @ np.array([[0, 1], [-1, 0]]) * [-1, 1]
    assert np.abs(turned - pattern.panels["right"].vertices).max() < 1e-15
    assert pattern.stitches[0].right_wrong


def write_both(tmp_path, sewing: str, closed: bool = True, outline=tuple(SHEET)):
    polygon_drawing(tmp_path / "coat.dxf", list(outline), closed=closed)
    if sewing:
        (tmp_path / "coat.toml").write_text(sewing)
    return tmp_path / "coat.dxf"


TWO = '[panels.a]\npiece = "flap"\nposition = [0, 1, 0.2]\n[panels.b]\npiece = "flap"\nposition = [0, 1, -0.2]\n'
SEAM = '[[seam]]\nfrom = { panel = "a", edge = 1 }\nto = { panel = "b", edge = 3 }\n'


@pytest.mark.parametrize(
    ("sewing", "words"),
    [
        ("", ("coat.dxf", "no seams", "coat.toml")),
        (TWO, ("coat.toml", "[[seam]]")),
        (TWO + SEAM.replace("3", "9"), ("edge 9 of b", "4 edges")),
        (TWO + SEAM.replace('"b"', '"c"'), ("'c'", "a, b")),
        (TWO + SEAM + SEAM, ("edge 1 of a", "two stitches")),
        (TWO.replace("flap", "flop", 1) + SEAM, ("flop", "flap")),
        (TWO.replace("position = [0, 1, -0.2]", "") + SEAM, ("places no panel b", "position")),
        (TWO.replace("position", "positions", 1) + SEAM, ("positions", "position")),
        ('size = "M"\n' + TWO + SEAM, ("size 'M'",)),
        ('units = "ell"\n' + TWO + SEAM, ("ell", "inch")),
        ('layer = "9"\n' + TWO + SEAM, ("layer 9",)),
        ("corner_degrees = 180\n" + TWO + SEAM, ("corner_degrees",)),
        ("a = [", ("TOML",)),
    ],
)
def test_a_wrong_sewing_file_is_named_in_one_sentence(tmp_path, sewing, words):
    with pytest.raises(InputError) as error:
        read_dxf_pattern(write_both(tmp_path, sewing))
    assert "\n" not in error.value.sentence
    assert all(word in str(error.value) for word in words), str(error.value)


def test_an_open_outline_is_named_with_its_gap(tmp_path):
    outline = [(0, 0), (100, 0), (100, 200), (0, 200), (0, 25)]
    with pytest.raises(InputError, match=r"piece flap on layer 1 is open: 25 mm"):
        read_dxf_pattern(write_both(tmp_path, TWO + SEAM, closed=False, outline=outline))


def test_a_file_that_is_no_drawing(tmp_path):
    (tmp_path / "coat.dxf").write_bytes(b"no drawing\x00\xff" * 20)
    with pytest.raises(InputError, match=r"coat\.dxf"):
        read_dxf_pattern(tmp_path / "coat.dxf", sewn=False)
    with pytest.raises(InputError, match=r"There is no .*gone\.dxf"):
        read_dxf_pattern(tmp_path / "gone.dxf", sewn=False)


def test_a_size_is_chosen_by_name(tmp_path):
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    for size, width in (("S", 90), ("M", 100)):
        block = document.blocks.new(f"flap-{size}")
        block.add_lwpolyline([(0, 0), (width, 0), (width, 50), (0, 50)], close=True, dxfattribs={"layer": "1"})
        block.add_text("Piece Name: flap")
        block.add_text(f"Size: {size}")
        document.modelspace().add_blockref(block.name, (0, 0))
    document.saveas(tmp_path / "a.dxf")
    with pytest.raises(InputError, match=r"flap twice, of sizes S and M"):
        read_dxf_pattern(tmp_path / "a.dxf", sewn=False)
    (tmp_path / "a.toml").write_text('size = "M"\n')
    pattern = read_dxf_pattern(tmp_path / "a.dxf", sewn=False)
    assert np.isclose(np.ptp(pattern.panels["flap"].vertices[:, 0]), 0.1)
    assert pattern.notes == ("size M; left out: S",)


def entity(kind: str, layer: str, *codes: tuple[int, object]) -> str:
    """Lines of an entity of a DXF file."""
    return "".join(f"{code}\n{value}\n" for code, value in ((0, kind), (8, layer), *codes))


def aama_block(name: str, size: str, height: float) -> str:
    """Half a piece as cutting programs write it: several open polylines, thread line along x, fold on y = 0."""
    outline = [
        [(0, 0), (0, 12)],
        [(0, 12), (height, 12)],
        [(height, 12), (height + 0.7, 11), (height + 2, 9), (height + 2.2, 0)],
        [(height + 2.2, 0), (0, 0)],
    ]
    lines = [f"0\nBLOCK\n8\n0\n2\n{name}_{size}\n70\n64\n10\n0.0\n20\n0.0\n"]
    for text in (f"Piece Name: {name}", f"SIZE: {size}"):
        lines.append(entity("TEXT", "1", (10, 1.0), (20, 1.0), (40, 0.25), (1, text), (7, "STANDARD")))
    for row in outline:
        lines.append(entity("POLYLINE", "1", (66, 1), (70, 0)))
        lines += [entity("VERTEX", "1", (10, x), (20, y)) for x, y in row]
        lines.append(entity("SEQEND", "1"))
    lines.append(entity("POINT", "3", (10, height + 0.7), (20, 11)))
    lines.append(entity("POINT", "3", (10, height + 2), (20, 9)))
    lines.append(entity("POINT", "4", (10, 5.0), (20, 12)))
    lines.append(entity("LINE", "7", (10, 1.0), (20, 6.0), (11, 9.0), (21, 6.0)))
    lines.append(entity("LINE", "6", (10, height + 2.2), (20, 0.0), (11, 0.0), (21, 0.0)))
    return "".join([*lines, "0\nENDBLK\n"])


def test_a_drawing_without_header_and_tables_in_inches_of_which_one_size_is_the_sample(tmp_path):
    blocks = "".join(aama_block("BACK", size, height) for size, height in (("40", 19.0), ("42", 20.0)))
    texts = "".join(
        entity("TEXT", "1", (10, 0.0), (20, 0.0), (1, text)) for text in ("SAMPLE SIZE: 42", "UNITS: ENGLISH")
    )
    inserts = entity("INSERT", "1", (2, "BACK_42"), (10, 0.0), (20, 0.0))
    section = "0\nSECTION\n2\n"
    (tmp_path / "coat.dxf").write_text(
        f"{section}HEADER\n0\nENDSEC\n{section}BLOCKS\n{blocks}0\nENDSEC\n{section}ENTITIES\n{inserts}{texts}0\nENDSEC\n0\nEOF\n"
    )
    pattern = read_dxf_pattern(tmp_path / "coat.dxf", sewn=False)
    back = pattern.panels["BACK"]
    assert pattern.notes == ("size 42; left out: 40",)
    assert np.allclose(np.ptp(back.vertices, axis=0), [24 * 0.0254, 20 * 0.0254], rtol=1e-12)
    lengths = [back.edge_length(number) / 0.0254 for number in range(len(back.edges))]
    top = 2 * (np.hypot(0.7, 1) + np.hypot(1.3, 2) + np.hypot(0.2, 9))
    assert np.allclose(sorted(lengths), sorted([24, 5, 15, top, 15, 5]), rtol=1e-9)
    assert back.vertices[:, 1].max() > 0 > back.vertices[:, 1].min()
    (tmp_path / "coat.toml").write_text('size = "40"\n')
    smaller = read_dxf_pattern(tmp_path / "coat.dxf", sewn=False)
    assert np.isclose(np.ptp(smaller.panels["BACK"].vertices[:, 1]), 19 * 0.0254)
