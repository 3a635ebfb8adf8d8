"""Template mesh of the mannequin from the implicit surface of its limbs, as shipped in `template.npz`.

`python -m tests.benchmarks.make_mannequin [FILE]` writes the template, to the package where no FILE is given.

The left half is meshed by surface nets, smoothed tangentially, and joined to its mirror image in the vertices on x = 0.
"""

import argparse
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.mesh.generators.implicit_surface import both_halves, half_surface, lattice_union, relaxed, smooth_union
from clothsim.mesh.generators.mannequin.body_limbs import SMOOTHING, body_limbs, skinning_weights
from clothsim.mesh.generators.mannequin.generator import TEMPLATE_FILE, Template

CELL = 0.020
"""Cell width of the lattice [m]; finer at the hands, the toes and the soles."""
SOLE, SOLE_SMOOTHING = 0.004, 0.003
"""Height of the plane that cuts the feet flat, and the length over which the cut is smoothed [m]."""


def make_template() -> Template:
    """Mesh the implicit surface of the mannequin and weight its vertices."""
    x = _lattice_line(-0.5 * CELL, 0.68, (0.46, 0.70), 0.5)
    y = _lattice_line(-0.22, 0.17, (-0.22, -0.115), 0.65)
    low = _lattice_line(-0.02, 0.70, (-0.02, 0.08), 0.75)
    z = np.concatenate([low, _lattice_line(low[-1] + CELL, 1.76, (0.82, 0.92), 0.8)])
    half = half_surface(body_lattice((x, y, z)), (x, y, z))
    positions, triangles = both_halves(*relaxed(*half, body_field))
    return Template(positions, triangles, skinning_weights(positions))


def body_field(points: Floats) -> tuple[Floats, Floats]:
    """Level-set function of the mannequin (n,) [m] and its gradient (n, 3): limbs, cut flat at the sole."""
    value, gradient = smooth_union([part.limb for part in body_limbs()], points, SMOOTHING)
    below = SOLE - points[:, 2]
    fraction = 1 / (1 + np.exp(np.clip((below - value) / SOLE_SMOOTHING, -500, 500)))
    return _cut_flat(value, below), fraction[:, None] * gradient - (1 - fraction)[:, None] * (0.0, 0.0, 1.0)


def body_lattice(nodes: tuple[Floats, Floats, Floats]) -> Floats:
    """Level-set function at the nodes of a lattice, exact near the surface."""
    value = lattice_union([part.limb for part in body_limbs()], nodes, SMOOTHING, 0.06)
    return _cut_flat(value, SOLE - nodes[2])


def _cut_flat(value: Floats, below: Floats) -> Floats:
    """Smooth intersection s log(exp(f / s) + exp(g / s)) of f with the half space g = SOLE - z < 0."""
    return np.asarray(SOLE_SMOOTHING * np.logaddexp(value / SOLE_SMOOTHING, below / SOLE_SMOOTHING), np.float64)


def write_template(path: Path) -> None:
    """Write the template to `path` as a compressed NumPy archive."""
    made = make_template()
    np.savez_compressed(path, positions=made.positions, triangles=made.triangles, weights=made.weights)


def _lattice_line(first: float, last: float, fine: tuple[float, float], factor: float) -> Floats:
    """Nodes from `first` to beyond `last`, CELL apart, within `fine` `factor` times that [m]."""
    nodes = [first]
    while nodes[-1] < last:
        nodes.append(nodes[-1] + CELL * (factor if fine[0] <= nodes[-1] < fine[1] else 1.0))
    return np.array(nodes)


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="?", type=Path, default=TEMPLATE_FILE)
    write_template(parser.parse_args().file)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
