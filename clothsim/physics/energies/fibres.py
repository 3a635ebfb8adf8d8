"""Two families of threads, with stiffness along warp and weft and in shear: the effect `fibres`.

With warp a, weft b and F: the stretches la = |F a|, lb = |F b| (roots of the invariants I4, I6) and I8 = F a . F b.

    psi = Ka/2 (la - 1)^2 + Kb/2 (lb - 1)^2 + Kab (la - 1)(lb - 1) + G/2 I8^2     [J/m2]

In simple shear by g I8 = g, and for small strains G is the shear modulus. Invariants of two families of fibres:
Spencer 1984, "Constitutive theory for strongly anisotropic solids"; with the thread stretch instead of I4 - 1 the
nominal stress of a thread is Ka times its engineering strain.

The energy is added to that of `membrane`, like a tape or a net sewn on. A cloth whose own stiffness differs between
warp and weft has `effects.membrane.material = "orthotropic"`.
"""

import numpy as np

from clothsim.keys.typed_effects import Fibres
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.key_values import over_cloth


def fibres(world: World, keys: Fibres) -> Energy | Off:
    """Threads in addition to the membrane; off where warp, weft and shear are 0."""
    given = {"warp": keys.warp, "weft": keys.weft, "shear": keys.shear}
    stiffness = {key: over_cloth(f"effects.fibres.{key}", value, world, 0.0) for key, value in given.items()}
    angles = np.radians(over_cloth("effects.fibres.angle_degrees", keys.angle_degrees, world))
    stiff = np.flatnonzero(sum(stiffness.values()))
    if not len(stiff):
        return Off('warp, weft and shear are 0 (a fabric\'s own: effects.membrane.material = "orthotropic")')
    from clothsim.physics.energies.woven_membrane import (  # after the last Off: no kernel is imported for a zero
        FibresEnergy,
        LinearThreads,
    )

    a, b, g = (stiffness[key][stiff] for key in given)
    return FibresEnergy.of(world, stiff, angles, LinearThreads(a, b, np.zeros(len(stiff)), g))


EXAMPLE = Example(
    keys={"warp": 2.0, "weft": 1.5, "shear": 0.8, "angle_degrees": 20.0},
    in_scene={"warp": 20.0},
    zero={"warp": 0, "angle_degrees": 30},
)
