"""Springs of the drape: pairs of a seam that could not be welded are held, also where one alone is left."""

import numpy as np
import pytest
from effect_builders import bending, seams
from sewing_patterns import panel, specification, stitch

from clothsim.garments.dress.pipeline import open_seam_tables
from clothsim.garments.dress.sewing_state import SewingState, as_placed
from clothsim.keys.fabric_table import fabric_named
from clothsim.mesh.cloth import make_cloth
from clothsim.mesh.world import make_world
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of


def welded_but(open_pairs: list[int]) -> SewingState:
    """Two squares of 50 cm, 1 cm apart, sewn along one side except for these pairs."""
    square = [[0, 0], [50, 0], [50, 50], [0, 50]]
    panels = {"left": panel(square), "right": panel([[x + 51, y] for x, y in square])}
    state = as_placed(mesh_pattern(pattern_of(specification(panels, [stitch(("left", 1), ("right", 3))])), 0.05))
    return state.join(np.delete(state.mesh.seams[0].pairs, open_pairs, axis=0))


def strings_of(state: SewingState):
    world = make_world(
        [
            make_cloth(
                "garment",
                state.positions,
                state.triangles,
                fabric_named("fabric", "cotton"),
                material_coordinates=state.mesh.material_coordinates,
            )
        ]
    )
    return seams(world, seam=open_seam_tables(state), built={"bending": bending(world)})


@pytest.mark.parametrize("open_pairs", [[0], [4], [-1], [2, 3, 7], [0, 10]])
def test_every_open_pair_has_its_string(open_pairs):
    state = welded_but(open_pairs)
    energy = strings_of(state)
    rows, weights = np.asarray(energy.rows), np.asarray(energy.weights)
    ends = [
        sorted(int(vertex) for vertex, share in zip(row, weight, strict=True) if share)
        for row, weight in zip(rows, weights, strict=True)
    ]
    assert sorted(ends) == sorted(sorted(pair) for pair in state.pairs(state.mesh.seams[0]).tolist())
    assert len(ends) == len(open_pairs)


def test_a_welded_garment_has_no_strings():
    assert open_seam_tables(welded_but([])) == []
