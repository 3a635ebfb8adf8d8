"""Roles of joints in the naming schemes of the programs that write characters."""

import pytest

from clothsim.files.characters.character import SMPL_JOINTS, parents_of_smpl
from clothsim.files.characters.skeleton import joint_roles
from clothsim.mesh.generators.mannequin.generator import JOINTS, PARENTS

MIDDLE = ("pelvis", "spine", "chest", "neck", "head")
SIDES = tuple(
    f"{side}_{part}" for side in ("left", "right") for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
)
SCHEMES = {
    "mixamo": (
        ["Hips", "Spine", "Spine2", "Neck", "Head", "HeadTop_End"],
        ["Shoulder", "Arm", "ForeArm", "Hand", "HandIndex1", "UpLeg", "Leg", "Foot", "ToeBase"],
        "mixamorig:{side}{part}", "mixamorig:{part}",
    ),
    "unreal": (
        ["pelvis", "spine_01", "spine_03", "neck_01", "head"],
        ["clavicle", "upperarm", "lowerarm", "hand", "index_01", "thigh", "calf", "foot", "ball"],
        "{part}_{s}", "{part}",
    ),
    "blender": (
        ["hips", "spine", "chest", "neck", "head"],
        ["shoulder", "upper_arm", "forearm", "hand", "f_index.01", "thigh", "shin", "foot", "toe"],
        "{part}.{S}", "{part}",
    ),
    "vrm": (
        ["Hips", "Spine", "Chest", "Neck", "Head"],
        ["Shoulder", "UpperArm", "LowerArm", "Hand", "Index1", "UpperLeg", "LowerLeg", "Foot", "ToeBase"],
        "J_Bip_{S}_{part}", "J_Bip_C_{part}",
    ),
    "biped": (
        ["Pelvis", "Spine", "Spine1", "Neck", "Head"],
        ["Clavicle", "UpperArm", "Forearm", "Hand", "Finger0", "Thigh", "Calf", "Foot", "Toe0"],
        "Bip01 {S} {part}", "Bip01 {part}",
    ),
}  # fmt: skip


def skeleton(middle, limbs, sided, plain):
    """Names and parents: hips, trunk, then both arms from the chest and both legs from the hips."""
    names = [plain.format(part=part) for part in middle]
    parents = [-1, *range(len(middle) - 1)]
    for side in ("Left", "Right"):
        for k, part in enumerate(limbs):
            names.append(sided.format(part=part, side=side, S=side[0], s=side[0].lower()))
            parents.append(2 if k == 0 else 0 if k == 5 else len(names) - 2)
    return names, parents


@pytest.mark.parametrize("scheme", SCHEMES)
def test_all_roles_of_a_scheme(scheme):
    names, parents = skeleton(*SCHEMES[scheme])
    roles = joint_roles(names, parents)
    assert set(roles) == {*MIDDLE, *SIDES}
    limbs = SCHEMES[scheme][1]
    for side, start in (("left", len(SCHEMES[scheme][0])), ("right", len(SCHEMES[scheme][0]) + len(limbs))):
        found = [roles[f"{side}_{part}"] - start for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")]
        assert found == [1, 2, 3, 5, 6, 7]


def test_smpl_and_the_mannequin():
    smpl = joint_roles(SMPL_JOINTS, parents_of_smpl().tolist())
    assert {role: SMPL_JOINTS[row] for role, row in smpl.items()} == {
        **{name: name for name in (*SIDES, "pelvis", "neck", "head")}, "spine": "spine1", "chest": "spine3",
    }  # fmt: skip
    assert joint_roles(JOINTS, PARENTS.tolist()) == {name: row for row, name in enumerate(JOINTS)}


def test_a_skeleton_of_no_body_has_no_roles():
    assert joint_roles(["a", "crate", "wheel_3"], [-1, 0, 0]) == {}
