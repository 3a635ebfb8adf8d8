"""A body that lies or stands on its head is refused; one that stands, or has no legs, is not."""

import numpy as np
import pytest

import clothsim
from clothsim.base.errors import InputError
from clothsim.garments.fitted import refuse_lying
from clothsim.garments.inputs import BodyMesh
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.generators.table import GENERATORS

MANNEQUIN = GENERATORS["mannequin"]()
RIGHT = np.pi / 2.0


def turned(*angles):
    return BodyMesh("figure", MANNEQUIN[0] @ rotation_matrix(np.array(angles)).T, MANNEQUIN[1], 1.0, ())


@pytest.mark.parametrize(
    ("angles", "named"),
    [((RIGHT, 0, 0), "-y"), ((2 * RIGHT, 0, 0), "-z"), ((0, RIGHT, 0), "+x"), ((0, -RIGHT, 0), "-x")],
    ids=["about_x", "on_its_head", "about_y", "about_minus_y"],
)
def test_a_body_that_does_not_stand_is_refused_with_its_direction(angles, named):
    with pytest.raises(InputError) as caught:
        refuse_lying(turned(*angles))
    assert f"along {named}," in str(caught.value)


@pytest.mark.parametrize("angles", [(0, 0, 0), (-RIGHT, 0, 0), (0, 0, 2.0)], ids=["z_up", "y_up", "heading"])
def test_a_body_that_stands_is_taken(angles):
    refuse_lying(turned(*angles))


@pytest.mark.parametrize("name", ["sphere", "capsule"])
def test_a_body_without_legs_is_taken(name):
    positions, triangles = GENERATORS[name]()
    refuse_lying(BodyMesh(name, positions, triangles, 1.0, ()))


def test_a_fit_refuses_a_lying_body_before_any_stage(tmp_path):
    lying, output = turned(RIGHT, 0, 0), tmp_path / "out"
    with pytest.raises(InputError, match="does not stand"):
        clothsim.fit(
            clothsim.Cloth(*GENERATORS["skirt"](edge=0.04)),
            clothsim.Body(lying.positions, lying.triangles),
            clothsim.Body(*MANNEQUIN),
            output,
        )
    assert not output.exists()
