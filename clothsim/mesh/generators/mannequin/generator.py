"""The generator "mannequin"."""

from collections.abc import Mapping, Sequence

from clothsim.arrays import Floats, Ints
from clothsim.mesh.generators.mannequin.pose import posed, turns_of
from clothsim.mesh.generators.mannequin.proportions import Figure, warped, warped_joints
from clothsim.mesh.generators.mannequin.template import template


def mannequin(
    height: float = 1.7,
    chest: float = 1.0,
    waist: float = 1.0,
    hips: float = 1.0,
    shoulder_width: float = 1.0,
    limb_girth: float = 1.0,
    pose: str = "a",
    joints_degrees: Mapping[str, Sequence[float]] | None = None,
) -> tuple[Floats, Ints]:
    """A closed human figure of `height` [m]: z is up, it stands on z = 0, looks along -y, its left hand is at +x.

    chest, waist, hips, shoulder_width, limb_girth: factors of the measures that the default has at that height.
    pose: "a" | "t" | "walk" | "reach" | "arms_down"; joints_degrees: rotation vectors [degrees] by joint, instead of
    the pose's own. Every figure in every pose has the same triangles. InputError names a bad key.
    """
    figure = Figure(height, chest, waist, hips, shoulder_width, limb_girth)
    turns = turns_of(pose, joints_degrees)
    made = template()
    positions = posed(warped(made.positions, made.weights, figure), made.weights, warped_joints(figure), turns)
    positions[:, 2] -= positions[:, 2].min()
    return positions, made.triangles.copy()
