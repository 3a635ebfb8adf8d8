"""Generator "mannequin": the template warped to a figure and posed."""

from collections.abc import Mapping, Sequence

from clothsim.base.arrays import Floats, Ints
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
    """Closed human figure: z is up, it stands on z = 0 and faces -y, its left hand is at +x.

    Every figure in every pose has the same triangles.

    Parameters
    ----------
    height : float
        [m].
    chest, waist, hips, shoulder_width, limb_girth : float
        Factors of the default measures at that height.
    pose : str
        "a" | "t" | "walk" | "reach" | "arms_down".
    joints_degrees : mapping, optional
        Rotation vectors by joint, in place of those of the pose [degrees].

    Returns
    -------
    positions : (n, 3) float64
        [m].
    triangles : (m, 3) int64
        Facing outward.

    Raises
    ------
    InputError
        Naming a bad key.
    """
    figure = Figure(height, chest, waist, hips, shoulder_width, limb_girth)
    turns = turns_of(pose, joints_degrees)
    made = template()
    positions = posed(warped(made.positions, made.weights, figure), made.weights, warped_joints(figure), turns)
    positions[:, 2] -= positions[:, 2].min()
    return positions, made.triangles.copy()
