"""Files of views: cameras in each convention, and what is no view in one sentence."""

import numpy as np
import pytest
from PIL import Image

from clothsim import InputError
from clothsim.gradients.camera import Obstacle
from clothsim.gradients.mask_border import MaskBorder
from clothsim.gradients.views import read_views

HEAD = '[[view]]\nname = "a"\nwidth = 8\nheight = 6\n'
POSE = "focal = [9, 9]\nprincipal = [3.5, 2.5]\nrotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nposition = [0, 0, -1]\n"
PANELS = {"front": np.arange(3)}


@pytest.fixture
def folder(tmp_path):
    disc = np.zeros((6, 8), np.uint8)
    disc[2:5, 2:6] = 1
    Image.fromarray(255 * disc).save(tmp_path / "grey.png")
    Image.fromarray(65535 * disc.astype(np.uint16)).save(tmp_path / "deep.png")
    Image.fromarray(255 * disc > 0).save(tmp_path / "bits.png")
    Image.fromarray(np.repeat(255 * disc[..., None], 3, axis=2)).save(tmp_path / "rgb.png")
    Image.fromarray(255 * disc[..., None] * np.array([1, 0, 0], np.uint8)).save(tmp_path / "red.png")
    Image.fromarray(disc).save(tmp_path / "labels.png")
    Image.fromarray(np.zeros((6, 8), np.uint8)).save(tmp_path / "empty.png")
    Image.fromarray(np.full((6, 8), 255, np.uint8)).save(tmp_path / "full.png")
    Image.fromarray(np.zeros((5, 8), np.uint8)).save(tmp_path / "low.png")
    np.save(tmp_path / "normals.npy", disc[..., None] * np.array([0.0, 0.0, -1.0]))
    np.save(tmp_path / "depth.npy", 1.5 * disc)
    np.save(tmp_path / "nothing.npy", 0.0 * disc)
    (tmp_path / "text.png").write_text("no picture")
    return tmp_path


def views(folder, text):
    (folder / "views.toml").write_text(text)
    return read_views(folder / "views.toml", PANELS, Obstacle())


def test_masks_of_each_depth_are_one(folder):
    borders = []
    for name in ("grey", "deep", "bits", "rgb"):
        (view,) = views(folder, f'{HEAD}{POSE}mask = "{name}.png"\n[noise]\nmask = 2.0\n')
        assert view.losses["mask"].noise == 2.0
        borders.append(view.losses["mask"].border[0])
        np.testing.assert_array_equal(borders[0], borders[-1])
    assert len(borders[0]) > 10


def test_what_was_measured(folder):
    text = f'{HEAD}{POSE}labels = "labels.png"\nnormals = "normals.npy"\ndepth = "depth.npy"\n[labels]\nfront = 1\n'
    (view,) = views(folder, text)
    assert list(view.losses) == ["label front", "normals", "depth"]
    assert isinstance(view.losses["label front"], MaskBorder)
    assert view.losses["label front"].label.tolist() == [0, 1, 2]


def test_cameras_of_programs(folder):
    colmap = (
        'mask = "grey.png"\n[view.colmap]\nmodel = "PINHOLE"\nparams = [9, 9, 4, 3]\n'
        "quaternion = [1, 0, 0, 0]\ntranslation = [0, 0, 1]\n"
    )
    blender = (
        'mask = "grey.png"\n[view.blender]\nfield_of_view_degrees = 47.9250\n'
        "matrix_world = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, -1], [0, 0, 0, 1]]\n"
    )
    made = [
        views(folder, text)[0].camera for text in (f'{HEAD}{POSE}mask = "grey.png"\n', HEAD + colmap, HEAD + blender)
    ]
    for other in made[1:]:
        for name in ("focal", "principal", "rotation", "position"):
            np.testing.assert_allclose(getattr(other, name), getattr(made[0], name), atol=1e-3)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "no views"),
        ("view = 3\n", "no views"),
        ("[[view]\n", "TOML"),
        ("[nois]\nmask = 1\n", "nois"),
        (f'[noise]\nmask = -1\n{HEAD}{POSE}mask = "grey.png"\n', "noise.mask"),
        (f'{HEAD}{POSE}mask = "low.png"\n', "8 x 5"),
        (f'{HEAD}{POSE}mask = "empty.png"\n', "empty"),
        (f'{HEAD}{POSE}mask = "full.png"\n', "full"),
        (f'{HEAD}{POSE}mask = "red.png"\n', "red.png"),
        (f'{HEAD}{POSE}mask = "text.png"\n', "text.png"),
        (f'{HEAD}{POSE}mask = "missing.png"\n', "missing.png"),
        (f'{HEAD}{POSE}normals = "depth.npy"\n', "normals"),
        (f'{HEAD}{POSE}depth = "nothing.npy"\n', "depths"),
        (f'{HEAD}{POSE}depth = "grey.png"\n', "grey.png"),
        (f"{HEAD}{POSE}", "no picture"),
        (f'{HEAD}{POSE}labels = "labels.png"\n', "labels"),
        (f'{HEAD}{POSE}labels = "labels.png"\n[labels]\nback = 1\n', "back"),
        (f'{HEAD}{POSE}mask = "grey.png"\ndistortion = [0.1, 0]\n', "distortion"),
        (f'{HEAD}{POSE}mask = "grey.png"\nmsk = 1\n', "msk"),
        (f'{HEAD}mask = "grey.png"\n', "focal"),
        (f'{HEAD.replace("8", "8.5")}{POSE}mask = "grey.png"\n', "whole"),
        (f'{HEAD}{POSE.replace("[1, 0, 0]", "[1, 1, 0]")}mask = "grey.png"\n', "rotation"),
        (f'{HEAD}{POSE}mask = "grey.png"\n' * 2, "two|2 views"),
        (f'{HEAD}mask = "grey.png"\n[view.colmap]\nmodel = "PINHOLE"\n', "params"),
    ],
)
def test_what_is_no_view(folder, text, named):
    with pytest.raises(InputError, match=named):
        views(folder, text)
