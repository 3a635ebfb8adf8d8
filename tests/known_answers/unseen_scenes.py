"""Eight small scenes on which no estimate was tuned; two are of a kind that was said to be known and was not.

Asked for 2 mm they were called "known, met", 11 and 7 mm wrong: a strip that buckles nearly evenly to both sides, and a
card that friction holds over an edge. The others amplify errors in other ways. Meshes are generated.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from clothsim import Scene
from tests.known_answers.error_scenes import ELASTIC, PAPER

CONTACT: Mapping[str, Any] = {"body_contact": {"d_hat": 2e-3}, "friction": {"coefficient": 0.3}}
CLAMPED_LEFT: Mapping[str, Any] = {"select": "left", "clamp": True}


def _scene(
    size: Sequence[float], cells: Sequence[int], effects: Mapping[str, Any], duration: float, **others: Any
) -> Scene:
    """A rectangle of PAPER with elastic effects and inertia beside `effects`; of `others`, body is a section."""
    sections = {name: others.pop(name) for name in ("body",) if name in others}
    return Scene(
        cloth={"name": "cloth", "mesh": "rectangle", "size": size, "cells": cells, **PAPER, **others},
        effects={**ELASTIC, **effects},
        solver={"threads": 1},
        run={"duration": duration, "frames_per_second": 25},
        **sections,
    )


def _pushed() -> Scene:
    """A strip whose clamped ends approach by 20 %, tilted by a degree."""
    pins = [
        {**CLAMPED_LEFT, "motion": {"velocity": [0.05, 0, 0]}},
        {"select": "right", "clamp": True, "motion": {"velocity": [-0.05, 0, 0]}},
    ]
    effects = {"gravity": {"acceleration": [0, 0, 0.5]}, "damping": {"rate": 5.0}, "pins": {"group": pins}}
    return _scene([0.2, 0.05], [16, 4], effects, 0.4, rotation_degrees=[0, 1, 0])


def _edge() -> Scene:
    """A card on a box tilted by 20 degrees, slightly more than friction holds, a third of it over the lower edge."""
    box = {"name": "box", "mesh": "slab", "size": [0.2, 0.2, 0.05], "rotation_degrees": [0, 20, 0]}
    start = {"rotation_degrees": [0, 20, 0], "position": [0.0654, 0.0, 0.0044]}
    return _scene([0.2, 0.1], [12, 6], {"gravity": {}, **CONTACT}, 0.4, body=box, **start)


def _wrung() -> Scene:
    """A tube whose upper end turns by 60 degrees while its lower one is held."""
    ends = [
        {"select": {"box": [[-1, -1, -0.101], [1, 1, -0.099]]}},
        {"select": {"box": [[-1, -1, 0.099], [1, 1, 0.101]]}, "motion": {"rotate_degrees_per_second": [0, 0, 150]}},
    ]
    tube = {"name": "cloth", "mesh": "tube", "radius": 0.05, "height": 0.2, "cells": [24, 12], **PAPER}
    effects = {**ELASTIC, "gravity": {}, "damping": {"rate": 5.0}, "pins": {"group": ends}}
    run = {"duration": 0.4, "frames_per_second": 25}
    return Scene(cloth=tube, effects=effects, solver={"threads": 1}, run=run)


def _arch() -> Scene:
    """A strip bent to an arch by its clamped ends and pressed down by ten times its weight."""
    pins = [
        {**CLAMPED_LEFT, "motion": {"velocity": [0.02, 0, 0], "rotate_degrees_per_second": [0, -60, 0]}},
        {"select": "right", "clamp": True, "motion": {"velocity": [-0.02, 0, 0]}},
    ]
    effects = {"gravity": {"acceleration": [0, 0, -5.0]}, "damping": {"rate": 5.0}, "pins": {"group": pins}}
    return _scene([0.2, 0.05], [16, 4], effects, 0.4)


def _corners() -> Scene:
    """A sheet held by two corners that approach: a fold sags between them."""
    pins = [
        {"select": {"box": [[-0.11, -0.11, -0.01], [-0.09, -0.09, 0.01]]}, "motion": {"velocity": [0.1, 0, 0]}},
        {"select": {"box": [[0.09, -0.11, -0.01], [0.11, -0.09, 0.01]]}, "motion": {"velocity": [-0.1, 0, 0]}},
    ]
    effects = {"gravity": {}, "damping": {"rate": 4.0}, "pins": {"group": pins}}
    return _scene([0.2, 0.2], [12, 12], effects, 0.28)


def _tip() -> Scene:
    """A strip that lands askew on the edge of a box and tips over it or not, as friction says."""
    box = {"name": "box", "mesh": "slab", "size": [0.15, 0.2, 0.04], "position": [0, 0, -0.02]}
    start = {"position": [0.07, 0.0, 0.02], "rotation_degrees": [0, -8, 0]}
    return _scene([0.2, 0.05], [16, 4], {"gravity": {}, "damping": {"rate": 4.0}, **CONTACT}, 0.28, body=box, **start)


def _swept() -> Scene:
    """A hanging sheet whose upper edge is carried sideways through air."""
    pins = {"select": "top", "motion": {"velocity": [0.3, 0.4, 0.0]}}
    effects = {"gravity": {}, "air": {}, "damping": {"rate": 2.0}, "pins": pins}
    return _scene([0.3, 0.2], [12, 8], effects, 0.32, rotation_degrees=[80, 0, 0])


def _rail() -> Scene:
    """A strip held by its left edge that falls on a rail below its middle and hangs over it."""
    rail = {"name": "rail", "mesh": "capsule", "radius": 0.02, "height": 0.2, "rotation_degrees": [90, 0, 0]}
    effects = {"gravity": {}, "damping": {"rate": 6.0}, **CONTACT, "pins": CLAMPED_LEFT}
    return _scene([0.2, 0.05], [16, 4], effects, 0.32, body={**rail, "position": [0.02, 0.0, -0.035]})


UNSEEN_SCENES: Mapping[str, Scene] = {
    "pushed": _pushed(),
    "edge": _edge(),
    "wrung": _wrung(),
    "arch": _arch(),
    "corners": _corners(),
    "tip": _tip(),
    "swept": _swept(),
    "rail": _rail(),
}
"""Scenes by name."""
