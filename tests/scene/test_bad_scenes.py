"""Invalid scenes: one InputError that names the fault and the nearest known name."""

import re

import pytest
from spoilt_scenes import GOOD, cloth, effect, on

from clothsim import InputError, load_scene
from clothsim.scene.assembly.scene_world import build


def built(folder, text):
    file = folder / "scene.toml"
    file.write_text(text)
    return build(load_scene(file))


TWO = on("[cloth]", "[[cloth]]").replace(
    "[[body]]", '[[cloth]]\nmesh = "rectangle"\nname = "{}"\nposition = [0.0, 0.0, 9.0]\n[[body]]'
)

BAD = {
    "unknown section": (on("[solver]", "[solvr]"), "'solvr'", "'solver'"),
    "unknown section, none near": ("[zzz]\n" + GOOD, "'zzz'", "cloth, body"),
    "unknown key of the solver": (on("dt =", "dtt ="), "solver .*'dtt'", "'dt'"),
    "unknown key of the run": (on("duration", "durations"), "run .*'durations'", "'duration'"),
    "unknown key of the cloth": (on("cells =", "cellls ="), "cloth .*'cellls'", "'cells'"),
    "unknown key of the body": (on("subdivisions", "subdivision"), "body .*'subdivision'", "'subdivisions'"),
    "unknown effect": (effect("[effects.gravitty]"), "'gravitty'", "'gravity'"),
    "unknown key of an effect": (effect("[effects.damping]\nrat = 1"), "effects.damping .*'rat'", "'rate'"),
    "unknown material": (on("[effects.membrane]", '[effects.membrane]\nmaterial = "x"'), "'x'", "neo_hookean"),
    "unknown bending model": (effect('[effects.bending]\nmodel = "hinges"'), "'hinges'", "'hinge'"),
    "unknown integrator": (on("dt =", 'integrator = "euler"\ndt ='), "'euler'", "backward_euler"),
    "unknown backend": (on("[run]", '[contact]\nbackend = "gpu"\n[run]'), "'gpu'", "ipctk"),
    "frames and a mesh": (on("subdivisions = 0", 'frames = "a*.obj"'), "frames.*mesh", ""),
    "frames of no file": (
        on('mesh = "sphere"\nsubdivisions = 0', 'frames = "a*.obj"'),
        "a\\*.obj",
        "",
    ),
    "part of no seed": (on("[run]", "[seed]\nvertices = [0, 4]\n[run]"), "seed.vertices", "file"),
    "unknown seed": (on("[run]", '[seed]\nfrom = "files"\n[run]'), "'files'", "file"),
    "text for a number": (on("dt = 0.02", 'dt = "fast"'), "solver.dt .*'fast'", ""),
    "negative number": (on("dt = 0.02", "dt = -0.02"), "solver.dt .*-0.02", ""),
    "nan": (on("dt = 0.02", "dt = nan"), "solver.dt .*nan", ""),
    "infinite": (on("duration = 0.04", "duration = inf"), "run.duration", "inf"),
    "fraction for a count": (on("dt = 0.02", "max_iterations = 2.5"), "max_iterations .*2.5", ""),
    "number for a text": (on("dt = 0.02", "linear = 3"), "solver.linear .*3", "auto"),
    "number for an effect": ("effects = 3\n" + re.sub(r"\[effects.*\]\n", "", GOOD), "effects .*3", ""),
    "number for the keys of an effect": (
        "effects.damping = 3\n" + GOOD,
        "effects.damping .*3",
        "3",
    ),
    "text for a rate": (effect('[effects.damping]\nrate = "much"'), "effects.damping.rate .*'much'", ""),
    "two numbers for a vector": (
        on("[effects.gravity]", "[effects.gravity]\nacceleration = [0, 1]"),
        "effects.gravity.acceleration .*3",
        "",
    ),
    "texts for a vector": (on("position = [0.0, 0.0, 0.5]", 'position = ["a", 0, 0]'), "cloth.position", "a"),
    "number for a mesh": (on('"rectangle"', "3"), "cloth .*mesh", "rectangle"),
    "no mesh": (on('mesh = "rectangle"\n', ""), "cloth .*mesh", "rectangle"),
    "number for the cloth": ("cloth = 3\n[effects.inertia]", "cloth .*3", ""),
    "number for the body": (
        "body = 3\n" + GOOD.split("[[body]]", maxsplit=1)[0] + "[effects.inertia]",
        "body .*3",
        "3",
    ),
    "unknown kind of file": (
        on('"rectangle"', '"sheet.xyz"').replace("size = [1.0, 1.0]\ncells = [2, 2]\n", ""),
        "sheet.xyz",
        "",
    ),
    "negative modulus": (cloth("youngs_modulus = -1"), "cloth.youngs_modulus .*-1", ""),
    "empty file": ("", "cloth", r"\[cloth\]"),
    "two cloths of one name": (TWO.format("cloth[0]"), r"'cloth\[0\]'", "name"),
    "key given twice": (on("dt = 0.02", "dt = 0.02\ndt = 0.03"), "line 20", "TOML|="),
    "pin that is no vertex": (effect("[effects.pins]\nselect = [99]"), r"select\[0\].*99", r"0\.\.8"),
    "unknown key of a pin group": (effect("[[effects.pins.group]]\nselct = [1]"), "'selct'", "select"),
}
NOT_BUILT = {
    "transfer": (on("[run]", '[seed]\nfrom = "transfer"\n[run]'), "transfer", "clothsim fit"),
}


@pytest.mark.parametrize(("text", "names", "remedy"), (BAD | NOT_BUILT).values(), ids=(BAD | NOT_BUILT))
def test_one_sentence_names_it(tmp_path, text, names, remedy):
    with pytest.raises(InputError) as refusal:
        built(tmp_path, text)
    output = str(refusal.value)
    assert re.search(names, output), output
    assert re.search(remedy, output), output
    assert "\n" not in output
    assert len(output) < 300


def test_the_scene_that_was_spoilt_is_good(tmp_path):
    made = built(tmp_path, GOOD)
    assert set(made.energies) == {"inertia", "membrane", "gravity", "body_contact"}
    assert set(built(tmp_path, TWO.format("other")).energies) == set(made.energies)


def test_a_missing_scene_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.toml"):
        load_scene(tmp_path / "nowhere.toml")


def test_a_folder_is_no_scene(tmp_path):
    with pytest.raises(InputError, match=re.escape(str(tmp_path))):
        load_scene(tmp_path)


def test_bytes_that_are_no_text_are_no_scene(tmp_path):
    (tmp_path / "scene.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"scene\.toml"):
        load_scene(tmp_path / "scene.toml")
