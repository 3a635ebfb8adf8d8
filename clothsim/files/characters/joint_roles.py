"""Roles of joints by their names: those of Mixamo, CMU, SMPL, Blender, Unreal and the mannequin."""

import re
from collections.abc import Sequence

LIMBS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
"""Joints of an arm and of a leg, each on both sides."""
_WORDS = {
    "pelvis": ("pelvis", "hips", "root", "bip01", "bip001"),
    "neck": ("neck", "neck1", "neck01"),
    "head": ("head",),
    "shoulder": ("arm", "upperarm", "uparm", "shoulder"),
    "elbow": ("forearm", "lowerarm", "lowarm", "elbow"),
    "wrist": ("hand", "wrist"),
    "hip": ("upleg", "upperleg", "thigh", "hip"),
    "knee": ("leg", "lowerleg", "shin", "calf", "knee"),
    "ankle": ("foot", "ankle"),
}
_FILLERS = ("j", "c", "bip")
"""Words of VRM's and Biped's names that say nothing."""
_ROLE_OF = {word: role for role, words in _WORDS.items() for word in words}
_SPINE = re.compile(r"(?:spine|chest|lowerback|upperchest|abdomen|torso)\d*")


def joint_roles(names: Sequence[str], parents: Sequence[int]) -> dict[str, int]:
    """Row of each role that a skeleton has: "pelvis", "spine", "chest", "neck", "head" and "left_elbow" and its likes.

    Parameters
    ----------
    names : sequence of str
        Names of the joints: "mixamorig:LeftForeArm", "forearm.L", "lowerarm_l", "left_elbow" are one role.
    parents : sequence of int
        Parent of each joint, listed before it.

    Examples
    --------
    >>> joint_roles(["mixamorig:Hips", "mixamorig:LeftUpLeg", "mixamorig:LeftLeg"], [-1, 0, 1])
    {'pelvis': 0, 'left_hip': 1, 'left_knee': 2}
    """
    found: dict[str, int] = {}
    spines: list[int] = []
    for row, name in enumerate(names):
        side, word = _split(name)
        role = _ROLE_OF.get(word, "")
        if side and role in LIMBS:
            found.setdefault(f"{side}_{role}", row)
            if role == "shoulder" and word != "shoulder":  # beside an upper arm, "shoulder" is the collar bone
                found[f"{side}_shoulder"] = row
        elif not side and _SPINE.fullmatch(word):
            spines.append(row)
        elif not side and role and role not in LIMBS:
            if role == "pelvis" and role in found and parents[row] != found[role]:
                continue
            if role != "pelvis" or word != "root" or role not in found:
                found[role] = row
    if "pelvis" not in found and spines:  # Blender's basic rig: its first spine bone is the pelvis
        found["pelvis"] = spines.pop(0)
    if spines:
        found["spine"] = spines[0]
        above = _ancestors(found.get("left_shoulder", -1), parents)
        chests = [row for row in spines[1:] if row in above or "left_shoulder" not in found]
        if chests:
            found["chest"] = chests[-1]
    return found


def _ancestors(row: int, parents: Sequence[int]) -> set[int]:
    found = set()
    while row >= 0:
        row = parents[row]
        found.add(row)
    return found


def _split(name: str) -> tuple[str, str]:
    """Side ("left", "right" or "") and bare word of a joint's name."""
    bare = re.split(r"[:|]", name)[-1]
    bare = re.sub(r"^(mixamorig\d*|bip0*1|def|org|character\d*|valvebiped)[_\-. ]+(?=\w)", "", bare, flags=re.I)
    bare = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", bare)
    words = [word for word in re.split(r"[\s_.\-]+", bare) if word]
    side = ""
    kept = []
    for low in map(str.lower, words):
        if low in _FILLERS:
            continue
        if not side and low in ("left", "l", "right", "r"):
            side = "left" if low[0] == "l" else "right"
        else:
            kept.append(low)
    joined = "".join(kept)
    for start in ("left", "right"):
        if not side and joined.startswith(start):
            side, joined = start, joined.removeprefix(start)
    return side, re.sub(r"(?:joint|bone|jnt)$", "", joined) or joined
