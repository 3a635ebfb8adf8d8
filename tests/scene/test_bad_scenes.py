"""Invalid scenes: one InputError that names the fault and the nearest known name."""

import re

import pytest

from clothsim import InputError, load_scene
from clothsim.build.scene_world import build

GOOD = """
[cloth]
mesh = "rectangle"
cells = [2, 2]
position = [0.0, 0.0, 0.5]

[[body]]
name = "ball"
mesh = "sphere"
subdivisions = 0

[effects.inertia]
[effects.membrane]
[effects.gravity]
[effects.body_contact]

[solver]
dt = 0.02

[run]
duration = 0.1
"""


def built(folder, text):
    file = folder / "scene.toml"
    file.write_text(text)
    return build(load_scene(file))


def changed(old, new):
    assert old in GOOD
    return GOOD.replace(old, new)


def with_effect(lines):
    return changed("[solver]", f"{lines}\n[solver]")


TWO = changed("[cloth]", "[[cloth]]").replace(
    "[[body]]", '[[cloth]]\nmesh = "rectangle"\nname = "{}"\nposition = [0.0, 0.0, 9.0]\n[[body]]'
)

BAD = {
    "unknown section": (changed("[solver]", "[solvr]"), "'solvr'", "'solver'"),
    "unknown section, none near": ("[zzz]\n" + GOOD, "'zzz'", "cloth, body"),
    "unknown key of the solver": (changed("dt =", "dtt ="), "solver .*'dtt'", "'dt'"),
    "unknown key of the run": (changed("duration", "durations"), "run .*'durations'", "'duration'"),
    "unknown key of the cloth": (changed("cells =", "cellls ="), "cloth .*'cellls'", "'cells'"),
    "unknown key of the body": (changed("subdivisions", "subdivision"), "body .*'subdivision'", "'subdivisions'"),
    "unknown effect": (with_effect("[effects.gravitty]"), "'gravitty'", "'gravity'"),
    "unknown key of an effect": (with_effect("[effects.damping]\nrat = 1"), "effects.damping .*'rat'", "'rate'"),
    "unknown fabric": (changed("[[body]]", 'fabric = "coton"\n[[body]]'), "fabric is 'coton'", "cotton"),
    "unknown mesh": (changed('"rectangle"', '"rectangel"'), "'rectangel'", "'rectangle'"),
    "unknown material": (changed("[effects.membrane]", '[effects.membrane]\nmaterial = "x"'), "'x'", "neo_hookean"),
    "unknown bending model": (with_effect('[effects.bending]\nmodel = "hinges"'), "'hinges'", "'hinge'"),
    "unknown integrator": (changed("dt =", 'integrator = "euler"\ndt ='), "'euler'", "backward_euler"),
    "unknown backend": (changed("[run]", '[contact]\nbackend = "gpu"\n[run]'), "'gpu'", "ipctk"),
    "unknown diagonals": (changed("cells =", 'diagonals = "left"\ncells ='), "'left'", "alternating"),
    "unknown rest": (changed("[[body]]", 'rest = "uv"\n[[body]]'), "rest is 'uv'", "vt"),
    "frames and a mesh": (changed("subdivisions = 0", 'frames = "a*.obj"'), "frames and mesh", "not both"),
    "frames of no file": (
        changed('mesh = "sphere"\nsubdivisions = 0', 'frames = "a*.obj"'),
        "No file.*a\\*.obj",
        "any",
    ),
    "part of no seed": (changed("[run]", "[seed]\nvertices = [0, 4]\n[run]"), "seed.vertices", "file"),
    "unknown seed": (changed("[run]", '[seed]\nfrom = "files"\n[run]'), "'files'", "file"),
    "unknown motion": (
        changed("subdivisions = 0", "subdivisions = 0\nmotion = { velocty = [0, 0, 1] }"),
        "'velocty'",
        "'velocity'",
    ),
    "text for a number": (changed("dt = 0.02", 'dt = "fast"'), "solver.dt .* number", "'fast'"),
    "true for a number": (changed("dt = 0.02", "dt = true"), "solver.dt .* number", "True"),
    "negative number": (changed("dt = 0.02", "dt = -0.02"), "solver.dt must be above 0", "-0.02"),
    "nan": (changed("dt = 0.02", "dt = nan"), "solver.dt must be above 0", "nan"),
    "infinite": (changed("duration = 0.1", "duration = inf"), "run.duration", "inf"),
    "fraction for a count": (changed("dt = 0.02", "max_iterations = 2.5"), "max_iterations .* whole", "2.5"),
    "no iterations": (changed("dt = 0.02", "max_iterations = 0"), "max_iterations", "from 1 to"),
    "number for a text": (changed("dt = 0.02", "linear = 3"), "solver.linear must be .auto", "3"),
    "number for an effect": ("effects = 3\n" + re.sub(r"\[effects.*\]\n", "", GOOD), "effects must be a table", "3"),
    "number for the keys of an effect": (
        "effects.damping = 3\n" + GOOD,
        "effects.damping must be a table",
        "3",
    ),
    "text for a rate": (with_effect('[effects.damping]\nrate = "much"'), "damping.rate must be a number", "'much'"),
    "negative rate": (with_effect("[effects.damping]\nrate = -1"), "damping.rate must be at least 0", "-1"),
    "two numbers for a vector": (
        changed("[effects.gravity]", "[effects.gravity]\nacceleration = [0, 1]"),
        "gravity.acceleration must be 3 numbers",
        "",
    ),
    "texts for a vector": (changed("position = [0.0, 0.0, 0.5]", 'position = ["a", 0, 0]'), "cloth.position", "a"),
    "number for a mesh": (changed('"rectangle"', "3"), "cloth has no mesh", "rectangle"),
    "no mesh": (changed('mesh = "rectangle"\n', ""), "cloth has no mesh", "rectangle"),
    "no cells": (changed("cells = [2, 2]", "cells = [0, 2]"), "cells", "0"),
    "number for cells": (changed("cells = [2, 2]", "cells = 2"), "cells", "2"),
    "number for the cloth": ("cloth = 3\n[effects.inertia]", "cloth must be a table", "3"),
    "number for the body": (
        "body = 3\n" + GOOD.split("[[body]]", maxsplit=1)[0] + "[effects.inertia]",
        "body must be a table",
        "3",
    ),
    "number for pin groups": (
        with_effect("[effects.pins]\ngroup = 3"),
        "pins.group must be a list of tables",
        "select",
    ),
    "missing mesh file": (changed('"rectangle"', '"sheet.obj"').replace("cells = [2, 2]\n", ""), "sheet.obj", ""),
    "unknown kind of file": (changed('"rectangle"', '"sheet.xyz"').replace("cells = [2, 2]\n", ""), "sheet.xyz", ""),
    "key of a generator for a file": (changed('"rectangle"', '"sheet.obj"'), "'cells'", ""),
    "missing seed file": (changed("[run]", '[seed]\nfrom = "file"\nfile = "a.obj"\n[run]'), "a.obj", ""),
    "seed without a file": (changed("[run]", '[seed]\nfrom = "file"\n[run]'), "seed", "file"),
    "negative modulus": (changed("[[body]]", "youngs_modulus = -1\n[[body]]"), "youngs_modulus .* at least 0", "-1"),
    "no density": (changed("[[body]]", "density = 0\n[[body]]"), "density must be above 0", "0"),
    "Poisson's ratio": (changed("[[body]]", "poisson_ratio = 0.7\n[[body]]"), "poisson_ratio", "0.7"),
    "no cloth": ("[run]\nduration = 1.0\n", "no cloth", r"\[cloth\]"),
    "empty file": ("", "no cloth", r"\[cloth\]"),
    "no effect": (re.sub(r"\[effects.*\]\n", "", GOOD), "no effect", "inertia"),
    "two cloths of one name": (TWO.format("cloth[0]"), "Two things are called 'cloth\\[0\\]'", "name of its own"),
    "cloth and body of one name": (TWO.format("ball"), "Two things are called 'ball'", "name of its own"),
    "broken TOML": (changed("dt = 0.02", "dt = = 2"), "line 18", "not a TOML file"),
    "key given twice": (changed("dt = 0.02", "dt = 0.02\ndt = 0.03"), "line 19", "not a TOML file"),
    "pin that is no vertex": (with_effect("[effects.pins]\nselect = [99]"), r"select\[0\] = 99", r"0\.\.8"),
    "unknown selection": (with_effect('[effects.pins]\nselect = "lefft"'), "'lefft'", "left"),
    "unknown key of a pin group": (with_effect("[[effects.pins.group]]\nselct = [1]"), "'selct'", "select"),
}
NOT_BUILT = {
    "transfer": (changed("[run]", '[seed]\nfrom = "transfer"\n[run]'), "transfer.* command of its own", "clothsim fit"),
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
    with pytest.raises(InputError, match=r"no scene file .*nowhere\.toml"):
        load_scene(tmp_path / "nowhere.toml")


def test_a_folder_is_no_scene(tmp_path):
    with pytest.raises(InputError, match="cannot be read as a scene"):
        load_scene(tmp_path)


def test_bytes_that_are_no_text_are_no_scene(tmp_path):
    (tmp_path / "scene.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read as a scene"):
        load_scene(tmp_path / "scene.toml")
