"""Hostile sewing patterns: specifications, DXF drawings, files of seams."""

import json
from collections.abc import Iterator
from typing import Any

from tests.hostile.case import ANY, BAD, Case
from tests.hostile.stock import pattern

PANEL = pattern()["pattern"]["panels"]["front"]


def cases() -> Iterator[Case]:
    """All of them."""
    yield from _specifications()
    yield from _texts()
    yield from _drawings()


def _panel(**changes: Any) -> dict[str, Any]:
    """The pattern with keys of its front changed."""
    return pattern(panels={**pattern()["pattern"]["panels"], "front": {**PANEL, **changes}})


def _edge(curvature: Any, **changes: Any) -> dict[str, Any]:
    return _panel(edges=[{"endpoints": [0, 1], "curvature": curvature, **changes}, *PANEL["edges"][1:]])


def _specifications() -> Iterator[Case]:
    square = PANEL["vertices"]
    polyline = [[(k + 1) / 20_001, 0.01 * (k % 2)] for k in range(20_000)]
    spiral = [[0.5 + 0.3 * (-1) ** k, 0.01 * k] for k in range(400)]
    many = {f"p{k}": PANEL for k in range(10_000)}
    sides = pattern()["pattern"]["stitches"][0]
    for name, entries, wanted in (
        ("two squares", pattern(), "completed"),
        ("10,000 panels", pattern(panels=many), BAD),
        ("no panels", pattern(panels={}, stitches=[]), BAD),
        ("panels that are a list", pattern(panels=[PANEL]), BAD),
        ("30,000 stitches", pattern(stitches=[sides] * 30_000), BAD),
        ("a stitch of one side", pattern(stitches=[sides[:1]]), BAD),
        ("a stitch with itself", pattern(stitches=[[sides[0], sides[0]]]), BAD),
        ("a stitch of a panel that is not there", pattern(stitches=[[sides[0], {"panel": "x", "edge": 0}]]), BAD),
        ("a stitch of edge 99", pattern(stitches=[[sides[0], {"panel": "back", "edge": 99}]]), BAD),
        ("a stitch twice", pattern(stitches=[sides, sides]), ANY),
        ("stitches of words", pattern(stitches="all"), BAD),
        ("a polyline of 20,000 points", _edge({"type": "polyline", "params": polyline}), BAD),
        ("a polyline that crosses itself", _edge({"type": "polyline", "params": spiral}), BAD),
        ("a circle of radius 0", _edge({"type": "circle", "params": [0, 0, 0]}), BAD),
        ("a circle of radius 1e300", _edge({"type": "circle", "params": [1e300, 0, 0]}), ANY),
        ("a circle smaller than its chord", _edge({"type": "circle", "params": [1, 0, 0]}), "completed"),
        ("a curve at 1e300", _edge({"type": "quadratic", "params": [[0.5, 1e300]]}), BAD),
        ("a curve at 10^6 chords", _edge({"type": "quadratic", "params": [[0.5, 1e6]]}), BAD),
        ("a curve of words", _edge({"type": "quadratic", "params": "x"}), BAD),
        ("a curve of an unknown type", _edge({"type": "nurbs", "params": [[1, 2]]}), BAD),
        ("a label with control characters", _edge(None, label="\x1b[31m"), BAD),
        ("vertices at nan", _panel(vertices=[[float("nan"), 0], *square[1:]]), BAD),
        ("vertices at 1e200", _panel(vertices=[[1e200, 0], *square[1:]]), BAD),
        ("vertices in one place", _panel(vertices=[[0, 0]] * 4), BAD),
        ("vertices on a line", _panel(vertices=[[0, 0], [1, 0], [2, 0], [3, 0]]), BAD),
        ("a bow tie", _panel(vertices=[[0, 0], [40, 40], [40, 0], [0, 40]]), BAD),
        ("a panel of 10 km", _panel(vertices=[[0, 0], [0, 1e6], [1e6, 1e6], [1e6, 0]]), BAD),
        ("a panel of 10 um", _panel(vertices=[[0, 0], [0, 1e-3], [1e-3, 1e-3], [1e-3, 0]]), ANY),
        ("edges that do not close", _panel(edges=PANEL["edges"][:3]), BAD),
        ("an edge of vertex 10^9", _panel(edges=[{"endpoints": [0, 10**9]}, *PANEL["edges"][1:]]), BAD),
        ("an edge of vertex true", _panel(edges=[{"endpoints": [True, 1]}, *PANEL["edges"][1:]]), BAD),
        ("10,001 points of a panel", _panel(vertices=[[k, k * k] for k in range(10_001)]), BAD),
        ("a translation of words", _panel(translation="up"), BAD),
        ("a rotation of 1e300", _panel(rotation=[1e300, 0, 0]), ANY),
        ("a unit of 0", {**pattern(), "properties": {"units_in_meter": 0}}, BAD),
        ("a unit of 1e-300", {**pattern(), "properties": {"units_in_meter": 1e-300}}, BAD),
        ("no properties", {"pattern": pattern()["pattern"]}, "completed"),
        ("control characters in a name", pattern(panels={"a\x1b[2J": PANEL}, stitches=[]), BAD),
        ("a name of 10,000 letters", pattern(panels={"a" * 10_000: PANEL}, stitches=[]), ANY),
    ):
        text = json.dumps(entries)
        yield Case(f"pattern: {name}", "check p.json", wanted, {"p.json": text})
    wild = json.dumps(_edge({"type": "quadratic", "params": [[0.5, 40]]}))
    yield Case("pattern: a wild curve", "check p.json", ANY, {"p.json": wild})
    yield Case(
        "pattern: a size of 1 um", "dress p.json --on shirt -o out --size 1um", BAD, {"p.json": json.dumps(pattern())}
    )
    yield Case(
        "pattern: a fabric of no panel",
        "dress p.json --on shirt -o out --fabric-of x=denim",
        BAD,
        {"p.json": json.dumps(pattern())},
    )


