"""Contact configurations for tests against ipctk: two layers, random and degenerate."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from effect_builders import body_contact, self_contact
from meshes import cloth, random_rotation

from clothsim.mesh.body import make_body
from clothsim.mesh.world import World, make_world

D_HAT = 0.06
CELL = 0.2
EVEN = np.arange(5) * CELL
NEEDLES = np.array([0.0, CELL, CELL + 1e-6, 3 * CELL, 3 * CELL + 1e-5, 4 * CELL])
"""Columns with widths of a millionth of their height: needles, and slivers of two long edges."""
LEAN = 0.37
"""Shift of a row of needles against the one before, as a fraction of its distance: else all of them are ties."""


def layer(columns):
    """The grid of these columns (n, 3), in z = 0, and its triangles (m, 3)."""
    rows, lean = EVEN, LEAN * (columns is NEEDLES)
    positions = np.array([(x + lean * y, y, 0.0) for y in rows for x in columns])
    n = len(columns)
    corners = np.array([(j * n + i, j * n + i + 1) for j in range(len(rows) - 1) for i in range(n - 1)])
    a, b = corners.T
    return positions, np.concatenate([np.column_stack([a, b, b + n]), np.column_stack([a, b + n, a + n])])


@dataclass(frozen=True)
class Pose:
    """A world, positions x (N, 3) [m] and its contact effect. tie: closest points lie on borders of regions."""

    builder: Callable
    world: World
    x: np.ndarray
    tie: bool = False

    def contact(self, **keys):
        """The barrier with a fixed stiffness."""
        return self.builder(self.world, d_hat=D_HAT, stiffness=3.0, **keys)


def layer_worlds(columns) -> Iterator[tuple[str, Callable, World, int]]:
    """Two equal layers as cloth and body, two cloths, one cloth; far apart. With the first row of the upper one."""
    flat, triangles = layer(columns)
    n, far = len(flat), flat + np.array([0.0, 0.0, 1.0])
    sheet = cloth(flat, triangles, name="low")
    high = replace(cloth(flat, triangles, name="high"), positions=far)
    yield "body", body_contact, make_world([high], [make_body("low", flat, triangles)]), 0
    yield "two cloths", self_contact, make_world([sheet, high]), n
    both = cloth(np.concatenate([flat, far]), np.concatenate([triangles, triangles + n]))
    yield "itself", self_contact, make_world([both]), n


def rotated(angle, about=0.4):
    """A map that rotates points (n, 3) by `angle` about the vertical line through (about, about)."""
    c, s = np.cos(angle), np.sin(angle)
    return lambda x: (x - about) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]]) + about


def shifted(x, y, z):
    """A map that translates points (n, 3)."""
    return lambda points: points + np.array([x, y, z])


GAP = 0.02
ARRANGEMENTS = {
    # columns, map from the lower to the upper layer, ties: closest points on borders of regions
    "vertices over vertices": (EVEN, shifted(0, 0, GAP), True),
    "vertices over edges": (EVEN, shifted(0.5 * CELL, 0, GAP), True),
    "edges parallel": (EVEN, shifted(0.37 * CELL, 0.21 * CELL, GAP), False),
    "edges collinear": (EVEN, shifted(0.37 * CELL, 0, GAP), True),
    "edges nearly parallel": (EVEN, lambda x: rotated(1e-6)(x) + np.array([0.07, 0.03, GAP]), False),
    "coplanar": (EVEN, shifted(4 * CELL + GAP, 0.37 * CELL, 0), False),
    "coplanar, corner to corner": (EVEN, shifted(4 * CELL + 0.7 * GAP, 4 * CELL + 0.7 * GAP, 0), False),
    "needles": (NEEDLES, shifted(0.31 * CELL, 0.17 * CELL, GAP), False),
    "needles across": (NEEDLES, lambda x: rotated(1.1)(x) + np.array([0.013, 0.007, GAP]), False),
    "needles over needles": (NEEDLES, shifted(3.3e-7 + 0.29 * CELL * LEAN, 0.29 * CELL, GAP), False),
}


def adversarial() -> dict[str, Pose]:
    """Every hard configuration in every world."""
    return {f"{name}, {kind}": pose for name, arrange in ARRANGEMENTS.items() for kind, pose in _poses(*arrange)}


def at_random(seeds=3) -> dict[str, Pose]:
    """Layers rotated and perturbed, in a random orientation."""
    found = {}
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        turn, shift = rotated(rng.uniform(0, 3)), np.append(rng.uniform(-0.1, 0.1, 2), GAP)
        rotation = random_rotation(seed)
        for kind, pose in _poses(EVEN, lambda x, turn=turn, shift=shift: turn(x) + shift, False):
            x = (pose.x + np.array([0, 0, 1]) * rng.uniform(-0.45, 0.45, (len(pose.x), 1)) * GAP) @ rotation.T
            found[f"random {seed}, {kind}"] = replace(pose, x=x)
    return found


def close(gaps=(1e-2, 1e-4, 1e-6, 1e-8)) -> dict[str, Pose]:
    """Layers rotated, so that the configuration is generic, and these fractions of d_hat apart."""
    found = {}
    for gap in gaps:
        for kind, pose in _poses(
            EVEN, lambda x, gap=gap: rotated(0.7)(x) + np.array([0.013, 0.007, gap * D_HAT]), False
        ):
            found[f"{gap:g} d_hat, {kind}"] = pose
    return found


def _poses(columns, arrange, tie) -> Iterator[tuple[str, Pose]]:
    flat, _ = layer(columns)
    for kind, builder, world, first in layer_worlds(columns):
        x = world.start()
        lower = (np.arange(len(x)) - first) % len(x) >= len(flat)
        x[lower], x[~lower] = flat, arrange(flat)
        yield kind, Pose(builder, world, x, tie)
