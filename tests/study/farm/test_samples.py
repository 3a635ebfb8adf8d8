"""Recipes that come with the package, and a sample of one in one command."""

import json
from pathlib import Path

import pytest

from clothsim.cli import main
from clothsim.data import Drapes
from clothsim.engine import example_file
from clothsim.scene.assembly.scene_world import world_of
from clothsim.study.farm.recipe import Choice, changed, drawn_value, load_recipe

SHIPPED = sorted((Path(__file__).parents[3] / "scenes").glob("*.recipe"))


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_a_recipe_that_ships_is_found_by_name_and_fits_its_scene(file):
    recipe = load_recipe(example_file(Path(file.stem), ".recipe"))
    assert recipe.count == 50
    assert recipe.licence == "CC0-1.0"
    drawn = recipe.values(0)
    assert len(drawn) > 1
    scene = changed(recipe.scene, drawn)
    assert scene.run_settings.duration > 0


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_every_value_of_a_list_of_a_recipe_that_ships_can_be_built(file):
    recipe = load_recipe(file)
    lists = {key: draw.values for key, draw in recipe.draws.items() if isinstance(draw, Choice)}
    for k in range(max(map(len, lists.values()), default=0)):
        drawn = recipe.values(k) | {key: values[k % len(values)] for key, values in lists.items()}
        drawn |= {key: drawn_value(drawn, other) for key, other in recipe.same.items()}
        assert world_of(changed(recipe.scene, drawn)).n_cloth > 0


def test_a_sample_is_made_verified_and_packed_and_goes_on(tmp_path, capsys):
    scene = '[cloth]\nmesh = "rectangle"\ncells = [2, 2]\n[effects.gravity]\n[effects.inertia]\n'
    (tmp_path / "scene.toml").write_text(scene)
    text = '[farm]\nscene = "scene.toml"\nuntil = "time"\ncount = 3\n[set]\nrun.duration = 0.04\n'
    (tmp_path / "r.toml").write_text(text + '[vary]\n"cloth.density" = { uniform = [0.1, 0.3] }\n')
    words = ["farm", "sample", str(tmp_path / "r.toml"), "-o", str(tmp_path / "farm"), "--json"]
    for _ in range(2):
        assert main(words) == 0
        answer = json.loads(capsys.readouterr().out)
        assert (answer["planned"], answer["usable"], answer["verified"], answer["packed"]) == (3, 3, 3, 3)
    assert len(Drapes(answer["file"])) == 3
