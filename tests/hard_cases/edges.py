"""Cloth on sharp bodies: knife edges, needles, a point under a face, an edge across an edge."""

from typing import Any

import numpy as np

from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case, all_of, energy_falls
from tests.hard_cases.twist import ELASTIC
from tests.hard_cases.where import over_edges, over_needles

FALLING: dict[str, dict[str, Any]] = ELASTIC | {"gravity": {}, "body_contact": {}, "self_contact": {}}
KNIVES = tuple(0.11 * k for k in range(-4, 5))
SPACING = 0.06
"""Of the needles [m]."""
NEEDLE = 0.1
"""Their height [m]."""


def wall(name: str, place: float, length: float, height: float) -> dict[str, Any]:
    """An upright rectangle without thickness in the plane x = `place` [m]: its upper edge, at z = 0, is a knife's."""
    return {
        "name": name,
        "mesh": "rectangle",
        "size": [height, length],
        "cells": [1, 1],
        "rotation_degrees": [0, 90, 0],
        "position": [place, 0.0, -height / 2],
    }


def knives(small: bool) -> Scene:
    """A square metre of cotton falls on nine upright knife edges."""
    n = 14 if small else 40
    return Scene(
        cloth={"mesh": "rectangle", "cells": (n, n), "position": [0, 0, 0.02]},
        body=[wall(f"knife {k}", place, 1.2, 1.0) for k, place in enumerate(KNIVES)],
        effects=FALLING | {"friction": {}},
        solver={"dt": 0.01},
        run={"duration": 0.2 if small else 1.0, "frames_per_second": 100},
    )


def needle_places(small: bool) -> np.ndarray:
    """The tips (k, 3) [m] of the bed of needles."""
    side = SPACING * (np.arange(5 if small else 7) - (2 if small else 3))
    x, y = np.meshgrid(side, side, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def needle(name: str, tip: np.ndarray, height: float = NEEDLE) -> dict[str, Any]:
    """An upright needle of 6 mm at its foot."""
    place = [float(tip[0]), float(tip[1]), float(tip[2]) - height / 2]
    return {"name": name, "mesh": "cone", "radius": 0.003, "height": height, "segments": 6, "position": place}


def pulled_over_needles(small: bool) -> Scene:
    """A sheet falls on a bed of needles while its one edge is pulled along at 1 m/s."""
    n, size = (10, 0.3) if small else (28, 0.44)
    return Scene(
        cloth={"mesh": "rectangle", "size": [size, size], "cells": (n, n), "position": [0, 0, 0.006]},
        body=[needle(f"needle {k}", tip) for k, tip in enumerate(needle_places(small))],
        effects=FALLING | {"friction": {}, "pins": {"select": "right", "motion": {"velocity": [1.0, 0, 0]}}},
        solver={"dt": 0.01},
        run={"duration": 0.2 if small else 0.6, "frames_per_second": 100},
    )


def face_onto_point(small: bool) -> Scene:
    """A sheet of four triangles hits a needle at 5 m/s with the middle of one of them."""
    cells = (1, 1) if small else (4, 4)
    return Scene(
        cloth={
            "mesh": "rectangle",
            "size": [0.3, 0.3],
            "cells": cells,
            "diagonals": "crisscross",
            "position": [0.0, 0.3 / cells[0] / 3, 0.03],
            "velocity": [0, 0, -5.0],
        },
        body=needle("needle", np.zeros(3), 0.8),
        effects=FALLING,
        solver={"dt": 0.01},
        run={"duration": 0.15, "frames_per_second": 100},
    )


def edge_onto_edge(small: bool) -> Scene:
    """An upright card hits a knife's edge at 5 m/s with the middle of its lower edge, square across."""
    return Scene(
        cloth={
            "mesh": "rectangle",
            "size": [0.3, 0.2],
            "cells": (3, 2) if small else (15, 10),
            "rotation_degrees": [90, 0, 0],
            "position": [0, 0, 0.13],
            "velocity": [0, 0, -5.0],
        },
        body=wall("knife", 0.0, 1.0, 1.0),
        effects=FALLING,
        solver={"dt": 0.01},
        run={"duration": 0.2, "frames_per_second": 100},
    )


CASES = (
    Case("B2", "cloth on nine knife edges", knives, all_of(over_edges(KNIVES, 0.0, -1.0), energy_falls)),
    Case("B3a", "cloth pulled over needles at 1 m/s", pulled_over_needles, over_needles),
    Case("B3b", "face hits a needle at 5 m/s", face_onto_point, all_of(over_needles, energy_falls)),
    Case("B3c", "edge hits a knife edge at 5 m/s", edge_onto_edge, all_of(over_edges((0.0,), 0.0, -1.0), energy_falls)),
)
