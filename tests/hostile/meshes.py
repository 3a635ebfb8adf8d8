"""Hostile meshes: every format cut, emptied, promising too much; names, links, pipes and devices."""

import os
import re
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.hostile.case import Case
from tests.hostile.stock import FORMS, ending, glb, meshes, with_mesh

SMALL = ("obj: empty", "ply: cut in half", "glb: garbage", "off: promises 10^12")
READ = r"12 vertices"
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def cases() -> Iterator[Case]:
    """All of them."""
    for form in (*FORMS, *(kind for kind in ("usda", "usdc") if kind in meshes())):
        yield from _of_form(form)
    yield from _promises()
    yield from _objects()
    yield from _flips()
    yield from _names()


def _of_form(form: str) -> Iterator[Case]:
    content, file = meshes()[form], f"mesh{ending(form)}"

    def case(what: str, spoilt: bytes | None, wanted: str = "refused|found", says: str = "") -> Case:
        name = f"{form}: {what}"
        return Case(f"mesh: {name}", f"check {file}", wanted, {file: spoilt}, says, small=name in SMALL)

    yield case("as it is", content, "completed", READ)
    yield case("empty", b"")
    yield case("cut in half", content[: len(content) // 2], "refused|found|completed")
    yield case("garbage", bytes((7 * k * k + k) % 251 for k in range(3000)))
    yield case("zeros", bytes(4096))
    yield case("a directory", None)


def _promises() -> Iterator[Case]:
    huge = b"999999999999"
    made = meshes()
    for name, content in {
        "ply: promises 10^12": made["ply"].replace(b"element vertex 12", b"element vertex " + huge),
        "ply: promises 10^12 faces": made["ply, text"].replace(b"element face 20", b"element face " + huge),
        "vtk: promises 10^12": re.sub(rb"POINTS \d+", b"POINTS " + huge, made["vtk"]),
        "vtk, text: promises 10^12": re.sub(rb"CELLS \d+", b"CELLS " + huge, made["vtk, text"]),
        "vtu: promises 10^12": re.sub(rb'NumberOfPoints="\d+"', b'NumberOfPoints="%b"' % huge, made["vtu"]),
        "msh, text: promises 10^12": re.sub(rb"\$Nodes\n\d+", b"$Nodes\n" + huge, made["msh, text"]),
        "stl: promises 4*10^9": made["stl"][:80] + struct.pack("<I", 2**32 - 1) + made["stl"][84:],
        "off: promises 10^12": b"OFF\n%b %b 0\n0 0 0\n" % (huge, huge),
        "glb: promises 10^12": re.sub(rb'"count":\d+', b'"count":' + huge, made["glb"]),
        "glb: a ring of nodes": glb(
            '{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"children":[1]},{"children":[0]}],'
            '"meshes":[],"accessors":[]}'
        ),
    }.items():
        file = f"mesh{ending(name.split(':')[0])}"
        yield Case(f"mesh: {name}", f"check {file}", "refused|found", {file: content}, small=name in SMALL)


def _objects() -> Iterator[Case]:
    """OBJ texts."""
    groups = "g " + " ".join(f"g{k}" for k in range(8000))
    for name, text, wanted in (
        ("8,000 groups in a line", TRIANGLE + groups + "\n" + "f 1 2 3\n" * 300, "refused|found"),
        ("a face of 200,000 corners", TRIANGLE + "f " + "1 2 3 " * 66_667 + "\n", "refused|found|completed"),
        ("a vertex at 1e400", TRIANGLE.replace("v 1 0 0", "v 1e400 0 0"), "refused|found"),
        ("a vertex that is nan", TRIANGLE.replace("v 1 0 0", "v nan 0 0"), "refused|found"),
        ("a vertex at 1e300", TRIANGLE.replace("v 1 0 0", "v 1e300 0 0"), "refused|found|completed"),
        ("a face of vertex 3*10^9", TRIANGLE.replace("f 1 2 3", "f 1 2 3000000000"), "refused|found"),
        ("a face of vertex 10^4000", TRIANGLE.replace("f 1 2 3", "f 1 2 " + "9" * 4000), "refused|found"),
        ("a face of vertex 0", TRIANGLE.replace("f 1 2 3", "f 0 1 2"), "refused|found"),
        ("a face of vertex -9", TRIANGLE.replace("f 1 2 3", "f -9 1 2"), "refused|found"),
        ("a face with one corner twice", TRIANGLE.replace("f 1 2 3", "f 1 1 2"), "refused|found"),
        ("vertices in one place", "v 0 0 0\n" * 3 + "f 1 2 3\n", "refused|found"),
        ("points alone", "v 0 0 0\n" * 100, "refused|found"),
        ("one line of 10 MB", "v " + "0 " * 5_000_000, "refused|found"),
        ("300,000 empty lines", "\n" * 300_000 + TRIANGLE, "completed"),
        ("control characters in a group", TRIANGLE.replace("f ", "g \x1b[2J\x07x\nf "), "completed"),
        ("a material of another folder", "mtllib ../outside/thesis.txt\n" + TRIANGLE, "completed"),
        ("three triangles on one edge", TRIANGLE + "v 0 0 1\nv 0 0 -1\nf 1 2 4\nf 1 2 5\n", "found|completed"),
        ("both sides of one triangle", TRIANGLE + "f 3 2 1\n", "found|completed"),
    ):
        yield Case(f"obj: {name}", "check mesh.obj", wanted, {"mesh.obj": text})
    yield Case("obj: UTF-16", "check mesh.obj", "refused", {"mesh.obj": TRIANGLE.encode("utf-16")})
    yield Case("obj: a scale of nan", "check mesh.obj --scale nan", "refused", {"mesh.obj": TRIANGLE})
    yield Case(
        "obj: a scale of 1e300", "check mesh.obj --scale 1e300", "refused|found|completed", {"mesh.obj": TRIANGLE}
    )
    yield Case("obj: component 10^9", "check mesh.obj --component 999999999", "refused", {"mesh.obj": TRIANGLE})
    text = with_mesh("mesh.obj")
    yield Case("obj: as cloth, empty", "run a.toml -o out", "refused", {"a.toml": text, "mesh.obj": ""})
    yield Case("obj: as cloth, one point", "run a.toml -o out", "refused", {"a.toml": text, "mesh.obj": "v 0 0 0\n"})
    bow = "v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\n"
    yield Case(
        "obj: as cloth, a bow tie", "run a.toml -o out", "refused|found|completed", {"a.toml": text, "mesh.obj": bow}
    )
    yield Case(
        "obj: as cloth, no area",
        "run a.toml -o out",
        "refused",
        {"a.toml": text, "mesh.obj": "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"},
    )


def _flips() -> Iterator[Case]:
    """One byte of a binary file, another one in each case."""
    for form in ("usdc", "glb", "ply", "stl", "vtu"):
        if form not in meshes():
            continue
        content, file = meshes()[form], f"mesh{ending(form)}"
        for k in range(6 if form == "usdc" else 3):
            flipped = bytearray(content)
            place = (97 + 211 * k) % len(content)
            flipped[place] ^= 0xFF >> k
            yield Case(
                f"mesh: {form}, byte {place} flipped",
                f"check {file}",
                "refused|found|completed",
                {file: bytes(flipped)},
            )


def _names() -> Iterator[Case]:
    """Names that are no files."""

    def linked(target: str) -> Callable[[Path], None]:
        return lambda folder: os.symlink(target, folder / "mesh.obj")

    for name, make in (
        ("a pipe without a writer", lambda folder: os.mkfifo(folder / "mesh.obj")),
        ("a link to /dev/zero", linked("/dev/zero")),
        ("a link to itself", linked("mesh.obj")),
        ("a link to nothing", linked("nothing.obj")),
        ("a link to /proc/self/mem", linked("/proc/self/mem")),
        (
            "a terabyte of nothing",
            lambda folder: os.truncate(os.open(folder / "mesh.obj", os.O_CREAT | os.O_RDWR), 1 << 40),
        ),
    ):
        yield Case(f"name: {name}", "check mesh.obj", "refused", make)
    long = f"{'a' * 252}.obj"
    yield Case("name: 256 bytes", ["check", long], "refused", small=True)
    yield Case("name: 256 bytes in a scene", "check a.toml", "refused|found", {"a.toml": with_mesh(long)})
    yield Case(
        "name: 5,000 bytes in a scene", "run a.toml -o out", "refused", {"a.toml": with_mesh("b/" * 2500 + "a.obj")}
    )
    yield Case("name: NUL in a scene", "run a.toml -o out", "refused", {"a.toml": with_mesh("a\\u0000.obj")})
    yield Case("name: no ending", "check mesh", "refused", {"mesh": TRIANGLE})
    yield Case("name: unknown ending", "check mesh.docx", "refused", {"mesh.docx": TRIANGLE})
    yield Case("name: a line break", ["check", "a\nb.obj"], "completed", {"a\nb.obj": TRIANGLE})
    yield Case(
        "name: not UTF-8",
        ["check", os.fsdecode(b"\xff\xfe.obj")],
        "completed",
        lambda folder: (folder / os.fsdecode(b"\xff\xfe.obj")).write_text(TRIANGLE) and None,
    )
    yield Case("name: starts with a minus", ["check", "--", "-a.obj"], "completed", {"-a.obj": TRIANGLE})
