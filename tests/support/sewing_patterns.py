"""Sewing patterns: small ones made by hand, and the names of the shared files."""

from typing import Any

SQUARE = [[0, 0], [10, 0], [10, 20], [0, 20]]
"""A panel of 10 by 20 cm."""


def panel(vertices: Any = None, **keys: Any) -> dict[str, Any]:
    """Entries of a panel whose edges join its vertices in order."""
    corners = [list(corner) for corner in (SQUARE if vertices is None else vertices)]
    edges = [{"endpoints": [k, (k + 1) % len(corners)]} for k in range(len(corners))]
    return {"translation": [0, 0, 0], "rotation": [0, 0, 0], "vertices": corners, "edges": edges, **keys}


def stitch(first: tuple[str, int], second: tuple[str, int], *kind: str) -> list[Any]:
    """Entries of a stitch."""
    return [*({"panel": name, "edge": edge} for name, edge in (first, second)), *kind]


def specification(panels: dict[str, Any], stitches: Any = (), units: float | None = 100) -> dict[str, Any]:
    """Entries of a specification."""
    properties = {"curvature_coords": "relative"} | ({} if units is None else {"units_in_meter": units})
    return {"pattern": {"panels": panels, "stitches": list(stitches)}, "properties": properties}


def skirt() -> dict[str, Any]:
    """Two panels behind one another, sewn at both sides; the back is mirrored, so that its loop runs clockwise."""
    back = [[-x, y] for x, y in SQUARE]
    panels = {
        "front": panel(translation=[0, 0, 10]),
        "back": panel(back, translation=[10, 0, -10]),
    }
    return specification(panels, [stitch(("front", 1), ("back", 3)), stitch(("front", 3), ("back", 1))])


PATTERN_FILES = (
    "hoody_mean_specification.json",
    "shirt_mean_specification.json",
    "skirt_2_panels.json",
    "skirt_4_panels.json",
    "tee.json",
    *(f"random/r{number:03}.json" for number in range(20)),
)

BODY_OF_MOST = "mean_all"
"""Body that GarmentCode's programs made their patterns for."""
BODIES_OF = dict.fromkeys(("skirt_2_panels", "skirt_4_panels", "tee"), "f_smpl_average_A40")
"""Body of the patterns of Garment-Pattern-Generator."""


def body_of(pattern: str) -> str:
    """Name of the shared body that a pattern file was made for."""
    return BODIES_OF.get(pattern.rsplit("/", 1)[-1].removesuffix(".json"), BODY_OF_MOST)


def capsule_skirt(width: float) -> dict[str, Any]:
    """A skirt of two panels of this width [cm] and 25 cm of length, for a person of capsules."""
    front = [[-width / 2, 0], [width / 2, 0], [width / 2, 25], [-width / 2, 25]]
    panels = {
        "front": panel(front, translation=[0, 82, 20]),
        "back": panel([[-x, y] for x, y in front], translation=[0, 82, -20]),
    }
    return specification(panels, [stitch(("front", 1), ("back", 3)), stitch(("front", 3), ("back", 1))])
