"""Mistakes of a newcomer on the command line: the message names section, key and index, the remedy is of the case."""

import re

import pytest
from spoilt_scenes import GOOD, cloth, effect, on

from clothsim.cli import main

MISTAKES = {
    "an effect at the top": ("gravity = 9.81" + GOOD, "'gravity'", "effects.gravity.*acceleration"),
    "a number for an effect": (
        "effects.gravity = 9.81" + on("[effects.gravity]\n", ""),
        "effects.gravity .*9.81",
        "acceleration = ",
    ),
    "a number for a vector": (
        on("[effects.gravity]", "[effects.gravity]\nacceleration = 9.81"),
        "effects.gravity.acceleration .*m/s2",
        "-9.81",
    ),
    "a name for pin groups": (
        effect('[effects.pins]\ngroup = "collar"'),
        "effects.pins.group",
        r"\[\[effects.pins.group",
    ),
    "a name for a selection": (effect('[effects.pins]\nselect = "collar"'), "effects.pins.select .*collar", "box"),
    "a pin group of nothing": (effect("[[effects.pins.group]]\nclamp = true"), r"effects.pins.group\[0\]", "select"),
    "no density": (cloth("density = 0"), "cloth.density .*kg/m2", "fabric"),
    "Poisson's ratio": (cloth("poisson_ratio = 0.7"), "cloth.poisson_ratio .*0.5", "Poisson"),
    "threads' Poisson's ratio": (cloth("thread_poisson_ratio = 1"), "cloth.thread_poisson_ratio .*1", "warp and weft"),
    "a key of another section": (on("[run]", "[run]\ndt = 0.01"), "run .*'dt'", "solver"),
    "a key of no section": ("dt = 0.01" + GOOD, "'dt'", "solver"),
    "the duration of the solver": (on("[solver]", "[solver]\nduration = 1"), "solver .*'duration'", "run"),
    "no iterations": (on("dt = 0.02", "max_iterations = 0"), "solver.max_iterations .*1", "100"),
    "a negative coefficient": (
        effect("[effects.friction]\ncoefficient = -1"),
        "effects.friction.coefficient .*0",
        "0.3",
    ),
    "friction of nobody": (
        effect('[effects.friction]\npairs = [["cloth", "bal", 1]]'),
        r"friction.pairs\[0\].*'bal'",
        "ball",
    ),
    "a text for a distance": (
        on("[effects.body_contact]", '[effects.body_contact]\nd_hat = "small"'),
        "effects.body_contact.d_hat .*'small'",
        "auto",
    ),
    "no pair": (
        on("[effects.body_contact]", '[effects.body_contact]\nexclude = ["cloth"]'),
        r"exclude\[0\]",
        "body_contact",
    ),
    "an unknown fabric": (cloth('fabric = "linnen"'), "cloth.fabric .*'linnen'", "cotton"),
    "a missing mesh": (
        on('"rectangle"\nsize = [1.0, 1.0]\ncells = [2, 2]', '"shirt.obj"'),
        r"cloth.mesh.*shirt\.obj",
        "folder",
    ),
    "a generator's key for a file": (on('"rectangle"', '"shirt.obj"'), "cloth .*'size'", "rectangle"),
    "a table for a mesh": (on('mesh = "rectangle"', 'mesh = { file = "a.obj" }'), "cloth.mesh .*'file'", "generator"),
    "several meshes": (on('mesh = "rectangle"', 'mesh = ["a", "b", "c"]'), "cloth.mesh .*3", "vertices, triangles"),
    "an unknown mesh": (on('"rectangle"', '"rectangel"'), "cloth.mesh .*'rectangel'", "'rectangle'"),
    "one number of cells": (on("cells = [2, 2]", "cells = 2"), "cloth.cells .*2", "40, 40"),
    "no cells": (on("cells = [2, 2]", "cells = [0, 2]"), r"cloth.cells\[0\] .*1", "40, 40"),
    "a negative size": (on("[1.0, 1.0]", "[1.0, -1.0]"), r"cloth.size\[1\] .*m", "x and y"),
    "unknown diagonals": (on("cells =", 'diagonals = "left"\ncells ='), "cloth.diagonals .*'left'", "crisscross"),
    "no texture": (cloth('rest = "vt"'), "cloth.rest", "file"),
    "an unknown rest": (cloth('rest = "uv"'), "cloth.rest .*'uv'", "vt"),
    "a key of a motion": (
        on("subdivisions = 0", "motion = { velocty = [0, 0, 1] }"),
        "body.motion .*'velocty'",
        "'velocity'",
    ),
    "a vector for a motion": (on("subdivisions = 0", "motion = [0, 0, 1]"), "body.motion", "velocity"),
    "a number for a velocity": (
        on("subdivisions = 0", "motion = { velocity = 1 }"),
        "body.motion.velocity .*m/s",
        "0, 0, 0",
    ),
    "too fine a sphere": (on("subdivisions = 0", "subdivisions = 40"), "body.subdivisions .*8", "4"),
    "no radius": (on("subdivisions = 0", "radius = 0"), "body.radius .*m", "0.3"),
    "another shape's key": (on("subdivisions = 0", "segments = 8"), "body .sphere. .*'segments'", "capsule"),
    "a seed without a file": (GOOD + '[seed]\nfrom = "file"', "seed .*file", "PATH"),
    "a missing seed": (GOOD + '[seed]\nfrom = "file"\nfile = "a.obj"', r"seed.file.*a\.obj", "folder"),
    "no effects": (re.sub(r"\[effects.*\]\n", "", GOOD), "effect", "gravity"),
    "no cloth": ("[run]\nduration = 1", "cloth", "cloth"),
    "a negative rate": (effect("[effects.damping]\nrate = -1"), "effects.damping.rate .*1/s", "1"),
    "a number for a wind": (effect("[effects.air]\nwind = 5"), "effects.air.wind .*3", "velocity"),
    "a gust without a mean": (
        effect('[effects.air]\nwind = { kind = "gust" }'),
        "air.wind .*velocity",
        "m/s|Mean",
    ),
    "a key of a gust": (effect('[effects.air]\nwind = { kind = "gust", core = 1 }'), "air.wind .*'core'", "velocity"),
    "too much lift": (effect("[effects.air]\nlift = 2"), "effects.air.lift .*1", "0.9"),
    "a missing array": (effect('[effects.air]\ndrag = "p.npy"'), r"effects.air.drag.*p\.npy", "path"),
    "an array of another mesh": (effect("[effects.air]\ndrag = [1, 2, 3]"), "effects.air.drag .*3", "8"),
    "a spring without stiffness": (
        effect('[[effects.springs.spring]]\nselect = "left"'),
        r"effects.springs.spring\[0\] .*stiffness",
        "key frames",
    ),
    "one spring": (
        effect('[effects.springs]\nspring = { select = "left" }'),
        "effects.springs.spring",
        r"\[\[effects.springs",
    ),
    "a negative stiffness": (
        effect('[[effects.springs.spring]]\nselect = "left"\nstiffness = -1'),
        r"effects.springs.spring\[0\].stiffness .*N/m",
        "spring",
    ),
    "a seam of one side": (
        effect('[[effects.seams.seam]]\nfrom = { side = "left" }'),
        r"seams.seam\[0\] .*to",
        "border",
    ),
    "a name for a border": (
        effect('[[effects.seams.seam]]\nfrom = "left"\nto = "right"'),
        r"seams.seam\[0\].from",
        "side",
    ),
    "a crease without an angle": (
        effect("[[effects.rest_angle.crease]]\nvertices = [1]"),
        r"crease\[0\] .*angle",
        "angle",
    ),
    "broken TOML": (on("dt = 0.02", "dt = = 2"), "line 19", "quotes"),
    "true for a step": (on("dt = 0.02", "dt = true"), "solver.dt .*s", "0.01"),
    "an unknown solver": (on("dt = 0.02", 'linear = "umfpack"'), "solver.linear .*'umfpack'", "pardiso"),
    "dt and error": (on("dt = 0.02", "dt = 0.02\nerror = 1e-3"), "dt.*error", ""),
    "one name twice": (cloth('name = "ball"'), "'ball'", "name"),
    "a text in a vector": (on("0.0, 0.5]", '"up", 0.5]'), r"cloth.position\[1\] .*'up'", "position"),
    "no scale": (cloth("scale = 0"), "cloth.scale .*0", "Metres"),
}
SETTINGS = {
    "cloth.mesh=missing.obj": (r"missing\.obj", "path"),
    "body.frames=kick*.obj": (r"kick\*\.obj", "path"),
    "cloth.mesh=square": ("cloth.mesh .*'square'", "rectangle"),
    "solver.dt": ("'solver.dt'", "solver.dt=0.01"),
    "solver.dtt=1": ("solver .*'dtt'", "'dt'"),
    "cloth.cells=2": ("cloth.cells .*2", "40, 40"),
    "effects.gravity=9.81": ("effects.gravity .*9.81", "acceleration"),
    "effects.pins.select=lefft": ("effects.pins.select .*'lefft'", "'left'"),
    "effects.gravty.acceleration=1": ("effects .*'gravty'", "'gravity'"),
    "cloth.fabric=denm": ("cloth.fabric .*'denm'", "'denim'"),
    "cloth.mesh.x=1": ("mesh is not a table", "mesh"),
}
NAMED = {
    "run nowhere.toml": (r"nowhere\.toml", r"\.toml"),
    "run scene.toml --preset fats": ("'fats'", "fast|draft"),
    "render nowhere": ("nowhere", "clothsim run"),
    "resume nowhere": ("nowhere", "clothsim run"),
    "bundle nowhere": ("nowhere", "clothsim run"),
    "keys solvr": ("'solvr'", "'solver'"),
    "fabrics denm": ("'denm'", "'denim'"),
}


