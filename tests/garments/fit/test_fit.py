"""`clothsim.fit` from files to files: outputs and status."""

import json
from dataclasses import replace

import numpy as np
import pytest
from fitting_cases import capsule_figure, in_file, tube_garment, wider

import clothsim
from clothsim.base.errors import InputError
from clothsim.base.record import read_summary
from clothsim.files.meshes.mesh_file import read_mesh, read_polygons
from clothsim.garments import stages
from clothsim.garments.fit import pipeline as module
from clothsim.garments.pictures import draw_fit
from clothsim.geometry.untangling import untangle as search
from clothsim.mesh.generators.shapes import rectangle
from clothsim.run.export import unpack_bundle, write_bundle

BODY = capsule_figure(segments=10)
SMALL = tube_garment(0.125, height=0.12, cells=(10, 3))
STAGE_KEYS = {"name", "seconds", "penetrating_vertices", "intersecting_pairs"}
SETTLED = replace(
    stages.FIT_DRAPE,
    effects={name: keys for name, keys in stages.FIT_DRAPE.effects.items() if name != "friction"},
    run={"duration": 0.04, "frames_per_second": 25},
)
"""A short drape: the tube hangs on nothing, and has no time to fall."""


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.setattr(stages, "FIT_DRAPE", SETTLED)
    monkeypatch.setattr(module, "FALLING", 1.0)
    return {
        "garment": in_file(tmp_path, "garment.obj", SMALL.positions, SMALL.triangles),
        "tight": in_file(tmp_path, "tight.obj", SMALL.positions * [0.76, 0.76, 1.0], SMALL.triangles),
        "body": in_file(tmp_path, "body.obj", BODY.positions, BODY.triangles),
        "wide": in_file(tmp_path, "wide.obj", wider(BODY, 1.3).positions, BODY.triangles),
        "sheet": in_file(tmp_path, "sheet.obj", *rectangle(size=(0.5, 0.5), cells=(4, 4))),
    }


def quads_with_texture(around, along):
    """Faces of `tube_garment` as quads with a corner of texture each, in OBJ."""
    lines = [f"v {x} {y} {z}" for x, y, z in SMALL.positions.tolist()]
    lines += [f"vt {u / around} {v / along}" for v in range(along + 1) for u in range(around + 1)]
    for v in range(along):
        for u in range(around):
            corners = [(u, v), (u + 1, v), (u + 1, v + 1), (u, v + 1)]
            lines.append(
                "f " + " ".join(f"{j * around + i % around + 1}/{j * (around + 1) + i + 1}" for i, j in corners)
            )
    return "\n".join(lines) + "\n"


def corners_at(polygons, faces):
    """Positions and texture of the corners of chosen quads."""
    rows = (polygons.starts[:-1][faces][:, None] + np.arange(4)).ravel()
    both = np.column_stack([polygons.positions[polygons.corners[rows]], polygons.texture[rows]])
    return set(map(tuple, both.round(6).tolist()))


def test_an_exported_fit_keeps_quads_and_texture(files, tmp_path):
    around, along = 10, 3
    (tmp_path / "quads.obj").write_text(quads_with_texture(around, along))
    clothsim.fit(tmp_path / "quads.obj", files["body"], output=tmp_path / "out")
    own = read_polygons(tmp_path / "quads.obj")
    run = clothsim.open_run(tmp_path / "out")
    for name in ("suit.obj", "suit.ply", "suit.usda", "suit.glb"):
        if name == "suit.usda":
            pytest.importorskip("pxr", reason="an extra: pip install 'clothsim[usd]'")
        exported = run.export(tmp_path / name)
        assert exported.frames == 1  # as it is worn
        mesh = read_polygons(tmp_path / name)
        sizes = np.diff(mesh.starts)
        if name == "suit.glb":
            assert (sizes == 3).all()
            assert any(f"{around * along} quads" in note for note in exported.notes)
            continue
        assert (sizes == 4).sum() == around * along
        if name == "suit.ply":  # its vertices are split where the texture is cut
            continue
        if name == "suit.obj":
            assert corners_at(mesh, sizes == 4) == corners_at(
                replace(own, positions=run.positions(-1)), sizes[sizes == 4] == 4
            )
    assert run.export(tmp_path / "drape.glb", fps=25.0).frames > 1


