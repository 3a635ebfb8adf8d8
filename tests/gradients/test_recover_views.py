"""Numbers from pictures: a towel that hangs, through the command, and what pictures do not tell."""

import json
from dataclasses import replace

import numpy as np
import pytest
from command_line import refused
from hanging_towel import HEIGHT, write_towel
from PIL import Image
from sewing_patterns import panel, specification

from clothsim import ClothsimError, InputError, load_scene, recover_views
from clothsim.cli import main
from clothsim.cli.recover_command import _picture_lines
from clothsim.gradients import recover_views as search_of_views
from clothsim.gradients.pattern_numbers import PatternNumbers
from clothsim.gradients.view_fit import ViewFit
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of, read_specification


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the towel, which is the working directory."""
    monkeypatch.chdir(tmp_path)
    write_towel(tmp_path)
    return tmp_path


def test_the_height_of_a_towel_from_its_outline(capsys, folder):
    words = ["recover", "towel.toml", "--views", "views.toml", "--free", "pattern.towel.height,density", "-o", "found"]
    assert main([*words, "--folds", "2", "--json"]) == 0
    out, err = capsys.readouterr()
    content = json.loads(out)
    assert content == json.loads((folder / "found" / "recovery.json").read_text())
    found, own = (content[key]["pattern.towel.height"] for key in ("values", "relative_errors"))
    assert content["loss"]["value"] < 12.0  # that of the height alone; along the density it hardly changes
    assert abs(found / (1.06 * HEIGHT) - 1.0) < 2 * own < 0.2  # a heavier one is longer
    assert content["wide"] == ["cloth.density"]  # 1 mm of stretch
    assert content["undetermined"][0]["cloth.density"] > 0.9
    assert content["pictures"][0]["misfit"] < 1.0
    assert content["pictures"][0].keys() == {"view", "what", "misfit", "left_out", "switched"}
    assert content["from_minimum"] < 2.0
    assert err.count("start 1 of 1") > 4
    assert err.count("folds: pattern") == 1
    assert err.count("One view does not determine cloth.density, as") == 1
    assert len(content["folds"]) == 2
    assert [twin["name"] for twin in content["twins"]] == ["mesh", "step", "time", "start", "place"]
    for path, total in content["total_errors"].items():
        shifts = [twin["shifts"][path] for twin in content["twins"]]
        assert 0.0 < content["model_errors"][path] == pytest.approx(np.linalg.norm(shifts))
        error = content["relative_errors"][path]
        assert total is None if error is None else total == pytest.approx(np.hypot(error, np.linalg.norm(shifts)))
    assert 0.0 < content["adjoint_fraction"] < 0.5
    assert Image.open(folder / "found" / "view_from_here.png").size == (160, 120)
    written = read_specification(folder / "found" / "pattern.json")
    assert written.panels["towel"].extent[1] == pytest.approx(found, rel=1e-6)
    refused(capsys, *words)  # there is a run in "found"
    refused(capsys, *words[:-2], "--target", "mask.png")
    refused(capsys, *words[:4])  # nothing is free
    refused(capsys, "recover", "--views", "views.toml", "--free", "density")
    refused(capsys, *words[:-2], "--on", "towel.toml")
    refused(capsys, "recover", "towel.toml", "--target", "mask.png", "--free", "density", "--folds", "2")
    refused(capsys, *words[:-2], "--folds", "0")
    refused(capsys, "recover", "towel.toml", "--target", "mask.png", "--free", "density", "--finer")
    dressing = ["recover", "--views", "views.toml", "--pattern", "towel_specification.json", "--free", "density"]
    refused(capsys, *dressing, "--on", "nobody", "-o", "worn")
    assert not (folder / "worn_dressed").exists()
    refused(capsys, *words[:-2], "--prior")  # no stiffness of bending
    (folder / "views.toml").write_text(
        (folder / "views.toml").read_text().replace("position = [0.1", "position = [9.1")
    )
    refused(capsys, *words[:-2])  # the camera looks past the cloth


def test_the_height_alone(folder):
    scene = load_scene("towel.toml")
    found = recover_views(scene, "views.toml", ["pattern.towel.height"], twins=False)
    assert abs(found.values["pattern.towel.height"] / (1.06 * HEIGHT) - 1.0) < 5e-3  # a sixth of a pixel
    assert found.from_minimum < 1.0
    assert found.twins == ()
    assert found.total_errors == found.errors
    assert len(found.folds) == 6
    fitted, unexplained = (
        replace(found, pictures=tuple(replace(each, misfit=misfit) for each in found.pictures)) for misfit in (1.4, 1.6)
    )
    assert len(_picture_lines(unexplained)) == len(_picture_lines(fitted)) + 1
    numbers = {"pattern.a.width": 0.1, "pattern.a.height": 0.1}
    of_fewer = replace(found, values=numbers, fewer_pictures={"masks alone": numbers, "the view 0 alone": numbers})
    masks, one = (line for line in _picture_lines(of_fewer) if "tell:" in line)
    assert "pattern.a.width +- 10 %, pattern.a.height +- 10 %" in masks
    assert "pattern.a.height +- 10 %; no others" in one
    assert "width" not in one


def test_a_search_that_ends_on_a_finer_mesh(folder):
    found = recover_views(load_scene("towel.toml"), "views.toml", ["pattern.towel.height"], folds=1, finer=True)
    mesh, *others = found.twins
    assert mesh.name == "mesh"
    assert 0.0 < abs(mesh.shifts["pattern.towel.height"]) < 0.02  # how far the steps on it went
    assert [twin.name for twin in others] == ["step", "time", "start", "place"]
    assert not any(twin.failure for twin in found.twins)
    assert abs(found.values["pattern.towel.height"] / (1.06 * HEIGHT) - 1.0) < 0.02
    assert found.overlays["from here"].shape == (120, 160, 3)


def test_a_cloth_that_cannot_be_meshed_more_finely_is_refused_before_the_search(folder):
    scene, runs = load_scene("towel.toml"), []
    keys = {**scene.effects, "springs": {"spring": [{"select": "bottom", "stiffness": 1.0}]}}
    with pytest.raises(InputError, match=r"springs.*finer=True"):
        recover_views(
            replace(scene, effects=keys),
            "views.toml",
            ["pattern.towel.height"],
            finer=True,
            progress=lambda *each: runs.append(each),
        )
    assert not runs


def test_a_later_start_that_fails_leaves_the_end_of_the_first(folder, monkeypatch):
    search, starts = search_of_views._searched, []

    def searched(fit, begun, tell):
        starts.append((fit, begun))
        if len(starts) == 2:
            raise ClothsimError("The runs beside it fail.")
        return search(fit, begun, tell)

    monkeypatch.setattr(search_of_views, "_searched", searched)
    found = recover_views(
        load_scene("towel.toml"), "views.toml", ["pattern.towel.height"], folds=1, twins=False, starts=2
    )
    (fit, _), (_, second) = starts
    offset = fit.problem.spreads * np.random.default_rng(0).uniform(-1.0, 1.0, 1)
    assert second.at == pytest.approx(fit.problem.origin + offset, rel=1e-9)
    assert len(found.minima) == 1
    assert len(found.notes) == 1
    assert "Start 2" in found.notes[0]
    assert abs(found.values["pattern.towel.height"] / (1.06 * HEIGHT) - 1.0) < 0.02


def test_a_pattern_with_other_numbers_is_the_one_that_is_meshed():
    """Curved edges too: the written pattern has the extents and borders of the mesh with these numbers."""
    edges = [{"endpoints": [k, (k + 1) % 4]} for k in range(4)]
    edges[0]["curvature"] = {"type": "cubic", "params": [[0.3, 0.1], [0.7, 0.2]]}
    mesh = mesh_pattern(pattern_of(specification({"front": panel(edges=edges)})), 0.02)
    numbers = PatternNumbers(mesh)
    values = {"pattern.front.width": 0.12, "pattern.front.flare": 1.2, "pattern.front.edge[0].control[1].y": -0.03}
    made = numbers.pattern(values)
    again = PatternNumbers(mesh_pattern(made, 0.02))
    assert again.point(again.number("pattern.front.edge[0].control[1].y"))[0] != 0.0
    moved = numbers.material_coordinates(values)  # warp, weft
    np.testing.assert_allclose(np.ptp(moved.reshape(-1, 2), axis=0), made.panels["front"].extent[::-1], rtol=2e-3)


def test_a_search_that_was_stopped_goes_on(capsys, folder, monkeypatch):
    """Its runs are kept: the rest of the search is the same to the last bit, and takes the other runs alone."""
    words = ["recover", "towel.toml", "--views", "views.toml", "--free", "pattern.towel.height", "--folds", "2"]
    words += ["--no-twins", "-o", "found"]
    trace, taken = ViewFit.trace, []

    def counted(fit, *given):
        if len(taken) == most:
            raise KeyboardInterrupt
        taken.append(given)
        return trace(fit, *given)

    monkeypatch.setattr(ViewFit, "trace", counted)
    most = 1000
    assert main([*words[:-1], "whole"]) == 0
    whole, all_runs = json.loads((folder / "whole" / "recovery.json").read_text()), len(taken)
    assert not (folder / "whole_runs").exists()
    taken.clear()
    most = 5
    assert main(words) == 130
    assert len(list((folder / "found_runs").glob("*.npz"))) >= most
    assert "--resume" in capsys.readouterr().err
    refused(capsys, *words)  # what was kept would be lost
    taken.clear()
    most = 1000
    assert main([*words, "--resume"]) == 0
    assert len(taken) <= all_runs - 4  # the last of five may be taken again for its gradient
    found = json.loads((folder / "found" / "recovery.json").read_text())
    for key in ("values", "relative_errors", "loss", "from_minimum", "runs"):
        assert found[key] == whole[key]
    assert not (folder / "found_runs").exists()
    capsys.readouterr()
    refused(capsys, *words[:-1], "other", "--resume")  # no search was stopped
    refused(capsys, *words[:-2], "--resume")
