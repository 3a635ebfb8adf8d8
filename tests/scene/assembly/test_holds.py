"""Support of the cloth at the start: what is refused, what may hold each piece."""

import pytest
from small_scenes import BALL, SHEET

from clothsim import InputError, Scene
from clothsim.run.check import check, examined
from clothsim.scene.assembly.holds import MANY, MOST_LINES, hold_notes, holds
from clothsim.scene.assembly.scene_world import build

LOADED = {"membrane": {}, "bending": {}, "gravity": {}}
CART = {**BALL, "motion": {"velocity": [1.0, 0, 0]}}
TWO = [{**SHEET, "name": "a", "position": [0.0, 0.0, 0.4]}, {**SHEET, "name": "b"}]

APART = [{**SHEET, "name": "a"}, {**SHEET, "name": "b", "position": [5.0, 0.0, 0.33]}]


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
        (LOADED | {"self_contact": {}, "pins": {"select": [3]}}, TWO, (), "b"),  # b is below a, which is pinned
        (LOADED | {"body_contact": {}}, {**SHEET, "position": [1.5, 0, 0.4]}, BALL, "cloth"),
        (LOADED | {"body_contact": {}}, {**SHEET, "position": [0, 0, -0.8]}, BALL, "cloth"),
        (LOADED | {"body_contact": {}, "self_contact": {}, "friction": {}}, APART, BALL, "b"),
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
        (LOADED | {"self_contact": {}, "pins": {"select": [28]}}, TWO, ()),  # a may come to lie on b
        (LOADED | {"body_contact": {}}, {**SHEET, "position": [1.5, 0, 0.4]}, CART),
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


def held(effects, cloth=SHEET, body=(), **run):
    made = built(effects, cloth, body)
    return holds(made.world, made.energies, made.constraints.values(), run.get("duration", 2.0))


STITCHED = {"from": {"cloth": "a", "vertices": [0, 1, 2]}, "to": {"cloth": "b", "vertices": [0, 1, 2]}}


def test_a_stitched_piece_is_held_by_the_pins_of_the_other():
    """It was refused without a word on its seam."""
    seamed = LOADED | {"pins": {"select": [24]}, "seams": {"seam": [{**STITCHED, "end": 1.0}]}}
    (one,) = held(seamed, TWO)
    assert one.holders == ("pins (1)",)


def test_what_holds_each_piece_is_named():
    springs = {"spring": [{"select": [30], "stiffness": 10.0}]}
    first, second = held(LOADED | {"pins": {"select": [3, 4]}, "springs": springs}, TWO)
    assert (first.holders, second.holders) == (("pins (2)",), ("springs (1)",))
    (over,) = held(LOADED | {"body_contact": {}, "friction": {}}, SHEET, BALL)
    assert over.holders == ("ball under it, with friction",)
    assert not over.falls
    (free,) = held(LOADED | {"inertia": {}})
    assert free.falls
    assert free.load[2] == pytest.approx(-(free.load.dot(free.load) ** 0.5))


TOUCHING = LOADED | {"inertia": {}, "body_contact": {}, "self_contact": {}}
FLOOR = {"name": "floor", "mesh": "slab", "size": [4, 4, 0.1], "position": [0, 0, -0.05]}


def test_what_only_lies_under_a_pinned_cloth_is_on_its_way():
    """A ball that flew at a curtain was said to hold it, and 25 needles stood in a line."""
    needles = [{**BALL, "name": f"needle {k}", "position": [0, 0, -0.6 * k]} for k in range(5)]
    effects = TOUCHING | {"pins": {"select": [0]}}
    made = build(Scene(cloth=SHEET, body=needles, effects=effects, solver={"linear": "superlu"}))
    (one,) = holds(made.world, made.energies, made.constraints.values(), 2.0)
    assert (one.holders, len(one.way)) == (("pins (1)",), 5)
    assert hold_notes([one])[0].endswith("on its way: needle 0, needle 1, needle 2 and 2 more.")
    ball = {"name": "ball", "mesh": "sphere", "radius": 0.1, "density": 100, "position": [0, 0, -0.6]}
    made = build(Scene(cloth=SHEET, rigid=ball, body=FLOOR, effects=effects, solver={"linear": "superlu"}))
    (one,) = holds(made.world, made.energies, made.constraints.values(), 2.0)
    assert (one.holders, one.way) == (("pins (1)",), ("floor",))


def test_what_lies_between_holds_a_piece_rather_than_the_floor():
    """Every sheet of a stack, and the upper storey of a house of cards, was said to be held by the table."""
    stack = [{**SHEET, "name": name, "position": [0, 0, z]} for name, z in (("a", 0.1), ("b", 0.3), ("c", 0.2))]
    aside = {**SHEET, "name": "d", "position": [1.5, 0, 0.4]}
    made = build(Scene(cloth=[*stack, aside], body=FLOOR, effects=TOUCHING, solver={"linear": "superlu"}))
    found = holds(made.world, made.energies, made.constraints.values(), 2.0)
    assert [each.holders[0].partition(" under")[0] for each in found] == ["floor", "c", "a", "floor"]
    under_the_floor = {**FLOOR, "position": [0, 0, 0.2]}
    made = build(Scene(cloth=stack[:2], body=under_the_floor, effects=TOUCHING, solver={"linear": "superlu"}))
    found = holds(made.world, made.energies, made.constraints.values(), 2.0)
    assert [each.holders for each in found] == [(), ("floor under it",)]


def test_a_cloth_that_can_never_rest_is_told_so_by_check():
    scene = {"cloth": SHEET, "effects": LOADED | {"inertia": {}}, "solver": {"linear": "superlu"}}
    until_rest = check(Scene(**scene, run={"until": "rest"}))
    assert [finding.severity for finding in until_rest] == ["warning"]
    assert "cloth" in until_rest[0].sentence
    assert check(Scene(**scene)) == []
    assert any("nothing" in note for note in examined(Scene(**scene)).notes)


def test_a_sheet_beside_its_ball_is_an_error_of_check():
    scene = Scene(cloth={**SHEET, "position": [1.5, 0, 0.4]}, body=BALL, effects=LOADED | {"body_contact": {}})
    assert [finding.severity for finding in check(scene)] == ["error"]


def test_many_pieces_are_few_lines(tmp_path):
    count = MANY + 1
    corners = [f"v {x + 2 * k} {y} 1" for k in range(count) for x, y in ((0, 0), (1, 0), (0, 1), (1, 1))]
    faces = [f"f {4 * k + a} {4 * k + b} {4 * k + c}" for k in range(count) for a, b, c in ((1, 2, 3), (3, 2, 4))]
    (tmp_path / "many.obj").write_text("\n".join(corners + faces))
    body = {"name": "floor", "mesh": "slab", "size": [400, 400, 0.2]}
    effects = {"membrane": {}, "gravity": {}, "inertia": {}, "body_contact": {}}
    made = build(Scene(cloth={"mesh": "many.obj"}, body=body, effects=effects, directory=tmp_path))
    found = holds(made.world, made.energies, made.constraints.values(), 2.0)
    assert len(found) == count
    assert {each.holders for each in found} == {("floor under it",)}
    assert len(hold_notes(found)) == 1
    names = [f"{k}" for k in range(count)]
    different = [type(found[0])(name, 0, (name,), found[0].load) for name in names]
    assert len(hold_notes(different)) == MOST_LINES + 1
