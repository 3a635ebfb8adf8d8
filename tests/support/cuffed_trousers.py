"""Trousers in one piece with a cuff below each leg, as placed."""

from sewing_patterns import panel, specification, stitch

from clothsim.garments.dress.sewing_state import SewingState, as_placed
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of

TROUSERS = [[-45, 0], [-10, 0], [0, 30], [10, 0], [45, 0], [45, 50], [-45, 50]]


def trousers_with_cuffs(aside: float, half: float = 20, level: float = 30, size: float = 0.05) -> SewingState:
    """Trousers, and a cuff below each leg, 2 `half` cm wide and `aside` cm farther out; `level` of its edge."""
    panels, stitches = {}, []
    for part, z in (("front", 20), ("back", -20)):
        panels[f"top_{part}"] = panel(TROUSERS, translation=[0, 45, z])
        for side, x in (("left", 20 + aside), ("right", -20 - aside)):
            panels[f"{side}_{part}"] = panel(
                [[-half, 0], [half, 0], [half - 2.5, 10], [2.5 - half, 10]], translation=[x, level, z]
            )
    stitches = [stitch(("top_front", k), ("top_back", k), "right_wrong") for k in (1, 2, 4, 6)]
    for side, edge in (("left", 3), ("right", 0)):
        stitches += [stitch((f"{side}_front", k), (f"{side}_back", k), "right_wrong") for k in (1, 3)]
        stitches += [stitch((f"top_{part}", edge), (f"{side}_{part}", 2)) for part in ("front", "back")]
    return as_placed(mesh_pattern(pattern_of(specification(panels, stitches)), size))
