"""Support check: a quasi-static scene with an unsupported cloth is refused at the start."""

import pytest
from small_scenes import BALL, SHEET

from clothsim import InputError, Scene
from clothsim.scene.assembly.scene_world import build

LOADED = {"membrane": {}, "bending": {}, "gravity": {}}
TWO = [{**SHEET, "name": "a", "position": [0.0, 0.0, 0.4]}, {**SHEET, "name": "b"}]


def built(effects, cloth=SHEET, body=()):
    return build(Scene(cloth=cloth, body=body, effects=effects, solver={"linear": "superlu"}))


@pytest.mark.parametrize(
    ("effects", "cloth", "body", "name"),
    [
        (LOADED, SHEET, (), "cloth"),
        (LOADED, SHEET, BALL, "cloth"),  # a body that nothing lets it touch
        (LOADED | {"pins": {"select": []}}, SHEET, (), "cloth"),
        (LOADED | {"damping": {"rate": 0, "strain_rate": 1.0}}, SHEET, (), "cloth"),  # it resists strain alone
        (LOADED | {"air": {}}, SHEET, (), "cloth"),  # still air resists what moves already
        (LOADED | {"pins": {"select": [3]}}, TWO, (), "b"),
        (LOADED | {"self_contact": {}, "friction": {}}, TWO, (), "a"),
    ],
)
def test_a_loaded_cloth_that_nothing_holds_is_refused(effects, cloth, body, name):
    with pytest.raises(InputError, match=rf"{name}.*\d N") as refusal:
        built(effects, cloth, body)
    assert "effects.inertia" in refusal.value.remedy
    assert "\n" not in refusal.value.sentence


def test_its_load_is_its_weight():
    with pytest.raises(InputError, match=f"{0.15 * 9.81:.3g} N"):
        built({"membrane": {}, "gravity": {}}, {**SHEET, "density": 0.15})


@pytest.mark.parametrize(
    ("effects", "cloth", "body"),
    [
        (LOADED | {"pins": {"select": [0]}}, SHEET, ()),
        (LOADED | {"inertia": {}}, SHEET, ()),
        (LOADED | {"damping": {}}, SHEET, ()),
        (LOADED | {"body_contact": {}}, SHEET, BALL),
        (LOADED | {"self_contact": {}, "pins": {"select": [3]}}, TWO, ()),  # b may come to lie on a
        ({"membrane": {}, "bending": {}}, SHEET, ()),
    ],
)
def test_what_is_held_resisted_or_not_loaded_is_built(effects, cloth, body):
    assert built(effects, cloth, body).energies


def test_a_piece_of_a_cloth_is_named_by_its_first_vertex(tmp_path):
    corners = [f"v {x + far} {y} 0" for far in (0, 5) for x, y in ((0, 0), (1, 0), (0, 1), (1, 1))]
    faces = [f"f {a} {b} {c}" for a, b, c in ((1, 2, 3), (3, 2, 4), (5, 6, 7), (7, 6, 8))]
    (tmp_path / "two.obj").write_text("\n".join(corners + faces))
    effects = {"membrane": {}, "gravity": {}, "pins": {"select": [0]}}
    with pytest.raises(InputError, match=r"cloth.*\b4\b"):
        build(Scene(cloth={"mesh": "two.obj"}, effects=effects, directory=tmp_path))
