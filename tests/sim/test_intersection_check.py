"""Exact intersection check: the pairs that effects require, and its coverage in the certificate."""

import numpy as np
import pytest
from meshes import cloth, grid

from clothsim.io.run_surfaces import world_surfaces
from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world
from clothsim.sim.intersection_check import intersection_check_of

TESTED = "tested at every frame"
ACROSS = np.array([[0.1, 0.3, -1], [0.9, 0.3, -1], [0.5, 0.3, 1]])


def world(*bodies):
    """A sheet and a flag that cross, and bodies of one triangle that cross the sheet."""
    flag = cloth(ACROSS + np.array([0, 0.4, 0]), np.array([[0, 1, 2]]), name="flag")
    return make_world([cloth(*grid(2, 2), name="sheet"), flag], [make_body(b, ACROSS, [[0, 1, 2]]) for b in bodies])


def judged(scene, effects):
    check = intersection_check_of(world_surfaces(scene), effects, effects)
    found = check.crossings(scene.start())
    return check, found, [crossing.second for crossing in check.violations(found)]


@pytest.mark.parametrize(
    ("effects", "found", "violations"),
    [
        ({}, ["post"], []),
        ({"body_contact": {}}, ["post"], ["post"]),
        ({"self_contact": {}}, ["flag", "post"], ["flag"]),
        ({"body_contact": {}, "self_contact": {}}, ["flag", "post"], ["flag", "post"]),
        ({"body_contact": {"exclude": [["post", "sheet"]]}}, [], []),
        ({"body_contact": {}, "self_contact": {"exclude": [["sheet", "flag"]]}}, ["post"], ["post"]),
    ],
)
def test_bodies_are_checked_always_and_cloth_where_self_contact_is_on(effects, found, violations):
    _, crossed, failed = judged(world("post"), effects)
    assert [crossing.second for crossing in crossed] == found
    assert failed == violations
    assert all(len(crossing.pairs) == 1 for crossing in crossed)


def test_report():
    assert judged(world(), {})[0].coverage() == {"cloth_body": "no body", "cloth_cloth": "not requested"}
    assert judged(world("post"), {"self_contact": {}})[0].coverage() == {"cloth_body": TESTED, "cloth_cloth": TESTED}
    output = judged(world("post"), {"body_contact": {"exclude": [["post", "flag"]]}})[0].coverage()
    assert output["cloth_body"] == f"{TESTED} but for excluded pairs"


def test_cloth_can_be_tested_without_being_promised():
    scene = world()
    check = intersection_check_of(world_surfaces(scene), {}, {})
    assert check.crossings(scene.start()) == ()
    found = check.crossings(scene.start(), cloth_cloth=True, limit=100)
    assert [crossing.summary for crossing in found] == ["sheet and flag intersect"]
    assert len(found[0].pairs) > 1
    assert check.violations(found) == []
