"""Template mesh of the mannequin: a closed triangle surface with skinning weights, in the rest pose.

`template.npz` is shipped with the package. `python -m tests.benchmarks.make_mannequin` makes it from the limbs that the
garments are cut from (`garments.body_limbs`); a test compares the two.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, Ints

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
