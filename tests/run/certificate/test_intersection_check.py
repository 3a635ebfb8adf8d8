"""Exact intersection check: all pairs, those that effects require to be free, and its coverage in the certificate."""

import numpy as np
import pytest
from meshes import cloth, grid

from clothsim.keys.typed_effects import TYPED_EFFECTS
from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world, world_surfaces
from clothsim.run.certificate.intersection_check import intersection_check_of

ACROSS = np.array([[0.1, 0.3, -1], [0.9, 0.3, -1], [0.5, 0.3, 1]])


def world(*bodies):
    """A sheet and a flag that cross, and bodies of one triangle that cross the sheet."""
    flag = cloth(ACROSS + np.array([0, 0.4, 0]), np.array([[0, 1, 2]]), name="flag")
    return make_world([cloth(*grid(2, 2), name="sheet"), flag], [make_body(b, ACROSS, [[0, 1, 2]]) for b in bodies])


def check_of(scene, effects):
    sections = {name: TYPED_EFFECTS[name].parsed(name, keys) for name, keys in effects.items()}
    return intersection_check_of(world_surfaces(scene), sections, effects)


@pytest.mark.parametrize(
    ("effects", "kinds", "violations"),
    [
        ({}, ["cloth_cloth", "cloth_body"], []),
        ({"body_contact": {}}, ["cloth_cloth", "cloth_body"], ["post"]),
        ({"self_contact": {}}, ["cloth_cloth", "cloth_body"], ["flag"]),
        ({"body_contact": {}, "self_contact": {}}, ["cloth_cloth", "cloth_body"], ["flag", "post"]),
        ({"body_contact": {"exclude": [["post", "sheet"]]}}, ["cloth_cloth", "excluded"], []),
        ({"body_contact": {}, "self_contact": {"exclude": [["sheet", "flag"]]}}, ["excluded", "cloth_body"], ["post"]),
    ],
)
def test_all_pairs_are_checked_and_effects_say_which_must_be_free(effects, kinds, violations):
    scene = world("post")
    check = check_of(scene, effects)
    found = check.crossings(scene.start())
    assert [crossing.second for crossing in found] == ["flag", "post"]
    assert [check.kind(crossing) for crossing in found] == kinds
    assert [crossing.second for crossing in check.violations(found)] == violations
    assert all(len(crossing.pairs) > 1 for crossing in found)


def test_coverage():
    at_every_step = check_of(world("post"), {}).coverage()
    assert set(at_every_step) == {"cloth_body", "cloth_cloth"}
    assert at_every_step["cloth_body"] == at_every_step["cloth_cloth"]
    alone = check_of(world(), {}).coverage()
    assert alone == {**at_every_step, "cloth_body": "no body"}
    assert check_of(world(), {}).coverage(complete=False)["cloth_cloth"] != at_every_step["cloth_cloth"]


def test_positions_are_in_the_coordinates_of_the_scene():
    scene, origin = world("post"), np.array([10.0, -20.0, 5.0])
    check = check_of(scene, {})
    local, shifted = check.crossings(scene.start()), check.crossings(scene.start(), origin)
    for one, other in zip(local, shifted, strict=True):
        assert np.allclose(other.position, one.position + origin, atol=1e-12)
        assert np.array_equal(one.pairs, other.pairs)
