"""Rigged glTF files: two bones posed as hand-made skinning, and each fault refused with one sentence."""

import base64
import contextlib
import json

import numpy as np
import pytest
from glb_files import BONE, POSITIONS, TRIANGLES, WEIGHTS, two_bones

from clothsim.base.errors import InputError
from clothsim.files.characters.gltf_character import read_character
from clothsim.mesh.body import rotation_matrix

TURNS = {"root": np.array([0.2, -0.4, 0.9]), "tip": np.array([1.1, 0.3, -0.2])}


def by_hand(points, turns=TURNS):
    """The bar with the bones turned from rest in the axes of the space."""
    root = rotation_matrix(turns["root"])
    tip = root @ rotation_matrix(turns["tip"])
    ends = points @ root.T, (points - BONE) @ tip.T + root @ BONE
    return WEIGHTS[:, :1].astype(float) * ends[0] + WEIGHTS[:, 1:].astype(float) * ends[1]


def written(tmp_path, glb):
    path = tmp_path / "bar.glb"
    path.write_bytes(glb.bytes())
    return path


def test_two_bones_pose_as_by_hand(tmp_path):
    character = read_character(written(tmp_path, two_bones()))
    np.testing.assert_array_equal(character.triangles, TRIANGLES)
    np.testing.assert_allclose(character.vertices(character.skeleton.rest), POSITIONS, atol=1e-12)
    posed = character.vertices(character.skeleton.turned(TURNS))
    np.testing.assert_allclose(posed, by_hand(POSITIONS.astype(float)), atol=1e-12)


def test_bones_with_axes_of_their_own(tmp_path):
    axes = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    character = read_character(written(tmp_path, two_bones(axes)))
    posed = character.vertices(character.skeleton.turned(TURNS))
    np.testing.assert_allclose(posed, by_hand(POSITIONS.astype(float)), atol=1e-12)


def test_nodes_in_another_pose_than_the_bound_one(tmp_path):
    glb = two_bones()
    del glb.data["nodes"][1]["matrix"]
    glb.data["nodes"][1] |= {"translation": BONE.tolist(), "rotation": [0.6, 0, 0, 0.8]}
    character = read_character(written(tmp_path, glb))
    np.testing.assert_allclose(character.vertices(character.skeleton.rest), POSITIONS, atol=1e-12)


def test_an_armature_in_centimetres(tmp_path):
    glb = two_bones()
    glb.data["nodes"].append({"name": "armature", "scale": [0.01] * 3, "children": [2]})
    character = read_character(written(tmp_path, glb))
    np.testing.assert_allclose(character.vertices(character.skeleton.rest), 0.01 * POSITIONS, atol=1e-12)
    posed = character.vertices(character.skeleton.turned(TURNS))
    np.testing.assert_allclose(posed, 0.01 * by_hand(POSITIONS.astype(float)), atol=1e-12)


def test_morph_targets_by_name(tmp_path):
    target = np.arange(18).reshape(6, 3) / 16
    path = written(tmp_path, two_bones(target=target))
    character = read_character(path, {"fat": 0.5})
    posed = character.vertices(character.skeleton.turned(TURNS))
    np.testing.assert_allclose(posed, by_hand(POSITIONS + 0.5 * target), atol=1e-12)
    with pytest.raises(InputError, match=r"thin.*fat"):
        read_character(path, {"thin": 1.0})


def test_sparse_targets(tmp_path):
    glb = two_bones(target=np.zeros((6, 3)))
    number = glb.data["meshes"][0]["primitives"][0]["targets"][0]["POSITION"]
    indices, values = glb.accessor([1, 4], "H"), glb.accessor([[0, 0, 1], [0, 0, 2.0]])
    views = [glb.data["accessors"][k]["bufferView"] for k in (indices, values)]
    del glb.data["accessors"][number]["bufferView"]
    glb.data["accessors"][number]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": views[0], "componentType": 5123},
        "values": {"bufferView": views[1]},
    }
    found = read_character(written(tmp_path, glb), {"fat": 1.0}).positions
    np.testing.assert_allclose((found - POSITIONS)[:, 2], [0, 1, 0, 0, 2, 0])