def refused(capsys, words):
    """Sentence and remedy of a command that ends with bad input."""
    assert main(words) == 2
    sentence, remedy = capsys.readouterr().err.strip().splitlines()[-2:]
    assert "--help` shows how to go on" not in remedy
    return sentence, remedy


@pytest.mark.parametrize(("text", "names", "helps"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_in_a_file(tmp_path, capsys, text, names, helps):
    (tmp_path / "scene.toml").write_text(text)
    sentence, remedy = refused(capsys, ["run", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "run"), "--quiet"])
    assert re.search(names, sentence), sentence
    assert re.search(helps, remedy), remedy


@pytest.mark.parametrize(("assignment", "names", "helps"), [(key, *value) for key, value in SETTINGS.items()])
def test_a_mistake_in_an_assignment(tmp_path, monkeypatch, capsys, assignment, names, helps):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(GOOD)
    sentence, remedy = refused(capsys, ["run", "scene.toml", "--quiet", "--set", assignment])
    assert re.search(names, sentence), sentence
    assert re.search(helps, remedy), remedy


@pytest.mark.parametrize(("words", "names", "helps"), [(key, *value) for key, value in NAMED.items()])
def test_a_mistake_in_a_name(tmp_path, monkeypatch, capsys, words, names, helps):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(GOOD)
    sentence, remedy = refused(capsys, words.split())
    assert re.search(names, sentence), sentence
    assert re.search(helps, remedy), remedy


def test_the_scene_that_was_spoilt_is_good(tmp_path):
    (tmp_path / "scene.toml").write_text(GOOD)
    assert main(["check", str(tmp_path / "scene.toml")]) == 0
