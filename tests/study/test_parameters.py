"""Parameters: scene of each level, and reasons for missing parameters."""

from fractions import Fraction

import numpy as np
import pytest
from small_scenes import SOLVER, small_scene, without

from clothsim.base.errors import InputError
from clothsim.scene.assembly.refinement import with_cells
from clothsim.scene.assembly.scene_world import build
from clothsim.study.parameters import PARAMETERS, newton_parameter, usable, with_explicit_lengths
from clothsim.study.points import PRESETS, with_preset

FRICTION = {"friction": {"coefficient": 0.2}}


def base_of(**sections):
    scene = small_scene(**sections)
    return with_explicit_lengths(scene, build(scene).energies)


def test_what_the_mesh_chose_is_written_out():
    base = base_of(effects={**without(), **FRICTION})
    assert base.effects["body_contact"]["d_hat"] == pytest.approx(0.1 * 0.25, rel=0.5)
    finer = PARAMETERS["cells"].put(base, base, 1)
    assert finer.cloth["cells"] == (8, 8)
    assert finer.effects["body_contact"]["d_hat"] == base.effects["body_contact"]["d_hat"]


@pytest.mark.parametrize(
    ("parameter", "path", "values"),
    [
        ("dt", ("solver", "dt"), {-1: 0.04, 0: 0.02, 1: 0.01}),
        ("tolerance", ("solver", "tolerance"), {-1: 4e-3, 1: 2.5e-4}),
    ],
)
def test_levels_are_powers_of_two(parameter, path, values):
    base = base_of(solver={**SOLVER, "tolerance": 1e-3})
    for level, value in values.items():
        scene = PARAMETERS[parameter].put(base, base, level)
        assert getattr(scene, path[0]).get(path[1], 1e-3) == pytest.approx(value)


def test_each_frame_ends_a_step():
    base = base_of(solver={"dt": 0.03}, run={"duration": 0.2, "frames_per_second": 25})
    assert base.solver["dt"] == pytest.approx(0.02)
    with pytest.raises(InputError, match="each frame ends a step"):
        PARAMETERS["dt"].value(base, -2)


def test_a_scene_without_contact_and_friction_has_no_such_parameters():
    found, missing = usable(base_of(effects=without("body_contact")), None)
    assert set(found) == {"dt", "cells", newton_parameter(base_of())}
    assert missing["d_hat"] == "the scene has no contact"
    assert missing["iterations"] == "the scene has no friction"


def test_pins_by_number_follow_their_material_places():
    effects = {**without("body_contact"), "pins": {"select": [4, 24]}}
    scene = small_scene(effects=effects)
    finer = with_cells(scene, Fraction(2))
    assert finer.effects["pins"]["select"] == (8, 80)
    assert with_cells(finer, Fraction(1, 2)).effects["pins"]["select"] == (4, 24)
    with pytest.raises(InputError, match="names neighbouring vertices by number"):
        with_cells(small_scene(effects={**effects, "pins": {"select": [3, 4]}}), Fraction(2))


def test_springs_by_number_follow_their_material_places():
    springs = {"spring": [{"select": [4, 24], "stiffness": 1.0}, {"select": "left", "stiffness": 1.0}]}
    finer = with_cells(small_scene(effects={"inertia": {}, "springs": springs}), Fraction(2))
    assert [spring["select"] for spring in finer.effects["springs"]["spring"]] == [(8, 80), "left"]
    springs["spring"][0]["select"] = [3, 4]
    with pytest.raises(InputError, match=r"springs\.spring\[0\] names neighbouring vertices"):
        with_cells(small_scene(effects={"inertia": {}, "springs": springs}), Fraction(2))


@pytest.mark.parametrize(
    ("effects", "name"),
    [
        ({"seams": {"seam": [{"from": {"side": "left"}, "to": {"vertices": [4, 9]}}]}}, r"seams\.seam\[0\]\.to"),
        ({"rest_angle": {"crease": [{"vertices": [7, 12], "angle_degrees": 30.0}]}}, r"rest_angle\.crease\[0\]"),
    ],
)
def test_lines_of_vertex_numbers_belong_to_one_mesh(effects, name):
    with pytest.raises(InputError, match=rf"effects\.{name}\.vertices are those of one mesh"):
        with_cells(small_scene(effects={"inertia": {}, **effects}), Fraction(2))


@pytest.mark.parametrize(
    ("cloth", "sentence"),
    [
        ({"mesh": "rectangle", "cells": [4, 5]}, "not whole numbers"),
        ({"mesh": "sheet.obj"}, "is a file without cells"),
        ({"mesh": "skirt"}, "is a generated skirt without cells"),
    ],
)
def test_meshes_without_coarser_cells_are_reported(cloth, sentence):
    with pytest.raises(InputError, match=sentence):
        with_cells(small_scene(cloth=cloth), Fraction(1, 2))


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_sets_what_its_table_gives(name):
    scene, output = with_preset(small_scene(), name)
    preset = PRESETS[name]
    assert scene.solver["dt"] == preset.dt
    assert scene.solver["integrator"] == "bdf2"
    assert scene.effects["bending"]["model"] == "midedge"
    assert scene.cloth["cells"] == (4 * preset.cells,) * 2
    assert f"dt {preset.dt:g} s" in output
    build(scene)


def test_a_file_keeps_its_mesh_under_a_preset():
    scene, output = with_preset(small_scene(cloth={"mesh": "sheet.obj"}), "draft")
    assert scene.cloth == {"mesh": "sheet.obj"}
    assert "the mesh as it is" in output
    with pytest.raises(InputError, match="preset 'drat'"):
        with_preset(small_scene(), "drat")


def test_the_presets_refine_dt_cells_and_d_hat_together():
    given = small_scene(effects={"membrane": {}, "body_contact": {"d_hat": 4e-3}}, solver={"tolerance": 1e-3})
    chain = [with_preset(given, name)[0] for name in ("draft", "standard", "fine")]
    assert [scene.effects["body_contact"]["d_hat"] for scene in chain] == [4e-3, 2e-3, 1e-3]
    for coarse, fine in zip(chain, chain[1:], strict=False):
        assert coarse.solver["dt"] == 2 * fine.solver["dt"]
        assert tuple(2 * count for count in coarse.cloth["cells"]) == fine.cloth["cells"]
        assert "tolerance" not in fine.solver


def test_selected_vertices_may_be_an_array():
    scene = small_scene(effects={**without(), "pins": {"select": np.array([0, 4, 20, 24])}})
    assert len(with_cells(scene, Fraction(2)).effects["pins"]["select"]) == 4


@pytest.mark.parametrize("drag", [np.ones(32), "drag.npy"])
def test_numbers_of_one_mesh_stay_with_it(drag):
    scene = small_scene(effects={**without(), "air": {"drag": drag, "wind": [1.0, 0.0, 0.0]}})
    with pytest.raises(InputError, match=r"effects\.air\.drag has values for one mesh"):
        with_cells(scene, Fraction(2))