def test_vertices_split_for_texture_are_joined(tmp_path):
    glb = two_bones()
    primitive = glb.data["meshes"][0]["primitives"][0]
    rows = TRIANGLES.ravel()
    joints = np.tile([0, 1, 0, 0], (len(rows), 1))
    weights = np.concatenate([WEIGHTS, np.zeros_like(WEIGHTS)], axis=1)[rows]
    primitive["attributes"] = {
        "POSITION": glb.accessor(POSITIONS[rows]),
        "JOINTS_0": glb.accessor(joints, "H"),
        "WEIGHTS_0": glb.accessor(weights),
    }
    del primitive["indices"]
    character = read_character(written(tmp_path, glb))
    assert character.positions.shape == (6, 3)
    np.testing.assert_array_equal(character.positions[character.triangles], POSITIONS[TRIANGLES])


def test_a_gltf_with_its_buffer_in_the_text_or_beside_it(tmp_path):
    glb = two_bones()
    glb.data["buffers"] = [{"byteLength": len(glb.binary), "uri": "bar.bin"}]
    (tmp_path / "bar.bin").write_bytes(glb.binary)
    (tmp_path / "bar.gltf").write_text(json.dumps(glb.data))
    beside = read_character(tmp_path / "bar.gltf").positions
    text = base64.b64encode(glb.binary).decode()
    glb.data["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{text}"
    (tmp_path / "text.gltf").write_text(json.dumps(glb.data))
    np.testing.assert_array_equal(beside, POSITIONS)
    np.testing.assert_array_equal(read_character(tmp_path / "text.gltf").positions, POSITIONS)


SPOILT = {
    "version": lambda data: data["asset"].update(version="1.0"),
    "draco": lambda data: data.update(extensionsRequired=["KHR_draco_mesh_compression"]),
    "skin": lambda data: data["nodes"][0].pop("skin"),
    "count": lambda data: data["accessors"][0].update(count=10**9),
    "no_number": lambda data: data["accessors"][0].update(count="many"),
    "view": lambda data: data["bufferViews"][0].update(byteLength=10**9),
    "cycle": lambda data: data["nodes"][1].update(children=[2]),
    "parents": lambda data: data["nodes"].append({"children": [1]}),
    "joint": lambda data: data["skins"][0].update(joints=[2]),
    "node": lambda data: data["skins"][0].update(joints=[2, 77]),
    "type": lambda data: data["accessors"][0].update(type="VEC2"),
    "number": lambda data: data["nodes"].append({"translation": ["a", 0, 0]}),
    "table": lambda data: data["meshes"][0].update(primitives=7),
    "zeros": lambda data: (data["accessors"][0].update(count=10**11), data["accessors"][0].pop("bufferView")),
}


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=SPOILT)
def test_a_fault_is_named(tmp_path, spoil):
    glb = two_bones()
    spoil(glb.data)
    with pytest.raises(InputError) as caught:
        read_character(written(tmp_path, glb))
    assert "bar.glb" in caught.value.sentence
    assert "\n" not in caught.value.sentence


def test_a_buffer_outside_of_the_folder_is_refused(tmp_path):
    glb = two_bones()
    glb.data["buffers"][0]["uri"] = "../secret"
    (tmp_path / "bar.gltf").write_text(json.dumps(glb.data))
    with pytest.raises(InputError, match="outside"):
        read_character(tmp_path / "bar.gltf")


def test_every_cut_and_many_flipped_bytes_end_in_a_sentence(tmp_path):
    content, path = two_bones().bytes(), tmp_path / "cut.glb"
    rng = np.random.default_rng(5)
    for size in rng.integers(0, len(content), 60):
        path.write_bytes(content[:size])
        with pytest.raises(InputError):
            read_character(path)
    for _ in range(300):
        flipped = bytearray(content)
        for at in rng.integers(0, len(content), 2):
            flipped[at] = rng.integers(0, 256)
        path.write_bytes(bytes(flipped))
        with contextlib.suppress(InputError):
            assert np.isfinite(read_character(path).positions).all()


def test_a_missing_file_and_a_missing_group(tmp_path):
    with pytest.raises(InputError, match=r"none\.glb"):
        read_character(tmp_path / "none.glb")
    with pytest.raises(InputError, match="bar"):
        read_character(written(tmp_path, two_bones()), group="hat")
    assert len(read_character(written(tmp_path, two_bones()), group="bar").positions) == 6
