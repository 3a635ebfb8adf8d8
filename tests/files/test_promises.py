"""Small files that promise gigabytes: refused before anything of that size is built."""

import json
import tracemalloc

import numpy as np
import pytest

from clothsim import InputError
from clothsim.files.characters import gltf_file
from clothsim.files.characters.gltf_file import node_order, read_gltf
from clothsim.files.characters.motion_files import read_amass, read_bvh
from clothsim.files.patterns.dxf.drawing import read_drawing
from clothsim.patterns.specification import read_specification

MB = 1 << 20
JOINT = "HIERARCHY\nROOT a\n{{\nOFFSET 0 0 0\n{channels}\n}}\nMOTION\nFrames: {frames}\nFrame Time: 1\n"


def refused(function, name):
    """Largest memory of a call that is refused with the name of the file [bytes]."""
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=name):
            function()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("channels", ["", "CHANNELS 0"])
def test_a_bvh_of_1e8_frames_without_channels(tmp_path, channels):
    """It took 2.6 GB: 0 numbers are as many as it says."""
    file = tmp_path / "still.bvh"
    file.write_text(JOINT.format(channels=channels, frames=100_000_000))
    assert file.stat().st_size < 100
    assert refused(lambda: read_bvh(file), "still.bvh") < MB


def test_a_bvh_of_one_channel_and_many_joints(tmp_path):
    """Frames x joints are counted: each joint without channels takes four numbers a frame."""
    file = tmp_path / "wide.bvh"
    inner = "CHANNELS 1 Xrotation\n" + "JOINT b\n{\nOFFSET 0 1 0\n}\n" * 1500
    file.write_text(JOINT.format(channels=inner, frames=6000) + "0 " * 6000)
    assert refused(lambda: read_bvh(file), "wide.bvh") < 16 * MB


def test_an_amass_archive_of_half_a_megabyte_with_500_inside(tmp_path):
    file = tmp_path / "zeros.npz"
    frames = 400_000
    np.savez_compressed(file, poses=np.zeros((frames, 156)), trans=np.zeros((frames, 3)), mocap_framerate=120.0)
    assert file.stat().st_size < MB
    assert refused(lambda: read_amass(file), "zeros.npz") < MB


def chain(nodes):
    return {
        "asset": {"version": "2.0"},
        "nodes": [{"children": [k + 1]} if k + 1 < nodes else {} for k in range(nodes)],
    }


def test_a_chain_of_50000_nodes(tmp_path):
    file = tmp_path / "chain.gltf"
    file.write_text(json.dumps(chain(50_000)))
    deep = read_gltf(file)
    assert refused(lambda: node_order(deep), "chain.gltf") < MB
    file.write_text(json.dumps(chain(9_000)))
    order, parents = node_order(read_gltf(file))
    assert order == list(range(9_000))
    assert parents.tolist() == [-1, *range(8_999)]
    assert len(gltf_file.node_names(read_gltf(file), order[:500])) == 500


def test_the_nodes_of_a_file_are_looked_through_once(tmp_path):
    file = tmp_path / "chain.gltf"
    file.write_text(json.dumps(chain(100)))
    read = read_gltf(file)
    assert read.table("nodes") is read.table("nodes")
    assert read.table("skins") == []


def test_accessors_without_bytes_are_counted_together(tmp_path):
    accessor = {"componentType": 5126, "count": 10_000_000, "type": "VEC3"}
    file = tmp_path / "zeros.gltf"
    file.write_text(json.dumps({"asset": {"version": "2.0"}, "accessors": [accessor] * 3}))
    read = read_gltf(file)
    read.budget.spend("values", 60_000_000)
    assert refused(lambda: read.array(0, 3), "zeros.gltf") < MB


def test_a_key_that_is_given_twice_behind_many(tmp_path):
    """It was looked for in all keys before each: 10^10 comparisons."""
    file = tmp_path / "twice.json"
    file.write_text("{" + ",".join(f'"{k}":0' for k in (*range(200_000), 199_999)) + "}")
    with pytest.raises(InputError, match="199999"):
        read_specification(file)


def drawing(tmp_path, draw):
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.new()
    draw(document.blocks.new("front"))
    document.saveas(tmp_path / "bomb.dxf")
    return tmp_path / "bomb.dxf"


OUTLINE = {"layer": "1"}


def large_ellipses(block):
    for _ in range(40):
        block.add_ellipse((0, 0), major_axis=(1e9, 0), ratio=0.5, dxfattribs=OUTLINE)


def huge_spline(block):
    block.add_open_spline([(0, 0), (1e9, 3e9), (-4e9, 1e9), (1e9, 0), (7e9, 2e9)], dxfattribs=OUTLINE)


def spline_without_end(block):
    block.add_open_spline([(0, 0), (1e300, 1e300), (-1e300, 1e300), (1e300, 0), (3, 2)], dxfattribs=OUTLINE)


def long_polyline(block):
    block.add_lwpolyline([(k % 100, k // 100) for k in range(20_000)], dxfattribs=OUTLINE)


@pytest.mark.parametrize("draw", [large_ellipses, huge_spline, spline_without_end, long_polyline])
def test_a_drawing_whose_curves_have_no_bound(tmp_path, draw):
    """20 kB of ellipses took 568 MB."""
    file = drawing(tmp_path, draw)
    assert refused(lambda: read_drawing(file), "bomb.dxf") < 64 * MB