def test_a_fit_leaves_what_a_run_leaves_and_its_stages(files, tmp_path, monkeypatch):
    out, on_stage = tmp_path / "out", []
    done = clothsim.fit(files["garment"], files["wide"], files["body"], out, on_stage=on_stage.append)
    assert done.status == "completed"
    assert [stage.name for stage in done.stages] == ["garment", "transfer", "simulate"]
    assert on_stage == list(done.stages)
    left = {file.name for file in out.iterdir()}
    assert {"summary.json", "record.jsonl", "fitted.obj", "garment_rest.obj", "garment_start.obj", "body.obj"} <= left
    assert any(name.startswith("trajectory") for name in left)
    assert any(name.startswith("checkpoint") for name in left)
    summary = read_summary(out / "summary.json")
    assert summary["status"] == "completed"
    assert [stage["name"] for stage in summary["stages"]] == ["garment", "transfer", "simulate"]
    assert all(set(stage) >= STAGE_KEYS for stage in summary["stages"])
    assert summary["certificate"]["intersection_free"]
    assert set(summary["cost"]) == {"stretch_low", "stretch_high", "displacement"}
    assert {"reason", "wall_seconds", "newton_iterations", "fit_seconds"} <= set(summary)
    assert summary["cpu_seconds"] >= sum(stage["seconds"] for stage in summary["stages"]) > 0.0
    np.testing.assert_allclose(read_mesh(out / "fitted.obj").positions, done.positions, atol=1e-6)
    assert done.counts.clean
    assert done.cost.high > 1.2
    monkeypatch.setattr("clothsim.garments.pictures.SIZE", (64, 96))
    monkeypatch.setenv("CLOTHSIM_RENDERER", "ray")
    draw_fit(done, tmp_path / "fit.png")
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG")


def test_arrays_give_the_bits_of_their_files(files, tmp_path):
    meshes = {name: read_mesh(files[name]) for name in ("garment", "wide", "body")}
    arrays = {name: (mesh.positions, mesh.triangles) for name, mesh in meshes.items()}
    cloth = clothsim.Cloth(*arrays["garment"], name="garment.obj", fabric="denim")
    wide, body = (clothsim.Body(*arrays[name]) for name in ("wide", "body"))
    of_arrays = clothsim.fit(cloth, wide, body, tmp_path / "arrays")
    of_files = clothsim.fit(files["garment"], files["wide"], files["body"], tmp_path / "files", fabric="denim")
    assert of_arrays.status == of_files.status == "completed"
    assert np.array_equal(of_arrays.positions, of_files.positions)
    assert clothsim.fit(cloth, body, output=tmp_path / "own").source.name == "body"
    for extra in ({"scale": 0.1}, {"part": (0, 3)}):
        with pytest.raises(InputError):
            clothsim.fit(cloth, body, output=tmp_path / "other", **extra)


def test_without_the_other_body_a_garment_is_repaired_on_its_own(files, tmp_path):
    done = clothsim.fit(files["tight"], files["body"], output=tmp_path / "out")
    assert [stage.name for stage in done.stages] == ["garment", "refine", "simulate"]
    assert done.source is done.target
    assert done.stages[0].counts.penetrating_vertices > 0
    assert done.counts.clean


def test_a_simulation_that_cannot_go_on_leaves_the_refined_garment(files, tmp_path, monkeypatch):
    hopeless = replace(SETTLED, solver={"dt": 0.01, "tolerance": 1e-12, "max_iterations": 1})
    monkeypatch.setattr(stages, "FIT_DRAPE", hopeless)
    done = clothsim.fit(files["tight"], files["body"], output=tmp_path / "out")
    assert done.status == "refined"
    assert done.run.status == "failed"
    assert done.reason == done.run.reason
    assert [stage.name for stage in done.stages] == ["garment", "refine"]
    assert done.counts.clean
    summary = read_summary(tmp_path / "out" / "summary.json")
    assert (summary["status"], summary["reason"]) == ("refined", done.reason)
    assert "simulate" not in [stage["name"] for stage in summary["stages"]]
    fitted = read_mesh(tmp_path / "out" / "fitted.obj").positions
    np.testing.assert_allclose(fitted, done.stages[-1].positions, atol=1e-6)


def test_a_simulation_that_cannot_begin_leaves_the_refined_garment(files, tmp_path, monkeypatch):
    monkeypatch.setattr(stages, "FIT_DRAPE", replace(SETTLED, effects={"gravity": {}, "no_such_effect": {}}))
    done = clothsim.fit(files["tight"], files["body"], output=tmp_path / "out")
    assert (done.status, done.run) == ("refined", None)
    assert done.reason.startswith("The drape could not start: ")
    assert "no_such_effect" in done.reason
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["status"] == "refined"
    assert (tmp_path / "out" / "fitted.obj").is_file()


def test_what_nothing_frees_fails_with_its_place_and_is_not_simulated(files, tmp_path):
    done = clothsim.fit(files["sheet"], files["body"], output=tmp_path / "out")
    assert (done.status, done.run) == ("failed", None)
    assert "body.obj" in done.reason
    assert not done.counts.clean
    summary = read_summary(tmp_path / "out" / "summary.json")
    assert summary["failure"]["sentence"] == done.reason == summary["reason"]
    assert len(summary["failure"]["position"]) == 3
    assert summary["certificate"] is None
    assert not (tmp_path / "out" / "record.jsonl").exists()


