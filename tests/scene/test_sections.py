"""Sections of a scene: typed, frozen, hashable, with the keys that were given."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

import clothsim
from clothsim import Body, Cloth, Contact, Gravity, Motion, Pins, RunSettings, Scene, Seed, Solver
from clothsim.keys.generator_keys import Rectangle, Ring
from clothsim.keys.key_table import KeyTable, composed
from clothsim.keys.mesh_keys import (
    BodyTable,
    ClipKeys,
    ClothTable,
    FilePart,
    FramesTable,
    JointKeys,
    ModelTable,
    PatternFile,
    RigidTable,
    TieKeys,
)

SHEET = {"mesh": "rectangle", "size": [1, 2]}
POINTS, FACES = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]
SCENE = Scene(
    cloth=[SHEET, {"mesh": "a.obj", "group": "sleeve"}, Cloth(POINTS, FACES, density=0.2)],
    body=[
        {"mesh": "sphere", "motion": {"velocity": [1, 0, 0]}},
        {"frames": "kick*.obj"},
        {"model": "mannequin", "motion": {"clip": "walk"}},
        Body(POINTS, FACES, name="floor"),
    ],
    rigid={"mesh": "ring", "joint": {"point": [0, 0, 1]}, "tie": [{"select": "corners"}]},
    effects={"pins": {"select": [0, 1], "motion": {"velocity": [0, 0, 1]}}, "gravity": {}},
    solver={"dt": 1},
    run={"duration": 3},
)


def test_every_section_is_typed():
    assert [type(SCENE.solver), type(SCENE.contact), type(SCENE.run), type(SCENE.seed)] == [
        Solver,
        Contact,
        RunSettings,
        Seed,
    ]
    assert [type(each) for each in SCENE.effects.values()] == [Pins, Gravity]
    assert all(isinstance(each, ClothTable) for each in SCENE.cloths)
    assert [type(each).composed_of or type(each) for each in SCENE.bodies] == [
        (BodyTable, clothsim.keys.generator_keys.Sphere),
        (FramesTable, FilePart),
        ModelTable,
        BodyTable,
    ]
    assert isinstance(SCENE.rigid, RigidTable)
    assert isinstance(SCENE.rigid, Ring)


def test_nested_tables_are_typed():
    assert SCENE.effects["pins"].motion == Motion(velocity=(0, 0, 1))
    assert type(SCENE.bodies[0].motion) is Motion
    assert type(SCENE.bodies[2].motion) is ClipKeys
    assert type(SCENE.rigid.joint) is JointKeys
    assert [type(each) for each in SCENE.rigid.tie] == [TieKeys]


def test_attributes_have_the_defaults_and_the_table_has_what_was_given():
    assert SCENE.solver.dt == 1.0
    assert SCENE.solver.integrator == "bdf2"
    assert dict(SCENE.solver) == {"dt": 1}
    assert SCENE.cloths[0].size == (1, 2)
    assert SCENE.cloths[0].cells == Rectangle().cells == (40, 40)
    assert SCENE.cloths[0].fabric == "cotton"
    assert SCENE.cloths[1].group == "sleeve"
    assert SCENE.cloths[2].density == 0.2
    assert SCENE.effects["gravity"].acceleration == (0.0, 0.0, -9.81)
    assert SCENE.effects["gravity"] == {}
    assert SCENE.effects["gravity"]
    assert "integrator" not in SCENE.solver
    assert {**SCENE.solver, "dt": 2} == {"dt": 2}
    assert Scene(cloth={"mesh": "x.json"}).cloth.size == PatternFile().size == 0.02


@pytest.mark.parametrize(
    "change",
    [
        lambda: setattr(SCENE.solver, "dt", 2.0),
        lambda: setattr(SCENE.cloths[0], "size", (1, 1)),
        lambda: SCENE.cloths[0].__setitem__("size", (1, 1)),
        lambda: SCENE.effects.__setitem__("air", Gravity()),
        lambda: SCENE.effects["pins"].select.__setitem__(0, 3),
        lambda: SCENE.effects["pins"].motion.velocity.__setitem__(0, 3),
    ],
)
def test_sections_refuse_changes(change):
    before = hash(SCENE)
    with pytest.raises((TypeError, AttributeError)):
        change()
    assert hash(SCENE) == before


@pytest.mark.parametrize("name", ["cloth", "body", "rigid"])
def test_one_table_and_a_list_of_one_are_equal_scenes(name):
    table = {"mesh": "ring", "name": "a"}
    given = {"cloth": SHEET} | {name: table}
    one, other = Scene(**given), Scene(**given | {name: [table]})
    assert one == other
    assert hash(one) == hash(other)
    assert one != Scene(**given | {name: [{"mesh": "ring", "name": "b"}]})
    assert one != Scene(**given | {name: [table, {"mesh": "ring", "name": "b"}]})


def test_sections_are_equal_by_kind_and_given_keys():
    assert Solver.parsed("solver", {"dt": 0.02}) == Solver(dt=0.02)
    assert hash(Solver.parsed("solver", {"dt": 0.02})) == hash(Solver(dt=0.02))
    assert Solver(dt=0.02) == {"dt": 0.02}
    assert Gravity() != clothsim.Inertia()
    assert {Gravity(): 1}[Gravity()] == 1
    assert repr(Gravity(acceleration=[0, 0, -1])) == "Gravity(acceleration=(0, 0, -1))"


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])
def test_copies_are_equal(copied):
    again = copied(SCENE)
    assert again == SCENE
    assert hash(again) == hash(SCENE)
    assert again.to_text() == SCENE.to_text()
    for section in (*SCENE.cloths, *SCENE.bodies, *SCENE.effects.values(), SCENE.rigid, Cloth(POINTS, FACES)):
        other = copied(section)
        assert type(other) is type(section)
        assert other == section


def test_arrays_of_a_section_are_locked_also_after_a_pickle():
    pins = Pins(select=np.array([0, 1]))
    for each in (pins, pickle.loads(pickle.dumps(pins)), Scene(cloth=SHEET, effects=[pins]).effects["pins"]):
        with pytest.raises(ValueError, match="read-only"):
            each.select[0] = 2


def test_a_replaced_field_gives_its_key_alone():
    solver = replace(Solver(dt=0.02), threads=1)
    assert set(solver.given) == {"dt", "threads"}
    assert Scene(cloth=SHEET, solver=solver).solver == {"dt": 0.02, "threads": 1}
    assert replace(Gravity(), acceleration=(0, 0, -1)).given == ("acceleration",)
    assert Solver(dt=0.01).given == ("dt",)
    still = {"velocity": [0, 0, 0], "rotate_degrees_per_second": [0, 0, 0], "centre": [0, 0, 0]}
    assert Motion.parsed("motion", still).given == tuple(still)
    assert pickle.loads(pickle.dumps(Motion.parsed("motion", still))).given == tuple(still)


def test_a_section_of_the_same_kind_is_taken_as_it_is():
    assert replace(SCENE, run={"duration": 2.0}).cloths[0] is SCENE.cloths[0]
    assert replace(SCENE, run={"duration": 2.0}).effects["pins"] is SCENE.effects["pins"]


def test_a_composed_section_is_made_once_and_its_last_part_rules():
    both = composed((ClothTable, Ring))
    assert both is composed((ClothTable, Ring))
    assert issubclass(both, KeyTable)
    assert composed((ClothTable,)) is ClothTable
    made = both.parsed("cloth", {"mesh": "ring"})
    assert made.thickness == Ring().thickness
    assert made.section == "cloth"
