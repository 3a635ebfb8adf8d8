"""Outfits: two skirts one over the other, the wrap between them, and what cannot be sewn over."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from capsule_bodies import person
from sewing_patterns import capsule_skirt

import clothsim
from clothsim.base.errors import InputError
from clothsim.base.record import SUMMARY_NAME, read_summary, write_summary
from clothsim.garments import outfit
from clothsim.garments.dress import pipeline
from clothsim.garments.inputs import BodyMesh, is_closed
from clothsim.garments.penetration import Counts
from clothsim.mesh.generators.table import GENERATORS
from transfer.signed_distance import body_surface
from transfer.wrap import REACH

SPACING = 0.08
CELL, LAYER = 0.02, 0.014
"""Lattice and distance of a wrap for a mesh as coarse [m]."""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Folder with two skirts, and a run of the inner one on a person of capsules."""
    folder = tmp_path_factory.mktemp("outfit")
    for name, width in (("slip", 42), ("skirt", 45)):
        (folder / f"{name}_specification.json").write_text(json.dumps(capsule_skirt(width)))
    body = clothsim.Body(*person(0.06), name="person")
    slip = clothsim.dress(folder / "slip_specification.json", body, folder / "slip", size=SPACING)
    assert slip.status == "completed"
    return folder, body


@pytest.fixture(scope="module")
def worn(place):
    """The skirt over the run of the slip."""
    folder, _ = place
    with pytest.MonkeyPatch.context() as coarse:
        coarse.setattr(outfit, "CELL", CELL)
        coarse.setattr(outfit, "LAYER", LAYER)
        pattern = folder / "skirt_specification.json"
        return clothsim.outfit([pattern], output=folder / "both", over=folder / "slip", size=SPACING)


def test_garments_over_one_another_rest_without_an_intersection(worn):
    assert worn.status == "completed", worn.reason
    assert worn.counts.clean
    assert worn.run.intersection_free
    assert [each.name for each in worn.worn] == list(worn.run.cloth_names) == ["slip", "skirt"]
    assert read_summary(worn.directory / SUMMARY_NAME)["garments"] == ["slip", "skirt"]


def test_the_later_garment_is_the_outer_one(worn):
    slip, skirt = (each.positions for each in worn.worn)
    radius = [np.median(np.hypot(points[:, 0], points[:, 2])) for points in (slip, skirt)]
    assert radius[1] > radius[0]


def test_the_rest_shape_of_a_garment_of_a_run_stays(place, worn):
    before = clothsim.open_run(place[0] / "slip").scene.cloths[0]["mesh"]
    after = clothsim.open_run(place[0] / "both").scene.cloths[0]["mesh"]
    np.testing.assert_array_equal(before.rest, after.rest)
    assert set(after.groups) == {"front", "back"}


@pytest.mark.parametrize("status", ["failed", "interrupted"])
def test_a_run_that_did_not_complete_is_named(place, tmp_path, status):
    folder, _ = place
    for name in ("trajectory.vtkhdf", "checkpoint.npz", SUMMARY_NAME):
        (tmp_path / name).write_bytes((folder / "slip" / name).read_bytes())
    write_summary(tmp_path / SUMMARY_NAME, {**read_summary(tmp_path / SUMMARY_NAME), "status": status})
    with pytest.raises(InputError, match=status):
        clothsim.outfit([folder / "skirt_specification.json"], over=tmp_path)


def test_bad_outfits_are_refused(place, tmp_path):
    folder, body = place
    slip, skirt = (folder / f"{name}_specification.json" for name in ("slip", "skirt"))
    other = clothsim.Body(*person(0.07), name="other")
    with pytest.raises(InputError, match="twice"):
        clothsim.outfit([slip, slip], body)
    with pytest.raises(InputError, match="twice"):
        clothsim.outfit([slip], over=folder / "slip")
    with pytest.raises(InputError, match="another body"):
        clothsim.outfit([skirt], other, over=folder / "slip")
    with pytest.raises(InputError, match="no body"):
        clothsim.outfit([skirt])
    with pytest.raises(InputError, match="no pattern"):
        clothsim.outfit([], body)
    with pytest.raises(InputError, match="no run directory"):
        clothsim.outfit([skirt], over=tmp_path / "nowhere")
    with pytest.raises(InputError, match="hold is now waistband"):
        clothsim.outfit([slip], body, hold=True, waistband=True)
    with pytest.raises(InputError, match="cut_for is now made_for"):
        clothsim.outfit([slip], body, cut_for=body, made_for=body)
    for given in (None, slip, str(slip), [slip, 3]):
        with pytest.raises(InputError, match="pattern"):
            clothsim.outfit(given, body)


