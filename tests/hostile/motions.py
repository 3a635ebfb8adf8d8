"""Hostile characters and motions: glTF, BVH, AMASS, MakeHuman clothes, frames."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tests.hostile.case import BAD, Case
from tests.hostile.stock import changed, glb, npy, npz, with_body, with_mesh

JOINT = (
    "HIERARCHY\nROOT Hips\n{{\nOFFSET 0 0 0\n{channels}\n}}\nMOTION\nFrames: {frames}\nFrame Time: {step}\n{numbers}\n"
)


def cases() -> Iterator[Case]:
    """All of them."""
    yield from _characters()
    yield from _motions()
    yield from _frames()


def chain(nodes: int) -> list[dict[str, Any]]:
    """Nodes, each the child of the one before."""
    return [{"children": [k + 1]} if k + 1 < nodes else {} for k in range(nodes)]


def skinned(nodes: int, /, **changes: Any) -> str:
    """A triangle that is bound to the last of a chain of nodes."""
    floats = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    weights = np.tile(np.array([1, 0, 0, 0], "<f4"), (3, 1)).tobytes()
    joints = np.zeros((3, 4), "<u2").tobytes()
    binary = floats + weights + joints
    import base64

    uri = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    tree = [*chain(nodes), {"mesh": 0, "skin": 0}]
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, nodes]}],
        "nodes": tree,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "WEIGHTS_0": 1, "JOINTS_0": 2}}]}],
        "skins": [{"joints": [nodes - 1]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC4"},
            {"bufferView": 2, "componentType": 5123, "count": 3, "type": "VEC4"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 48},
            {"buffer": 0, "byteOffset": 84, "byteLength": 24},
        ],
        "buffers": [{"byteLength": len(binary), "uri": uri}],
    }
    return json.dumps({**document, **changes})


def _characters() -> Iterator[Case]:
    scene = with_body('name = "ball"\nmodel = "who.gltf"')

    def case(what: str, content: str | bytes, wanted: str = BAD, small: bool = False) -> Case:
        return Case(f"character: {what}", "check a.toml", wanted, {"a.toml": scene, "who.gltf": content}, small=small)

    yield case("a triangle on a chain of 3 nodes", skinned(3), "found|completed|refused")
    yield case("a chain of 9,000 nodes", skinned(9000), "found|completed|refused")
    yield case("a chain of 50,000 nodes", skinned(50_000), small=True)
    yield case("a node that is its own child", skinned(3, nodes=[{"children": [0]}, {}, {}, {"mesh": 0, "skin": 0}]))
    yield case(
        "a node of two parents", skinned(3, nodes=[{"children": [2]}, {"children": [2]}, {}, {"mesh": 0, "skin": 0}])
    )
    yield case("a joint that is not there", skinned(3, skins=[{"joints": [99]}]))
    yield case("100,000 joints that are one", skinned(3, skins=[{"joints": [1] * 100_000}]), "refused|found|completed")
    yield case("a skin of words", skinned(3, skins=[{"joints": "all"}]))
    yield case("nodes that are numbers", skinned(3, nodes=[1, 2, 3]))
    yield case("children that are words", skinned(3, nodes=[{"children": "x"}, {}, {}, {"mesh": 0, "skin": 0}]))
    yield case("a buffer of another folder", skinned(3, buffers=[{"byteLength": 108, "uri": "../outside/thesis.txt"}]))
    yield case("a buffer of /dev/zero", skinned(3, buffers=[{"byteLength": 108, "uri": "/dev/zero"}]))
    yield case("a buffer of %2e%2e", skinned(3, buffers=[{"byteLength": 108, "uri": "%2e%2e/outside/thesis.txt"}]))
    yield case("a buffer of http", skinned(3, buffers=[{"byteLength": 108, "uri": "http://127.0.0.1/x"}]))
    yield case(
        "a count of 10^11 without bytes",
        skinned(3, accessors=[{"componentType": 5126, "count": 10**11, "type": "VEC3"}] * 3),
    )
    yield case("a count of -1", skinned(3, accessors=[{"componentType": 5126, "count": -1, "type": "VEC3"}] * 3))
    yield case(
        "a view beyond its buffer",
        skinned(3, bufferViews=[{"buffer": 0, "byteOffset": 10**9, "byteLength": 10**9}] * 3),
    )
    yield case("a matrix of nan", skinned(3, nodes=[{"matrix": [float("nan")] * 16}, {}, {}, {"mesh": 0, "skin": 0}]))
    yield case("a scale of 1e300", skinned(3, nodes=[{"scale": [1e300] * 3}, {}, {}, {"mesh": 0, "skin": 0}]))
    yield case("lists in lists, 100,000 deep", "[" * 100_000)
    yield case("a number of 5,000 digits", skinned(3).replace('"count": 3', '"count": ' + "9" * 5000))
    yield case("a .glb by that name", glb(skinned(3)), "refused|found|completed")
    yield case("a .glb cut off", glb(skinned(3))[:100])
    yield case("an extension that is needed", skinned(3, extensionsRequired=["KHR_draco_mesh_compression"]))


def _motions() -> Iterator[Case]:
    plain = {"channels": "CHANNELS 3 Zrotation Xrotation Yrotation", "frames": 1, "step": 0.01, "numbers": "0 0 0"}

    def bvh(what: str, small: bool = False, **changes: Any) -> Case:
        files = {
            "a.toml": with_body('name = "ball"\nmodel = "mannequin"\nmotion = "m.bvh"'),
            "m.bvh": JOINT.format(**{**plain, **changes}),
        }
        return Case(f"motion: {what}", "check a.toml", BAD, files, small=small)

    yield bvh("a BVH of 10^8 frames without channels", channels="", frames=10**8, small=True)
    yield bvh("a BVH of 10^12 frames", frames=10**12)
    yield bvh("a BVH of -1 frames", frames=-1)
    yield bvh("a BVH of no frame", frames=0, numbers="")
    yield bvh("a BVH with a step of 0", step=0)
    yield bvh("a BVH with a step of nan", step="nan")
    yield bvh("a BVH with a step of 1e-300", step="1e-300")
    yield bvh("a BVH of words", numbers="a b c")
    yield bvh("a BVH of nan", numbers="nan nan nan")
    yield bvh("a BVH of 1e300", numbers="1e300 1e300 1e300")
    yield bvh("a BVH of 10^6 channels", channels="CHANNELS 1000000 Xrotation")
    yield bvh("a BVH of unknown channels", channels="CHANNELS 1 Wrotation")
    yield bvh("a BVH without an end", channels="JOINT a\n{\n" * 5000)
    scene = with_body('name = "ball"\nmodel = "mannequin"\nmotion = "m.npz"')

    def large(folder: Path) -> None:
        """Made where the case is run: it takes 500 MB and seconds to pack."""
        (folder / "a.toml").write_text(scene)
        poses, trans = np.zeros((400_000, 156)), np.zeros((400_000, 3))
        (folder / "m.npz").write_bytes(npz(True, poses=poses, trans=trans, mocap_framerate=120.0))

    yield Case("motion: an AMASS archive of .5 MB with 500 inside", "check a.toml", BAD, large)
    for name, content in {
        "an AMASS archive without poses": npz(trans=np.zeros((3, 3))),
        "an AMASS archive of words": npz(poses=np.array(["a"]), trans=np.zeros((1, 3)), mocap_framerate=120.0),
        "an AMASS archive of nan": npz(poses=np.full((3, 156), np.nan), trans=np.zeros((3, 3)), mocap_framerate=120.0),
        "an AMASS archive at 0 frames a second": npz(
            poses=np.zeros((3, 156)), trans=np.zeros((3, 3)), mocap_framerate=0.0
        ),
        "an AMASS archive that is a number": npz(poses=np.array(3.0), trans=np.array(1.0), mocap_framerate=120.0),
        "an AMASS archive of garbage": b"PK\x03\x04" + bytes(500),
    }.items():
        yield Case(f"motion: {name}", "check a.toml", BAD, {"a.toml": scene, "m.npz": content})


def _frames() -> Iterator[Case]:
    tet = "v 0 0 {z}\nv 1 0 {z}\nv 0 1 {z}\nv 0 0 {top}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    scene = with_body('name = "ball"\nframes = "f*.obj"')
    first = tet.format(z=-2, top=-1.5)
    for name, files in {
        "none": {},
        "of other meshes": {"f1.obj": first, "f2.obj": first + "f 1 2 3\n"},
        "the second empty": {"f1.obj": first, "f2.obj": ""},
        "the second at nan": {"f1.obj": first, "f2.obj": first.replace("v 1 0 -2", "v nan 0 0")},
        "the second a directory": {"f1.obj": first, "f2.obj": None},
    }.items():
        yield Case(f"frames: {name}", "check a.toml", BAD, {"a.toml": scene, **files})
    outside = changed('"f*.obj"', '"/**/*"', scene)
    yield Case(
        "frames: all files of the machine",
        "check a.toml",
        BAD,
        {"a.toml": changed('"/**/*"', '"/proc/*/fd/*"', outside)},
    )
    clothes = "obj_file ../outside/thesis.txt\nverts 0\n0\n1\n2\n"
    for name, text in {
        "of another folder": clothes,
        "of vertex 10^9": "obj_file a.obj\nverts 0\n999999999\n",
        "of words": "obj_file a.obj\nverts 0\nx\n",
        "empty": "",
        "with a scale of 0": "obj_file a.obj\nx_scale 0 1 0\nverts 0\n0\n",
    }.items():
        files = {"a.mhclo": text, "a.obj": first, "b.obj": first}
        yield Case(f"clothes: {name}", "check a.mhclo --on b.obj", BAD, files)
    for name, content in {
        "words": npy(np.array(["a"])),
        "pickled": npy(np.array([{}], object)),
        "too few": npy(np.ones(2)),
        "nan": npy(np.full(50, np.nan)),
        "negative": npy(np.full(50, -1.0)),
        "empty": b"",
        "a promise": npy(np.ones(50)).replace(b"(50,)", b"(10**9,)"),
    }.items():
        scene = changed("[effects.inertia]", '[effects.damping]\nrate = { cloth = "r.npy" }\n[effects.inertia]')
        yield Case(f"array: {name}", "run a.toml -o out", BAD, {"a.toml": scene, "r.npy": content})
    seed = with_mesh("f1.obj") + '[seed]\nfrom = "file"\nfile = "s.obj"\n'
    for name, text in {
        "empty": "",
        "of other vertices": "v 0 0 0\n" * 9 + "f 1 2 3\n",
        "of nan": first.replace("v 1", "v nan"),
    }.items():
        yield Case(f"seed: {name}", "run a.toml -o out", BAD, {"a.toml": seed, "f1.obj": first, "s.obj": text})
    model = SHEET_MODEL
    for name, content in {
        "empty": b"",
        "of garbage": b"PK" + bytes(99),
        "without arrays": npz(a=np.ones(3)),
        "pickled": npz(format=np.array([{}], object)),
    }.items():
        yield Case(f"seed: a model, {name}", "run a.toml -o out", BAD, {"a.toml": model, "m.npz": content})


SHEET_MODEL = changed("[solver]", '[seed]\nfrom = "model"\nfile = "m.npz"\n[solver]')