def _texts() -> Iterator[Case]:
    for name, text in {
        "empty": "",
        "a number": "3",
        "lists 100,000 deep": "[" * 100_000,
        "tables 100 deep": '{"a":' * 100 + "1" + "}" * 100,
        "a number of 5,000 digits": '{"pattern": ' + "9" * 5000 + "}",
        "a key twice": '{"pattern": {}, "pattern": {}}',
        "200,000 keys and one twice": "{" + ",".join(f'"{k}":0' for k in (*range(200_000), 199_999)) + "}",
        "60 MB": '{"pattern": "' + "a" * (60 << 20) + '"}',
        "cut in half": json.dumps(pattern())[:300],
    }.items():
        yield Case(f"pattern: {name}", "check p.json", BAD, {"p.json": text}, small=name in ("empty", "a key twice"))


def _drawings() -> Iterator[Case]:
    try:
        import ezdxf
    except ImportError:
        return
    outline = {"layer": "1"}

    def drawing(draw: Any) -> str:
        import io

        document = ezdxf.new()
        draw(document.blocks.new("front"))
        text = io.StringIO()
        document.write(text)
        return text.getvalue()

    def square(block: Any) -> None:
        block.add_lwpolyline([(0, 0), (400, 0), (400, 400), (0, 400)], close=True, dxfattribs=outline)

    good = drawing(square)
    for name, text, wanted in (
        ("a square", good, ANY),
        (
            "40 ellipses of 10^9",
            drawing(lambda b: [b.add_ellipse((0, 0), (1e9, 0), 0.5, dxfattribs=outline) for _ in range(40)]),
            BAD,
        ),
        (
            "a spline to 1e300",
            drawing(lambda b: b.add_open_spline([(0, 0), (1e300, 1e300), (-1e300, 1e300), (3, 2)], dxfattribs=outline)),
            BAD,
        ),
        (
            "a polyline of 20,000",
            drawing(lambda b: b.add_lwpolyline([(k % 100, k // 100) for k in range(20_000)], dxfattribs=outline)),
            BAD,
        ),
        ("empty", "", BAD),
        ("cut in half", good[: len(good) // 2], BAD),
        ("garbage", "0\nSECTION\n2\nENTITIES\n0\nLINE\n10\nx\n", BAD),
        ("no outline", drawing(lambda b: None), BAD),
        (
            "a reference to another file",
            good.replace("ENDSEC", "ENDSEC", 1).replace("front", "../outside/thesis.txt"),
            ANY,
        ),
    ):
        yield Case(f"drawing: {name}", "check d.dxf", wanted, {"d.dxf": text})
    for name, text in {
        "empty": "",
        "of words": "seams = 3",
        "of an unknown key": "[x]\n",
        "no TOML": "= =",
        "of a panel that is not there": '[[seam]]\nfirst = "x.0"\nsecond = "y.0"\n',
    }.items():
        files = {"d.dxf": good, "s.toml": text}
        yield Case(f"seams: {name}", "check d.dxf --seams s.toml", ANY if name == "empty" else BAD, files)
