"""`clothsim dress` of several garments: what is drawn where one of them fails, and where all are worn."""

import json

import pytest
import trimesh
from capsule_bodies import person
from sewing_patterns import capsule_skirt

from clothsim.cli import main


@pytest.fixture
def words(tmp_path):
    """Arguments that dress a person of capsules in two skirts."""
    files = []
    for name, width in (("slip", 42), ("skirt", 45)):
        files.append(str(tmp_path / f"{name}_specification.json"))
        (tmp_path / f"{name}_specification.json").write_text(json.dumps(capsule_skirt(width)))
    trimesh.Trimesh(*person(0.06), process=False).export(tmp_path / "person.obj")
    return ["dress", *files, "--on", str(tmp_path / "person.obj"), "--size", "8cm", "-o", str(tmp_path / "out")]


def pictures(folder):
    return sorted(str(file.relative_to(folder)) for file in folder.rglob("*.png"))


def test_pictures_of_a_first_garment_that_fails_are_drawn(words, tmp_path, capsys):
    assert main([*words, "--budget", "0.01s"]) == 1
    assert "failed: slip" in capsys.readouterr().out
    assert pictures(tmp_path / "out") == ["slip/placed.png", "slip/stretch.png", "slip/worn.png"]


def test_all_garments_are_drawn_together_once(words, tmp_path):
    (tmp_path / "out" / "slip").mkdir(parents=True)
    (tmp_path / "out" / "slip" / "placed.png").write_bytes(b"of a garment that failed")
    assert main([*words, "--overwrite"]) == 0
    assert pictures(tmp_path / "out") == ["worn.png"]
