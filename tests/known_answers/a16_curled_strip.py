"""A16, a strip that is curled at rest hangs from a clamp, as a scene: it twists out of its plane, and hangs flat again.

The test of bending and twisting of Romero et al. 2021 (Physical validation of simulators in computer graphics, ACM
Trans. Graph. 40), with a strip so narrow that it is a rod (`curled_rod`): w << (t/k)^(1/2), k its curl and
t = (12 D/E2)^(1/2); the borders of a wider one would stretch where it twists. A sheet that resists twist as much as a
homogeneous one, C = 2/(1 + nu) EI, stays in its plane: that of these rows is softer on the bias, C = 0.4 EI.
"""

from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np
from scipy.spatial.transform import Rotation

from clothsim import Cloth, Scene
from clothsim.base.arrays import Floats
from clothsim.mesh.generators.shapes import rectangle
from tests.known_answers.curled_rod import ASIDE, Rod, hanging
from tests.known_answers.row import Outcome, Row
from tests.known_answers.scene_runs import AT_ONCE, ELASTIC, PAPER, WEIGHT, G, ended, on_meshes

LENGTH, WIDTH = 0.2, 0.01
"""Length of the strip [m]; its width over it."""
ROD = Rod(curl=6.0, edgewise=10.0, twisting=0.4, width=WIDTH)
"""Nearly a whole turn; k w^2/t = 0.66 w."""
HEAVIEST = 20.0
"""rho_A g L^3/D under the weight of the earth."""
LIGHT, TWISTED, STRAIGHTENED = 5.0, 20.0, 40.0
"""Such weights at which it hangs in its plane, twists out of it, and is drawn straight in it."""
LEAVING = 9.7, 9.8
"""Two beyond the critical one, 9.4629."""
BAR = WIDTH
"""A rod is the limit of a strip of no width: what it leaves out is of the order of width / length."""
LONG, SQUARE = (10, 20, 40), (200, 400, 800)
"""Cells along the strip: two across are enough in its plane; where it twists they are square, up to eight."""
ORDERS = 1.3, 2.5
"""A clamp holds it flat over half of its width, and ends in corners: few cells are there."""


def scene(weight: float, cells: int, across: int) -> Scene:
    """The strip with rho_A g L^3/D = weight, which starts as it is curled, but twisted, its first edges down."""
    width = WIDTH * LENGTH
    flat, triangles = rectangle((LENGTH, width), (cells, across), "alternating")
    size = LENGTH / cells
    turn = Rotation.from_rotvec([size * ROD.curl / LENGTH, 0.0, size * ASIDE / LENGTH])
    links = [Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])]  # d1, d2, d3: y, x, -z
    for _ in range(cells - 1):
        links.append(links[-1] * turn)
    directors = np.array([link.as_matrix() for link in links])
    line = np.concatenate([np.zeros((1, 3)), np.cumsum(size * directors[:, :, 2], axis=0)])
    row = np.rint((flat[:, 0] + LENGTH / 2) / size).astype(int)
    points = line[row] + flat[:, 1:2] * directors[np.maximum(row - 1, 0), :, 0]
    bending = WEIGHT * LENGTH**3 / HEAVIEST
    fabric = {name: PAPER[name] for name in ("density", "thickness", "poisson_ratio")} | {
        "youngs_modulus": 12 * ROD.edgewise * bending / width**2 / PAPER["thickness"],
        "bending_warp": bending,
        "bending_weft": bending,
        "bending_bias": bending / (1 / 2 + 1 / ROD.twisting),  # 1/D_bias = 1/(2 D) + 1/(2 T), C = 2 T
        "rest_curvature_warp": -ROD.curl / LENGTH,
    }
    effects = {
        **ELASTIC,
        "gravity": {"acceleration": [0, 0, -weight / HEAVIEST * G]},
        "pins": {"select": np.flatnonzero(row == 0).tolist(), "clamp": True},
    }
    cloth = Cloth(points, triangles, rest=flat[:, :2], **fabric)
    return Scene(cloth, effects=effects, run=AT_ONCE, solver={"dt": 1.0})


@lru_cache
def hung(weight: float, cells: int) -> Floats:
    """Middle line of the strip at rest, (cells + 1, 3), over its length; cells: of LONG or SQUARE."""
    across = max(2, round(WIDTH * cells))
    return ended(scene(weight, cells, across)).last.reshape(-1, across + 1, 3)[:, across // 2] / LENGTH


def depth(line: Floats) -> float:
    """Depth of the end of a line below its clamp."""
    return float(-line[-1, 2])


def aside(line: Floats) -> float:
    """Distance of its end from the plane in which it is curled."""
    return float(abs(line[-1, 1]))


def leaving(line: Callable[[float], Floats]) -> float:
    """The weight from which the lines of weights are aside.

    The square of the distance grows from there in proportion, and is read at LEAVING: the rod's own is .3 % too low.
    """
    first, second = (aside(line(weight)) ** 2 for weight in LEAVING)
    return LEAVING[0] - first * (LEAVING[1] - LEAVING[0]) / (second - first)


def _end(measure: Callable[[Floats], float], weight: float) -> Outcome:
    twists = weight == TWISTED
    exact = measure(hanging(ROD, weight, twists).line)
    return on_meshes(lambda n: measure(hung(weight, n)), SQUARE if twists else LONG, exact, BAR, ORDERS)


def _leaving() -> Outcome:
    exact = leaving(lambda weight: hanging(ROD, weight, aside=True).line)
    return on_meshes(lambda n: leaving(lambda weight: hung(weight, n)), SQUARE, exact, BAR, ORDERS)


ROWS = (
    Row(
        "A16a",
        "curled strip hanging from a clamp, rho_A g L^3/D = 5, in its plane: depth of its end / L",
        partial(_end, depth, LIGHT),
    ),
    Row("A16b", "the same at 20, twisted out of its plane: depth of its end / L", partial(_end, depth, TWISTED)),
    Row("A16c", "the same at 20: distance of its end from the plane / L", partial(_end, aside, TWISTED)),
    Row("A16d", "the same at 40, in its plane again: depth of its end / L", partial(_end, depth, STRAIGHTENED)),
    Row(
        "A16e",
        "the same: rho_A g L^3/D at which it leaves its plane, extrapolated linearly from squared distances",
        _leaving,
    ),
)
