"""Generator "mannequin": the template warped to proportions and posed.

`template.npz`, a closed triangle surface with skinning weights in the rest pose, is shipped with the package.
`python -m tests.benchmarks.make_mannequin` makes it from the limbs that the garments are cut from
(`garments.body_limbs`); a test compares the two.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.generators.mannequin.pose import posed, turns_of
from clothsim.mesh.generators.mannequin.proportions import Proportions, warped, warped_joints

TEMPLATE_FILE = Path(__file__).with_name("template.npz")
"""Arrays positions, triangles and weights, the fields of `Template`; NumPy's archive format, without pickle."""


@dataclass(frozen=True)
class Template:
    """Mesh and skinning weights of the mannequin.

    Parameters
    ----------
    positions : (n, 3) float64
        Vertices in the rest pose [m]; mirror-symmetric about x = 0.
    triangles : (m, 3) int64
        Closed surface, facing outward.
    weights : (n, j) float64
        Skinning weight of each joint of `skeleton.JOINTS`; each row sums to 1.
    """

    positions: Floats
    triangles: Ints
    weights: Floats


@lru_cache(maxsize=1)
def template() -> Template:
    """Load the shipped template; the arrays are read-only, since every caller gets the same ones."""
    with np.load(TEMPLATE_FILE, allow_pickle=False) as file:
        arrays = file["positions"], file["triangles"], file["weights"]
    for array in arrays:
        array.setflags(write=False)
    return Template(*arrays)


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
    proportions = Proportions(height, chest, waist, hips, shoulder_width, limb_girth)
    turns = turns_of(pose, joints_degrees)
    made = template()
    positions = posed(
        warped(made.positions, made.weights, proportions), made.weights, warped_joints(proportions), turns
    )
    positions[:, 2] -= positions[:, 2].min()
    return positions, made.triangles.copy()
