"""Heights at which panels are worn: those of a garment as it was sewn on the body that it was cut for."""

import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from capsule_bodies import person
from sewing_patterns import capsule_skirt, panel, specification

import clothsim
from clothsim.base.errors import InputError, MachineError
from clothsim.garments import dressed
from clothsim.garments.dress import worn_levels as module
from clothsim.garments.dress.pipeline import DressState, DressTask
from clothsim.garments.dress.placement import height_of_origin
from clothsim.garments.dress.sewing_state import Fabrics, as_placed
from clothsim.garments.dress.worn_levels import DRAWN, WornLevels, levels_by_panel, worn_levels
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.sewing_attempts import COARSEST
from clothsim.garments.stages import Stage
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of
from transfer.signed_distance import body_surface

FLOOR, SIZE = 0.3, 0.05
SKIRT = pattern_of(capsule_skirt(40))


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    """A person of capsules, 1.7 m tall, arms half raised."""
    return BodyMesh("person", *person(0.05), 1.0, ())


def task_of(body: BodyMesh, **keys) -> DressTask:
    surface = body_surface(body.positions, body.triangles)
    folder = Path(tempfile.gettempdir())
    return replace(DressTask(body, surface, Fabrics("cotton"), False, folder, lambda stage: None, None, None), **keys)


def test_levels_of_what_is_worn_lower_and_longer_than_drawn():
    """Worn heights that are linear in the drawn ones, to what differs within half a row."""
    pattern = pattern_of(specification({"front": panel([[0, 0], [30, 0], [30, 47], [0, 47]], translation=[0, 40, 0])}))
    state = as_placed(mesh_pattern(pattern, SIZE))
    drawn = state.positions[:, 1] + FLOOR
    level = levels_by_panel(state, pattern, 1.2 * drawn - 0.1, FLOOR, SIZE)["front"]
    heights = np.linspace(0.7, 1.17, 40)
    np.testing.assert_allclose(level(heights), 1.2 * heights - 0.1, atol=0.2 * SIZE)
    assert np.all(np.diff(level(heights)) > 0)


def test_at_one_height_the_highest_worn_counts():
    """Half of a circle skirt: at the height of its centre it has the waist and, at both ends, the hem."""
    angles = np.linspace(np.pi, 2 * np.pi, 25)
    rings = [np.column_stack([r * np.cos(way), r * np.sin(way)]) for r, way in ((60, angles), (15, angles[::-1]))]
    pattern = pattern_of(specification({"half": panel(np.concatenate(rings).tolist(), translation=[0, 100, 20])}))
    state = as_placed(mesh_pattern(pattern, SIZE))
    radius = np.linalg.norm(state.mesh.panel_coordinates, axis=1)
    level = levels_by_panel(state, pattern, 1.0 - (radius - 0.15), 0.0, SIZE)["half"]
    waist, hem = level(np.array([1.0, 0.42]))
    assert waist == pytest.approx(1.0, abs=0.07)
    assert hem == pytest.approx(0.55, abs=0.07)


@pytest.mark.parametrize("flat", [[90, 0, 0], [0, 0, 0]])
def test_a_panel_of_one_row_has_one_level(flat):
    collar = panel([[-8, 0], [8, 0], [8, 3], [-8, 3]], translation=[0, 140, 0], rotation=flat)
    pattern = pattern_of(specification({"collar": collar}))
    state = as_placed(mesh_pattern(pattern, SIZE))
    level = levels_by_panel(state, pattern, np.full(len(state.positions), 1.3), 0.0, SIZE)["collar"]
    assert level(np.array([1.0, 1.4, 1.5])) == pytest.approx([1.3] * 3)


