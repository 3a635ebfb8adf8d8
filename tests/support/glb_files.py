"""GLB files made by hand: a bar on two bones, and what spoils it."""

import copy
import json
import struct

import numpy as np

KINDS = {"f": 5126, "H": 5123, "B": 5121, "I": 5125}
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0], [1, 2, 0.5]], np.float32)
TRIANGLES = np.array([[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]], np.uint16)
WEIGHTS = np.array([[1, 0], [1, 0], [0.5, 0.5], [0.25, 0.75], [0, 1], [0, 1]], np.float32)
BONE = np.array([0.0, 1.0, 0.0])
"""Position of the second bone; the first is at the origin."""


ALONG = np.eye(3), np.eye(3)
"""Axes of bones that are those of the space."""


class Glb:
    """JSON and binary chunk of a GLB file that grows by accessors."""

    def __init__(self):
        self.data = {"asset": {"version": "2.0"}, "buffers": [{}], "bufferViews": [], "accessors": []}
        self.binary = b""

    def accessor(self, values, letter="f"):
        array = np.atleast_2d(np.asarray(values))
        array = array.T if np.ndim(values) == 1 else array
        packed = array.astype(f"<{np.dtype(letter).str[1:]}").tobytes()
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.data["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(packed)})
        self.binary += packed
        view = len(self.data["bufferViews"]) - 1
        entry = {"bufferView": view, "componentType": KINDS[letter], "count": len(array), "type": TYPES[array.shape[1]]}
        self.data["accessors"].append(entry)
        return len(self.data["accessors"]) - 1

    def bytes(self):
        data = copy.deepcopy(self.data)
        data["buffers"] = [{"byteLength": len(self.binary)}]
        text = json.dumps(data).encode()
        text += b" " * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def two_bones(axes=ALONG, target=None, keys=None, path="rotation", interpolation="LINEAR"):
    """A bar on two bones with `axes` at rest; target (n, 3): a morph target; keys: (times, values) of the second."""
    glb = Glb()
    matrices = []
    for axis, position in zip(axes, (np.zeros(3), BONE), strict=True):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = axis.T, -axis.T @ position
        matrices.append(matrix.T.ravel())
    joints = np.tile([0, 1, 0, 0], (len(POSITIONS), 1))
    weights = np.concatenate([WEIGHTS, np.zeros_like(WEIGHTS)], axis=1)
    attributes = {
        "POSITION": glb.accessor(POSITIONS),
        "JOINTS_0": glb.accessor(joints, "B"),
        "WEIGHTS_0": glb.accessor(weights),
    }
    primitive = {"attributes": attributes, "indices": glb.accessor(TRIANGLES.ravel(), "H")}
    mesh = {"name": "bar", "primitives": [primitive]}
    if target is not None:
        primitive["targets"] = [{"POSITION": glb.accessor(target)}]
        mesh["extras"] = {"targetNames": ["fat"]}
    first, second = np.eye(4), np.eye(4)
    first[:3, :3] = axes[0]
    second[:3, :3], second[:3, 3] = axes[0].T @ axes[1], axes[0].T @ BONE
    glb.data |= {
        "meshes": [mesh],
        "nodes": [
            {"name": "body", "mesh": 0, "skin": 0},
            {"name": "tip", "matrix": second.T.ravel().tolist()},
            {"name": "root", "matrix": first.T.ravel().tolist(), "children": [1]},
        ],
        "skins": [{"joints": [2, 1], "inverseBindMatrices": glb.accessor(np.array(matrices))}],
    }
    if keys is not None:
        sampler = {"input": glb.accessor(keys[0]), "output": glb.accessor(keys[1]), "interpolation": interpolation}
        channel = {"sampler": 0, "target": {"node": 1, "path": path}}
        glb.data["animations"] = [{"name": "wave", "samplers": [sampler], "channels": [channel]}]
    return glb
