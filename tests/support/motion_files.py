"""BVH and AMASS files of a known motion, made by hand."""

import numpy as np

from clothsim.mesh.body import rotation_matrix

JOINTS = {
    "Hips": ("", (0, 38, 0)),
    "Spine": ("Hips", (0, 5, 0)),
    "Spine1": ("Spine", (0, 9, 0)),
    "Neck": ("Spine1", (0, 8, 0)),
    "Head": ("Neck", (0, 4, 1)),
    "LeftShoulder": ("Spine1", (2, 6, 0)),
    "LeftArm": ("LeftShoulder", (5, 0, 0)),
    "LeftForeArm": ("LeftArm", (11, 0, 0)),
    "LeftHand": ("LeftForeArm", (10, 0, 0)),
    "RightShoulder": ("Spine1", (-2, 6, 0)),
    "RightArm": ("RightShoulder", (-5, 0, 0)),
    "RightForeArm": ("RightArm", (-11, 0, 0)),
    "RightHand": ("RightForeArm", (-10, 0, 0)),
    "LeftUpLeg": ("Hips", (4, -2, 0)),
    "LeftLeg": ("LeftUpLeg", (0, -17, 0)),
    "LeftFoot": ("LeftLeg", (0, -16, 0)),
    "RightUpLeg": ("Hips", (-4, -2, 0)),
    "RightLeg": ("RightUpLeg", (0, -17, 0)),
    "RightFoot": ("RightLeg", (0, -16, 0)),
}
"""A T-pose in inches, y up: parent and offset of each joint."""
MOVED = ("Hips", "Spine1", "LeftArm", "LeftForeArm", "RightArm", "LeftUpLeg", "LeftLeg", "RightUpLeg", "Head")


def random_angles(seed, frames):
    """Euler angles [degrees] by joint, (frames, 3); 0 in the first frame."""
    rng = np.random.default_rng(seed)
    ramp = np.linspace(0, 1, frames)[:, None]
    return {name: ramp * rng.uniform(-60, 60, 3) * (name in MOVED) for name in JOINTS}


def euler_matrix(angles_degrees, order):
    """Rotation of Euler angles in the order of the channels."""
    turn = np.eye(3)
    for angle, axis in zip(angles_degrees, order, strict=True):
        turn = turn @ rotation_matrix(np.radians(angle) * np.eye(3)["XYZ".index(axis)])
    return turn


def world_turns(angles, order, frame):
    """Rotation in space of each joint from the T-pose in a frame, by name."""
    turns = {}
    for name, (parent, _) in JOINTS.items():
        own = euler_matrix(angles[name][frame], order)
        turns[name] = turns[parent] @ own if parent else own
    return turns


def bvh_text(angles, order, root, seconds=0.04):
    """A BVH file; order: "ZXY"; root (frames, 3): translation of the hips."""
    lines = ["HIERARCHY"]

    def write(name, depth):
        parent, offset = JOINTS[name]
        pad = "  " * depth
        lines.extend([f"{pad}{'JOINT' if parent else 'ROOT'} {name}", pad + "{"])
        lines.append(f"{pad}  OFFSET {offset[0]} {offset[1]} {offset[2]}")
        turning = " ".join(f"{axis}rotation" for axis in order)
        moving = "" if parent else "Xposition Yposition Zposition "
        lines.append(f"{pad}  CHANNELS {3 if parent else 6} {moving}{turning}")
        below = [other for other, (owner, _) in JOINTS.items() if owner == name]
        for other in below:
            write(other, depth + 1)
        if not below:
            lines.extend([f"{pad}  End Site", pad + "  {", f"{pad}    OFFSET 0 1 0", pad + "  }"])
        lines.append(pad + "}")

    write("Hips", 0)
    written = [line.split()[1] for line in lines if line.split()[0] in ("ROOT", "JOINT")]
    lines += ["MOTION", f"Frames: {len(root)}", f"Frame Time: {seconds}"]
    for frame, place in enumerate(root):
        row = [*place, *(value for name in written for value in angles[name][frame])]
        lines.append(" ".join(f"{value:.9f}" for value in row))
    return "\n".join(lines)