def test_a_skirt_is_worn_where_it_rests_once_it_is_sewn(body, tmp_path):
    """The levels of its edges are the heights at which they lie in a dress of the same mesh, on a body elsewhere."""
    stages: list[Stage] = []
    entries = capsule_skirt(40)
    for each in entries["pattern"]["panels"].values():
        each["translation"][1] = 92  # 8 cm higher than it is worn
    skirt = pattern_of(entries)
    moved = BodyMesh("moved", body.positions + np.array([0.0, 0.4, 0.0]), body.triangles, 1.0, ())
    worn = worn_levels(task_of(body, on_stage=stages.append), moved, skirt, "floor")
    done = clothsim.dress(skirt, clothsim.Body(body.positions, body.triangles), tmp_path, size=COARSEST * body.height)
    assert done.status == "completed"
    assert stages[0].name == "place on moved"
    lines = done.state.positions[done.state.number][:, 1] - body.positions[:, 1].min()
    for name in skirt.panels:
        drawn = done.state.mesh.positions[done.state.mesh.vertices[name], 1]
        for height in (drawn.min(), drawn.max()):
            own = lines[done.state.mesh.vertices[name]][np.abs(drawn - height) < 0.01]
            found = float(worn.of(name)(np.array([height - body.positions[:, 1].min()]))[0])
            assert own.min() - 0.02 < found < own.max() + 0.02
            assert found < height - body.positions[:, 1].min() - 0.05
    assert "moved" in worn.note


def test_it_is_sewn_as_the_garment_will_be_but_for_half_of_the_budget(body, monkeypatch, tmp_path):
    given = []

    def sewn(task, pattern, size, origin, coarse, notes):
        given.append((task, size, origin, coarse))
        state = as_placed(mesh_pattern(pattern, size))
        return None, DressState(state, SimpleNamespace(body=task.body), ())

    monkeypatch.setattr(module, "sewn_at", sewn)
    monkeypatch.setattr(module, "process_time", lambda: 10.0)
    other = BodyMesh("other", 1.1 * body.positions, body.triangles, 1.0, ())
    task = task_of(body, ends=30.0, waistband=True, directory=tmp_path, fabrics=Fabrics("denim"))
    worn_levels(task, other, SKIRT, "floor")
    ((own, size, origin, coarse),) = given
    assert (own.body, own.waistband, own.fabrics, own.ends) == (other, True, task.fabrics, 20.0)
    assert own.directory != tmp_path
    assert (size, origin, coarse) == (pytest.approx(COARSEST * 1.1 * body.height), "floor", False)
    assert not own.directory.exists()
    worn_levels(replace(task, ends=np.inf), other, SKIRT, "floor")
    assert given[1][0].ends == np.inf


@pytest.mark.parametrize("fault", ["failed", "refused", "open body", "slid"])
def test_what_cannot_be_sewn_is_graded_as_drawn_with_the_reason(body, monkeypatch, fault):
    def sewn(task, pattern, size, origin, coarse, notes):
        if fault == "refused":
            raise InputError("It has no panel.", "Give one.")
        done = DressState(as_placed(mesh_pattern(pattern, size)), SimpleNamespace(body=task.body), ())
        if fault == "slid":
            return None, replace(done, state=done.state.moved_to(done.state.positions - [0.0, 0.13, 0.0]))
        return None, done.failed("Seam a stays open.")

    monkeypatch.setattr(module, "sewn_at", sewn)
    source = BodyMesh("sheet", body.positions[:3], np.array([[0, 1, 2]]), 1.0, ()) if fault == "open body" else body
    worn = worn_levels(task_of(body), source, SKIRT, "floor")
    heights = np.array([0.3, 1.0])
    assert worn.of("front") is DRAWN.of("front")
    assert np.array_equal(worn.of("front")(heights), heights)
    expected = {"failed": "Seam a stays open.", "refused": "It has no panel.", "open body": "sheet", "slid": "130 mm"}[
        fault
    ]
    assert expected in worn.note


def test_a_fault_of_the_machine_is_none_of_the_pattern(body, monkeypatch):
    def sewn(*given, **settings):
        raise MachineError("No space left on device.", "Free some.")

    monkeypatch.setattr(module, "sewn_at", sewn)
    with pytest.raises(MachineError):
        worn_levels(task_of(body), body, SKIRT, "floor")


