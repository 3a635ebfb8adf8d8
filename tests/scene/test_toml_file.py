"""Example scenes: what is installed, by name."""

from pathlib import Path

import pytest

from clothsim import InputError, load_scene
from clothsim.cli import main
from clothsim.scene import toml_file
from clothsim.scene.toml_file import example_scenes, first_comment, scene_file

ROOT = Path(__file__).parents[2]


def test_every_scene_of_the_repository_is_listed():
    listed = {each.name: each for each in example_scenes()}
    assert set(listed) == {file.stem for file in (ROOT / "scenes").glob("*.toml")}
    assert all(3 < len(each.headline) < 120 for each in listed.values())
    assert listed["sphere"].headline == "A square metre of cotton falls on a ball"
    assert listed["sphere"].missing == ()


def test_files_that_are_not_installed_are_named(tmp_path, monkeypatch):
    for name in ("sphere", "shoulders"):
        (tmp_path / f"{name}.toml").write_bytes((ROOT / "scenes" / f"{name}.toml").read_bytes())
    monkeypatch.setattr(toml_file, "folders", lambda: iter([tmp_path / "none", tmp_path]))
    missing = {each.name: each.missing for each in example_scenes()}
    assert missing["sphere"] == ()
    [name] = missing["shoulders"]
    assert name.endswith("mean_all.obj")


def test_a_name_is_that_of_a_file_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert load_scene("sphere").bodies
    assert scene_file(Path("folder/sphere")) == Path("folder/sphere")
    assert scene_file(Path("mine.toml")) == Path("mine.toml")
    Path("sphere").mkdir()  # the output of a run of that name
    assert scene_file(Path("sphere")).is_file()
    Path("sphere").rmdir()
    Path("sphere").write_text("of my own")
    assert scene_file(Path("sphere")) == Path("sphere")


def test_an_unknown_name_is_answered_with_the_nearest():
    with pytest.raises(InputError) as caught:
        scene_file(Path("spher"))
    assert "'sphere'" in caught.value.remedy


@pytest.mark.parametrize("there", ["win.toml", "mine.toml"])
def test_a_file_that_is_there_by_chance_is_not_asked_about(tmp_path, there):
    (tmp_path / there).write_text("")
    with pytest.raises(InputError) as caught:
        load_scene(tmp_path / "missing.toml")
    assert there not in caught.value.remedy
    assert "clothsim scenes" in caught.value.remedy


def test_a_file_of_nearly_that_name_is_asked_about(tmp_path):
    (tmp_path / "my_skirt.toml").write_text("")
    with pytest.raises(InputError, match=r"'my_skirt\.toml'"):
        load_scene(tmp_path / "my_skrit.toml")


@pytest.mark.parametrize("command", ["run", "check", "explain", "study"])
@pytest.mark.parametrize("name", ["sphere.toml", "folder/sphere.toml"])
def test_a_missing_file_of_an_installed_name_is_answered_with_that_name(tmp_path, monkeypatch, capsys, command, name):
    monkeypatch.chdir(tmp_path)
    assert main([command, name]) == 2
    sentence, remedy = capsys.readouterr().err.splitlines()
    assert name in sentence
    assert remedy.endswith(": sphere")
    assert not list(tmp_path.iterdir())


def test_a_file_of_an_installed_name_is_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("sphere.toml").write_text("")
    assert scene_file(Path("sphere.toml")) == Path("sphere.toml")


def test_scenes_that_are_not_installed_are_reported(monkeypatch, tmp_path):
    monkeypatch.setattr(toml_file, "folders", lambda: iter([tmp_path]))
    with pytest.raises(InputError):
        example_scenes()


@pytest.mark.parametrize(
    ("text", "first"),
    [
        ("# A ball. It falls.\n[cloth]", "A ball"),
        ("# A ball of 2.3 kg\n# falls: soon.\n\n# no more", "A ball of 2.3 kg falls"),
        ("[cloth]\n# later", ""),
    ],
)
def test_the_headline_is_the_first_clause_of_the_comment(text, first):
    assert first_comment(text) == first


@pytest.mark.parametrize(
    "name", ["a" * 5000, "a" * 300 + ".toml", "a\0", ""], ids=["long", "long, TOML", "NUL", "empty"]
)
def test_a_name_that_no_file_can_have_is_refused(name):
    with pytest.raises(InputError):
        load_scene(name)