def test_a_garment_that_falls_off_is_a_failure(files, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "FALLING", 0.01)
    done = clothsim.fit(files["garment"], files["body"], output=tmp_path / "out")
    assert done.status == "failed"
    assert "body.obj" in done.reason
    assert read_summary(tmp_path / "out" / "summary.json")["status"] == "failed"


def test_a_garment_keeps_its_own_size_where_it_is_asked_to(files, tmp_path):
    clothsim.fit(files["garment"], files["wide"], files["body"], tmp_path / "own", resize=False)
    rest = read_mesh(tmp_path / "own" / "garment_rest.obj").positions
    np.testing.assert_allclose(rest, SMALL.positions, atol=1e-6)


def test_an_output_that_is_a_file_is_refused(files, tmp_path):
    with pytest.raises(InputError, match="file"):
        clothsim.fit(files["garment"], files["body"], output=files["body"])


def test_a_garment_that_cannot_be_untangled_is_not_draped(files, tmp_path, monkeypatch):
    monkeypatch.setattr(search, "ATTEMPTS", ())
    positions, triangles = rectangle(size=(0.3, 0.3), cells=(3, 3))
    upright = positions[:, [0, 2, 1]] + np.array([0.03, 0.02, 0.01])
    two = np.concatenate([positions, upright]) + np.array([0.35, 0.0, 0.0])
    both = np.concatenate([triangles, triangles + len(positions)])
    done = clothsim.fit(in_file(tmp_path, "two.obj", two, both), files["body"], output=tmp_path / "out")
    assert done.counts.self_pairs > 0
    assert (done.status, done.run) == ("failed", None)
    assert done.stages[-1].name == "garment"
    assert f"{done.counts.self_pairs} triangle pairs" in done.reason
    assert len(read_summary(tmp_path / "out" / "summary.json")["failure"]["position"]) == 3


def test_a_scene_leaves_no_room_for_its_own_files(files, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text('[cloth]\nmesh = "garment.obj"\n[body]\nmesh = "body.obj"\n[effects.inertia]\n')
    for extra in ({"made_for": files["wide"]}, {"scale": 2.0}, {"part": (0, 3)}, {"weld": 0.1}):
        with pytest.raises(InputError):
            clothsim.fit(scene, files["body"], output=tmp_path / "out", **extra)


def test_the_same_file_twice_is_the_same_body(files, tmp_path):
    done = clothsim.fit(files["garment"], files["body"], files["body"], tmp_path / "out")
    assert [stage.name for stage in done.stages] == ["garment", "simulate"]
    assert done.source is done.target


def test_nothing_of_an_earlier_fit_is_left_and_no_input_is_overwritten(files, tmp_path):
    out = tmp_path / "out"
    clothsim.fit(files["garment"], files["body"], output=out)
    assert (out / "checkpoint.npz").is_file()
    kept = {file.name: file.read_bytes() for file in out.iterdir() if file.is_file()}
    with pytest.raises(InputError, match="overwrite=True"):
        clothsim.fit(files["sheet"], files["body"], output=out)
    assert {file.name: file.read_bytes() for file in out.iterdir() if file.is_file()} == kept
    assert clothsim.fit(files["sheet"], files["body"], output=out, overwrite=True).status == "failed"
    assert {file.name for file in out.iterdir()} == {"summary.json", "fitted.obj"}
    with pytest.raises(InputError, match="overwrite=True"):  # a failed fit is one too
        clothsim.fit(files["sheet"], files["body"], output=out)
    before = (tmp_path / "body.obj").read_bytes()
    with pytest.raises(InputError, match=r"body\.obj"):
        clothsim.fit(files["garment"], files["body"], output=tmp_path)
    assert (tmp_path / "body.obj").read_bytes() == before


def test_a_failed_fit_stays_one_and_is_replayed_from_its_archive(files, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "FALLING", 0.01)
    out = tmp_path / "out"
    clothsim.fit(files["garment"], files["body"], output=out)
    before = (out / "summary.json").read_bytes()
    with pytest.raises(InputError, match="out"):
        clothsim.resume(out)
    assert (out / "summary.json").read_bytes() == before
    assert set(read_summary(out / "summary.json")["failure"]) == {
        *("cause", "sentence", "element", "position", "remedy", "step", "time", "dt")
    }
    write_bundle(out, tmp_path / "fit.zip")
    unpack_bundle(tmp_path / "fit.zip", tmp_path / "replayed")
    assert clothsim.resume(tmp_path / "replayed").status == "completed"