def test_what_was_stopped_before_it_was_at_rest_is_said(body, monkeypatch):
    def sewn(task, pattern, size, origin, coarse, notes):
        state = as_placed(mesh_pattern(pattern, size))
        return None, SimpleNamespace(state=state, failure="", status="sewn", reason="The budget is spent.")

    monkeypatch.setattr(module, "sewn_at", sewn)
    assert "The budget is spent." in worn_levels(task_of(body), body, SKIRT, "floor").note


def test_levels_of_a_pattern_from_its_waist_on_a_body_with_z_up(body, monkeypatch):
    """A panel drawn 10 cm below the waist, and worn 5 cm lower."""
    lying = panel([[0, 0], [30, 0], [30, -40], [0, -40]], translation=[0, -10, 0])
    pattern = pattern_of(specification({"front": lying}))
    turned = BodyMesh("turned", body.positions[:, [2, 0, 1]] + [0.0, 0.0, 2.0], body.triangles, 1.0, ())
    assert turned.up.tolist() == [0.0, 0.0, 1.0]

    def sewn(task, pattern, size, origin, coarse, notes):
        state = as_placed(mesh_pattern(pattern, size))
        waist = height_of_origin(turned, "waist")
        x, y, z = state.positions.T
        place = np.column_stack([z, x, y + waist - 0.05 + turned.floor])
        placed = replace(state, positions=place, mesh=replace(state.mesh, positions=place))
        return None, SimpleNamespace(state=placed, failure="", status="completed", reason="")

    monkeypatch.setattr(module, "sewn_at", sewn)
    level = worn_levels(task_of(turned), turned, pattern, "waist").of("front")
    drawn = height_of_origin(turned, "waist") + np.array([-0.12, -0.3, -0.48])
    np.testing.assert_allclose(level(drawn), drawn - 0.05, atol=0.03)


def test_a_garment_is_graded_by_the_levels_at_which_it_is_worn(body, monkeypatch, tmp_path):
    found, given = WornLevels(note="seen"), []

    def seen(task, source, pattern, origin):
        given.append(source)
        return found

    def grade(pattern, source, body, origin, factors, levels):
        given.append(levels)
        raise InputError("Enough.")

    monkeypatch.setattr(dressed, "worn_levels", seen)
    monkeypatch.setattr(dressed, "graded", grade)
    monkeypatch.setattr(dressed, "sizes_between", lambda *given: None)  # the person has no feet
    wearer, other = (clothsim.Body(factor * body.positions, body.triangles) for factor in (1.0, 1.05))
    with pytest.raises(InputError, match="Enough"):
        clothsim.dress(SKIRT, wearer, tmp_path / "a", made_for=other)
    assert given[0].height == pytest.approx(1.05 * body.height)
    assert given[1] is found
    with pytest.raises(InputError, match="tall"):
        clothsim.dress(SKIRT, wearer, tmp_path / "b", made_for=clothsim.Body(100 * body.positions, body.triangles))
    assert len(given) == 2


def test_a_fault_of_the_pattern_as_it_is_cut_is_none_of_its_grading(body, monkeypatch, tmp_path):
    crossed = pattern_of(specification({"front": panel([[0, 0], [30, 30], [30, 0], [0, 30]], translation=[0, 40, 0])}))
    grading = SimpleNamespace(pattern=crossed, origin="floor", crotch=None, notes=())
    monkeypatch.setattr(dressed, "worn_levels", lambda *given: DRAWN)
    monkeypatch.setattr(dressed, "sizes_between", lambda *given: None)
    monkeypatch.setattr(dressed, "graded", lambda *given: grading)
    wearer, other = (clothsim.Body(factor * body.positions, body.triangles) for factor in (1.0, 1.05))
    with pytest.raises(InputError) as fault:
        clothsim.dress(crossed, wearer, tmp_path, made_for=other)
    assert not fault.value.sentence.startswith("Graded")
