"""Blocks that are computed side by side are those of the elements one by one, wherever an element stands."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import bending, membrane, strain_limit
from meshes import cloth, grid

from clothsim.base.jit import LANES
from clothsim.mesh.world import make_world
from clothsim.physics.energies.hessians import AT_ONCE

ENERGIES = {
    "hinges": lambda world: bending(world, model="hinge"),
    "membrane": membrane,
    "strain limit": lambda world: strain_limit(world, begins=0.0),
}


def of(energy, rows):
    """The energy of these elements alone."""
    return replace(energy, **{name: getattr(energy, name)[rows] for name in energy.per_element})


@pytest.mark.parametrize("project", [True, False])
@pytest.mark.parametrize("name", ENERGIES)
def test_an_element_has_the_same_blocks_in_whatever_lane_group_and_chunk(name, project):
    world = make_world([cloth(*grid(24, 24))])
    x = 1.05 * world.start() + 1e-4 * np.random.default_rng(0).standard_normal(world.start().shape)
    energy = ENERGIES[name](world)
    count = len(getattr(energy, energy.per_element[0]))
    assert count > AT_ONCE + LANES
    blocks = energy.hessian(x, project).blocks
    assert np.abs(blocks).max(axis=(1, 2)).min() > 0
    for first in (0, 5, AT_ONCE - 7, count - LANES - 1):
        for many in (1, LANES - 1, LANES, LANES + 1):
            rows = np.arange(first, first + many)
            assert np.array_equal(of(energy, rows).hessian(x, project).blocks, blocks[rows])