def test_a_pattern_that_cannot_be_read_is_refused_before_the_first_is_sewn(place, tmp_path):
    folder, body = place
    empty = tmp_path / "empty_specification.json"
    empty.write_text("{}")
    with pytest.raises(InputError, match="empty_specification"):
        clothsim.outfit([folder / "slip_specification.json", empty], body, tmp_path / "out", size=SPACING)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("name", "drop", "crotch", "fault"),
    [
        ("skirt", 0.0, 0.0, ""),
        ("skirt", 2.0, 0.0, "skirt: The garment falls off the body: it moved by 2"),
        ("skirt", 0.5, 0.9, "skirt: The garment slid off"),
        ("slip", 0.5, 0.9, "slip: The garment slid off"),
    ],
)
def test_what_falls_or_slides_off_in_the_drape_of_all_has_failed(
    place, worn, tmp_path, monkeypatch, name, drop, crotch, fault
):
    """The drape of the outfit once more, a garment lower by `drop` [m]; crotch: its height above the ground [m]."""
    folder, _ = place
    draped = worn.run[-1].positions
    draped[name] = draped[name] - drop * worn.body.up
    monkeypatch.setattr(outfit, "CELL", CELL)
    monkeypatch.setattr(outfit, "LAYER", LAYER)

    class Fallen:
        status, triangles, directory, summary = "completed", worn.run.triangles, tmp_path, worn.run.summary

        def positions(self, frame):
            return np.concatenate([*draped.values()])

        def __getitem__(self, frame):
            return SimpleNamespace(positions=draped)

    def draped_again(garments, body, *given):
        write_summary(tmp_path / SUMMARY_NAME, worn.run.summary)
        if crotch:
            body.__dict__["parts"] = SimpleNamespace(landmarks={"crotch": crotch})
        return Fallen()

    monkeypatch.setattr(outfit, "draped_together", draped_again)
    monkeypatch.setattr(outfit, "count_penetrations", lambda *given: Counts(0, 0.0, 0, 0, None))
    pattern = folder / "skirt_specification.json"
    done = clothsim.outfit([pattern], output=tmp_path, over=folder / "slip", size=SPACING, overwrite=True)
    assert (done.status, fault in done.reason) == ("failed" if fault else "completed", True), done.reason


@pytest.mark.parametrize("reach", [0.0, 0.3])
def test_a_wrap_with_a_triangle_through_its_outside_does_not_hold_the_garment(monkeypatch, reach):
    """Two balls apart, and a strip whose ends lie within them: no vertex is outside, its middle is."""
    positions, triangles = GENERATORS["sphere"](radius=1.0, subdivisions=2)
    body = BodyMesh("ball", positions + np.array([0.0, 5.0, 0.0]), triangles, 1.0, ())
    shells = []

    def shell(surface, garments, layer, cell):
        apart = [0.0, 0.0, 0.0] if shells else [1.0, 0.0, 0.0]
        shells.append(apart)
        if not any(apart):
            return 3.0 * positions, triangles
        both = np.concatenate([0.5 * positions - apart, 0.5 * positions + apart])
        return both, np.concatenate([triangles, triangles + len(positions)])

    monkeypatch.setattr(outfit, "wrap", shell)
    x = 1.0 if reach else -0.9
    strip = np.array([[-1.0, 0.0, 0.0], [x, 0.05, 0.0], [x, -0.05, 0.0]]), np.array([[0, 1, 2]])
    made = outfit.wrapped(body, body_surface(body.positions, triangles), [strip])
    assert len(shells) == (2 if reach else 1)
    assert made.like is body


def test_a_garment_that_still_moves_is_sewn_and_worn_below_the_next(place, tmp_path, monkeypatch):
    folder, body = place
    for module in (pipeline, outfit):
        monkeypatch.setattr(module, "unrest", lambda run, body: f"not at rest on {body}")
    found = clothsim.outfit([folder / "slip_specification.json"], body, tmp_path / "out", size=SPACING)
    assert [each.status for each in found.sewn] == ["sewn"]
    assert found.sewn[0].draped
    assert found.run.status == "completed"
    assert found.counts.clean
    assert found.status == read_summary(found.directory / SUMMARY_NAME)["status"] == "sewn"


def test_a_body_with_a_wrap_faces_where_the_body_does():
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    positions, triangles = GENERATORS["mannequin"]()
    trousers, faces = GENERATORS["trousers"](edge=0.04)
    body = BodyMesh("turned", positions @ turn, triangles, 1.0, ())
    both = outfit.wrapped(body, body_surface(body.positions, triangles), [(trousers @ turn, faces)])
    np.testing.assert_allclose(both.front, body.front)
    np.testing.assert_allclose(np.abs(body.front), [1.0, 0.0, 0.0], atol=0.05)


def test_a_wrap_is_closed_and_holds_the_garment_and_adds_nothing_to_the_bare_body(place, worn):
    wrapping, body = worn.sewn[0].body, worn.body
    outside = body_surface(wrapping.positions, wrapping.triangles)
    assert is_closed(wrapping.triangles)
    slip = clothsim.open_run(place[0] / "slip").positions(-1)
    assert outside.closest(slip).signed_distance.max() < 0
    assert -outside.closest(slip).signed_distance.min() > LAYER / 2
    assert wrapping.like is body
    levels, own = wrapping.positions[len(body.positions) :] @ body.up, slip @ body.up
    assert levels.max() < own.max() + (REACH + 1) * CELL
    assert levels.min() > own.min() - (REACH + 1) * CELL
    head = body.positions[body.positions @ body.up > 0.9 * (body.positions @ body.up).max()]
    assert np.abs(outside.closest(head).signed_distance).max() < 1e-9
