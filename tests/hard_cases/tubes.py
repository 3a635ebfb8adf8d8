"""Tubes twisted shut, a ribbon that coils on a floor, a sheet on a turning ball that may stretch by one percent.

After scenes of C-IPC (Li, Kaufman & Jiang 2021: twisted cylinder, strain limit on a turning ball) and of
ppf-contact-solver (Ando 2024: ribbon).
"""

import numpy as np

from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients
from clothsim.geometry.kinematics.stretch import principal_stretches
from clothsim.run.results import Run
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case, all_of, energy_falls, scene_of
from tests.hard_cases.twist import ELASTIC
from tests.hard_cases.where import frames, over_plane

RADIUS, LONG, TURN = 0.08, 0.4, 180.0
"""Radius and length of a tube [m]; how fast each end turns [degrees/s]."""


def twisted(small: bool) -> Scene:
    """A tube of cotton whose ends are held round turns shut: by one turn, in the full form by four."""
    around, rows = (20, 16) if small else (48, 40)
    bottom, top = ([column * (rows + 1) + row for column in range(around)] for row in (0, rows))
    groups = [
        {"select": rim, "motion": {"rotate_degrees_per_second": [0, 0, side * TURN], "centre": [0, 0, 0]}}
        for rim, side in ((bottom, -1), (top, 1))
    ]
    return Scene(
        cloth={"mesh": "tube", "radius": RADIUS, "height": LONG, "cells": [around, rows]},
        effects=ELASTIC | {"self_contact": {}, "friction": {}, "pins": {"group": groups}},
        solver={"dt": 0.02},
        run={"duration": 1.0 if small else 4.0, "frames_per_second": 25},
    )


def shut(run: Run) -> str:
    """The ends are where their script puts them; about the middle the tube has lost its width, none of it outside."""
    angle = np.radians(TURN) * run.times[-1]
    first, last = run.positions(0), run.positions(-1)
    for side in (-1, 1):
        end = np.abs(first[:, 2] - side * LONG / 2) < 1e-9
        turn = np.array([[np.cos(angle), -side * np.sin(angle)], [side * np.sin(angle), np.cos(angle)]])
        off = float(np.abs(last[end] - np.column_stack([first[end, :2] @ turn.T, first[end, 2]])).max())
        if off > 1e-9:
            return f"a pinned vertex is {off:.2g} m off its script"
    waist = float(np.hypot(last[:, 0], last[:, 1])[np.abs(first[:, 2]) < 1e-3].max())
    return f"the waist has a radius of {waist:.2g} m" if waist > RADIUS / 2 else ""


def coiled(small: bool) -> Scene:
    """A ribbon falls on end to a floor, on which it comes to lie in coils."""
    length, cells = (0.4, [60, 2]) if small else (1.5, [220, 3])
    return Scene(
        cloth={"mesh": "rectangle", "size": [length, 0.02], "cells": cells, "fabric": "denim"}
        | {"rotation_degrees": [0, 90, 3], "position": [0, 0, length / 2 + 0.005]},
        body={"name": "floor", "mesh": "rectangle", "size": [1, 1], "cells": [1, 1], "position": [0.1, 0.05, 0]},
        effects=ELASTIC | {"gravity": {}, "body_contact": {}, "self_contact": {}, "friction": {}},
        solver={"dt": 0.01},
        run={"duration": 0.7 if small else 1.2, "frames_per_second": 50},
    )


def lies(run: Run) -> str:
    """At the end all of it lies low, and as it fell no vertex went lower than the floor or up."""
    highest = [float(x[:, 2].max()) for x in frames(run)]
    if max(highest) > highest[0] + 1e-3:
        return f"a vertex rises to {max(highest):.3g} m"
    return f"a vertex is still {highest[-1]:.3g} m up" if highest[-1] > 0.25 * highest[0] else ""


LIMIT = 1.01


def limited(small: bool) -> Scene:
    """A sheet that may stretch by one percent lies on a ball, which begins to turn under it."""
    n = 16 if small else 48
    return Scene(
        cloth={"mesh": "rectangle", "size": [0.6, 0.6], "cells": [n, n], "position": [0, 0, 0.207]},
        body={"name": "ball", "mesh": "sphere", "radius": 0.2, "subdivisions": 3}
        | {"motion": {"rotate_degrees_per_second": [0, 0, 120]}},
        effects=ELASTIC
        | {"gravity": {}, "body_contact": {}, "self_contact": {}, "friction": {"coefficient": 0.4}}
        | {"strain_limit": {"limit": LIMIT}},
        solver={"dt": 0.01},
        run={"duration": 0.3 if small else 1.5, "frames_per_second": 50},
    )


def within_limit(run: Run) -> str:
    """No principal stretch of any frame is above the limit; the sheet is carried round, and stays on the ball."""
    world = build(scene_of(run)).world
    for time, x in zip(run.times, frames(run), strict=True):
        F = deformation_gradients(x, world.triangles, world.rest_shape_inverses)
        most = float(principal_stretches(F).max())
        if most > LIMIT:
            return f"at {time:.3g} s a triangle is stretched to {most:.6g}"
    x = run.positions(-1)
    return "" if np.hypot(*x[x[:, 2].argmax(), :2]) < 0.2 else "the sheet has left the ball"


CASES = (
    Case("B28a", "tube twisted shut", twisted, shut, slow=True),
    Case("B28b", "ribbon falls into coils", coiled, all_of(over_plane(0.0), lies, energy_falls), slow=True),
    Case("B28c", "strain limit 1.01 on a turning ball", limited, within_limit, slow=True),
)
