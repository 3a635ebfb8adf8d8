"""Cloth between bodies: rollers, a trash compactor, a trampoline, sheets trapped and woven, a bag squeezed out.

After scenes of IPC (Li et al. 2020: rollers, trash compactor, squeeze-out) and of ppf-contact-solver (Ando 2024:
trampoline, trapped, woven).
"""

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np

from clothsim.files.meshes.readers.obj import obj_text
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.generators.shapes import rectangle, slab
from clothsim.run.results import Run
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case
from tests.hard_cases.twist import ELASTIC
from tests.hard_cases.where import frames, heights

D_HAT = 2e-3
TOUCHING: dict[str, dict[str, Any]] = {"body_contact": {"d_hat": D_HAT}, "self_contact": {"d_hat": D_HAT}}

ROLLER, NIP = 0.03, 3e-3
"""Radius of both rollers, and the gap between them [m]."""
TURN = 180.0
"""Of the rollers [degrees/s]: their surface goes at .094 m/s."""


def rollers(small: bool) -> Scene:
    """Two rollers turn against each other and draw in a sheet that lies across the nip with its edge in it."""
    roller = {"mesh": "tube", "radius": ROLLER, "height": 0.3, "cells": [32 if small else 64, 1]}
    pair = [
        roller
        | {"name": name, "position": [0, 0, side * (ROLLER + NIP / 2)], "rotation_degrees": [90, 0, 0]}
        | {"motion": {"rotate_degrees_per_second": [0, -side * TURN, 0]}}
        for name, side in (("upper roller", 1), ("lower roller", -1))
    ]
    length, cells = 0.12, [16, 12] if small else [40, 32]
    return Scene(
        cloth={"mesh": "rectangle", "size": [length, 0.1], "cells": cells, "position": [-length / 2 + 0.006, 0, 0]},
        body=pair,
        effects=ELASTIC | TOUCHING | {"friction": {"coefficient": 0.5}},
        solver={"dt": 0.01},
        run={"duration": 1.0 if small else 1.8, "frames_per_second": 50},
    )


def drawn(run: Run) -> str:
    """No vertex is inside a roller, and the sheet goes through at the speed of the rollers where it is.

    Friction holds cloth to the turning frame of a body: half a nip off the surface that is 5 % faster than the surface.
    """
    for time, x in zip(run.times, frames(run), strict=True):
        distance = np.hypot(x[:, 0], np.abs(x[:, 2]) - ROLLER - NIP / 2)
        if distance.min() < ROLLER * np.cos(np.pi / 32):
            return f"at {time:.3g} s a vertex is inside a roller"
    went = float((run.positions(-1)[:, 0] - run.positions(0)[:, 0]).mean())
    turned = np.radians(TURN) * run.times[-1]
    least, most = 0.9 * ROLLER * turned, (ROLLER + NIP / 2) * turned
    return "" if least < went < most else f"the sheet went {went:.3g} m, the rollers {least:.3g} ... {most:.3g} m"


def pressed(small: bool) -> Scene:
    """Four walls close on crumpling sheets, on a floor and under a lid, to 0.6 of the length and the width.

    There five sheets, each with a layer of d_hat, take 38 % of the room; at a third of both, 124 %.
    """
    n, count = (6, 2) if small else (16, 5)
    size, gap, speed, height, left = 0.2, 0.01, 0.2, 0.06, 0.6
    inside = size + 2 * gap
    sheets = [
        {"name": f"sheet {k}", "mesh": "rectangle", "size": [size, size], "cells": [n, n]}
        | {"position": [0, 0, height * (k + 1) / (count + 1)], "rotation_degrees": [2, 1, 0]}
        for k in range(count)
    ]
    bodies: list[dict[str, Any]] = [
        {"name": name, "mesh": "rectangle", "size": [1.5 * inside] * 2, "cells": [1, 1], "position": [0, 0, z]}
        for name, z in (("floor", 0.0), ("lid", height))
    ]
    for name, axis, side in (("left", 0, -1), ("right", 0, 1), ("near", 1, -1), ("far", 1, 1)):
        place, velocity = [0.0, 0.0, height / 2], [0.0, 0.0, 0.0]
        place[axis], velocity[axis] = side * inside / 2, -side * speed
        turn = [0, 90, 0] if axis == 0 else [90, 0, 0]
        wall = {"name": name, "mesh": "rectangle", "size": [1.5 * inside] * 2, "cells": [1, 1], "position": place}
        bodies.append(wall | {"rotation_degrees": turn, "motion": {"velocity": velocity}})
    return Scene(
        cloth=sheets,
        body=bodies,
        effects=ELASTIC | TOUCHING | {"gravity": {}, "friction": {}},
        solver={"dt": 0.01},
        run={"duration": (1 - left) * inside / 2 / speed, "frames_per_second": 50},
    )


def inside_walls(run: Run) -> str:
    """In every frame all cloth is between the walls, above the floor and below the lid."""
    for frame, (time, x) in enumerate(zip(run.times, frames(run), strict=True)):
        places = {name: points.mean(axis=0) for name, points, _ in run.bodies(frame)}
        low = np.array([places["left"][0], places["near"][1], places["floor"][2]])
        high = np.array([places["right"][0], places["far"][1], places["lid"][2]])
        if not ((x > low) & (x < high)).all():
            return f"at {time:.3g} s cloth is out of the press"
    return ""


def trampoline(small: bool) -> Scene:
    """A ball falls on a sheet on springs, and bounces."""
    n = 14 if small else 36
    side = np.arange(n + 1)
    rim = [int(i * (n + 1) + j) for i in side for j in side if i in (0, n) or j in (0, n)]
    return Scene(
        cloth={"mesh": "rectangle", "size": [1, 1], "cells": [n, n], "fabric": "denim", "youngs_modulus": 1e7},
        rigid={"name": "ball", "mesh": "sphere", "radius": 0.1, "subdivisions": 2, "density": 500}
        | {"position": [0.01, 0.02, 0.4]},
        effects=ELASTIC
        | {"gravity": {}, "body_contact": {}}
        | {"springs": {"spring": [{"select": rim, "stiffness": 60.0 * 56 / len(rim), "rest_length": 0.0}]}},
        solver={"dt": 0.005 if small else 0.0025},
        run={"duration": 1.2, "frames_per_second": 50},
    )


def bounces(run: Run) -> str:
    """The ball turns round in the air, never gets as high as it fell from, and is above the sheet throughout."""
    balls = [run.bodies(frame)[0][1] for frame in range(len(run.times))]
    z = np.array([ball[:, 2].mean() for ball in balls])
    for time, x, ball in zip(run.times, frames(run), balls, strict=True):
        under = ball[ball[:, 2].argmin()]
        sheet = heights(under[None], x, run.triangles)
        if not (np.nanmin(sheet) < under[2] if np.isfinite(sheet).any() else False):
            return f"at {time:.3g} s the ball is not over the sheet"
    turns = np.flatnonzero((z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])) + 1
    if not len(turns):
        return "it does not bounce"
    return "" if z[turns].max() < z[0] else f"it rises to {z[turns].max():.3g} m, from {z[0]:.3g} m"


JAW, PRESSED = 0.04, 0.75 * D_HAT
"""Side of the jaws that trap a sheet, and the gap to which they close [m]."""
OPEN, NEAR, SLIP = 0.01, 0.015, 0.01
"""Further gap of each jaw at the start, and radius of what they hold [m]; fraction of it by which that may slip."""
GRIP = 1e5
"""Stiffness of their contact [Pa]; one chosen from the loads holds the sheet by a thousandth of a newton alone."""
CLOSING, TURNING = 0.1, 0.4
"""Times [s]: until the jaws have closed; that they then turn."""


def trap(small: bool) -> Mapping[str, str]:
    """Frames, 100 a second, of two jaws that close and then turn by 90 degrees together."""
    points, triangles = slab((JAW, JAW, JAW))
    made = {}
    for side, name in ((-1, "lower"), (1, "upper")):
        for k in range(round(100 * (CLOSING + TURNING)) + 1):
            open_by = OPEN * max(0.0, 1 - k / (100 * CLOSING))
            turned = max(0.0, k / 100 - CLOSING) / TURNING
            angle = np.pi / 2 * turned**2 * (3 - 2 * turned)
            turn = rotation_matrix(np.array([0, 0, angle]))
            place = np.array([0, 0, side * (JAW / 2 + PRESSED / 2 + open_by)])
            made[f"{name}{k:03d}.obj"] = obj_text(points @ turn.T + place, triangles)
    return made


def trapped(small: bool) -> Scene:
    """A free sheet is trapped between two jaws, which then turn together and take it along."""
    size, n = (0.12, 12) if small else (0.3, 40)
    return Scene(
        cloth={"mesh": "rectangle", "size": [size, size], "cells": [n, n]},
        body=[{"name": name, "frames": f"{name}*.obj", "frames_per_second": 100} for name in ("lower", "upper")],
        effects=ELASTIC
        | {"gravity": {}, "friction": {"coefficient": 0.5}, "self_contact": {"d_hat": D_HAT}}
        | {"body_contact": {"d_hat": D_HAT, "stiffness": GRIP}},
        solver={"dt": 0.02 if small else 0.01},
        run={"duration": CLOSING + TURNING, "frames_per_second": 50},
    )


def turns_along(run: Run) -> str:
    """The sheet is between the jaws on their axis, and what they hold once they have closed turns by 90 degrees."""
    for time, x in zip(run.times, frames(run), strict=True):
        z = np.abs(heights(np.zeros((1, 3)), x, run.triangles))
        z = z[z < JAW]  # what hangs down may swing under the lower jaw
        if not (len(z) and z.max() < OPEN + PRESSED / 2):
            return f"at {time:.3g} s the sheet is not between the jaws"
    closed, last = run.positions(int(np.searchsorted(run.times, CLOSING - 1e-9))), run.positions(-1)
    held = np.hypot(closed[:, 0], closed[:, 1]) < NEAR
    slip = float(
        np.linalg.norm(last[held] - closed[held] @ rotation_matrix(np.array([0, 0, np.pi / 2])).T, axis=1).max()
    )
    return "" if slip < SLIP * NEAR else f"{held.sum()} vertices between the jaws slip by {slip:.2g} m"


STRIPS, PITCH, STRIP = 4, 0.05, 0.03
"""Strips each way, their distance and their width [m]."""


def weave(small: bool) -> Mapping[str, str]:
    """Strips that go over and under each other in turn, at rest so: the plain weave."""
    length, per, across = (
        PITCH * (STRIPS + 1),
        (6, 2) if small else (12, 6),
        PITCH * (np.arange(STRIPS) - (STRIPS - 1) / 2),
    )
    made = {}
    for way, (k, place) in product((0, 1), enumerate(across)):
        points, triangles = rectangle((length, STRIP), (per[0] * (STRIPS + 1), per[1]))
        wave = np.sin(np.pi * points[:, 0] / PITCH)
        points[:, 2] = D_HAT * (-1) ** k * wave
        points[:, 1] += place
        made[f"{'weft' if way else 'warp'}{k}.obj"] = obj_text(
            points[:, [1, 0, 2]] * [-1, 1, 1] if way else points, triangles
        )
    return made


def woven(small: bool) -> Scene:
    """Strips woven, their ends held, catch a ball that falls between them."""
    names = sorted(name.removesuffix(".obj") for name in weave(small))
    along, across = (6 * (STRIPS + 1), 2) if small else (12 * (STRIPS + 1), 6)
    size = (along + 1) * (across + 1)
    ends = [
        n * size + end * (across + 1) + j for n in range(len(names)) for end in (0, along) for j in range(across + 1)
    ]
    return Scene(
        cloth=[{"name": name, "mesh": f"{name}.obj", "fabric": "denim", "youngs_modulus": 1e7} for name in names],
        rigid={"name": "ball", "mesh": "sphere", "radius": 0.04, "subdivisions": 2, "density": 500}
        | {"position": [0, 0, 0.05], "velocity": [0, 0, -1]},
        effects=ELASTIC | TOUCHING | {"gravity": {}, "friction": {}, "pins": {"select": ends}},
        solver={"dt": 0.005},
        run={"duration": 0.2 if small else 0.5, "frames_per_second": 100},
    )


def still_woven(run: Run) -> str:
    """Where two strips cross, the one that was above at the start is above in every frame."""
    cloths = [surface for surface in run.trajectory.surfaces if surface.role == "cloth"]
    pairs = [(a, b) for a in cloths for b in cloths if a.name.startswith("warp") and b.name.startswith("weft")]
    sides = np.zeros(len(pairs))
    for time, x in zip(run.times, frames(run), strict=True):
        for k, (a, b) in enumerate(pairs):
            points = x[a.rows]
            apart = points[:, 2:] - heights(points, x, b.triangles)
            apart = apart[np.isfinite(apart)]
            if not len(apart) or not (apart.min() > 0 or apart.max() < 0):
                return f"at {time:.3g} s {a.name} and {b.name} do not cross as they were woven"
            if sides[k] * apart[0] < 0:
                return f"at {time:.3g} s {a.name} has changed its side of {b.name}"
            sides[k] = np.sign(apart[0])
    lowest = min(float(run.bodies(frame)[0][1][:, 2].max()) for frame in range(len(run.times)))
    return "" if lowest > -0.04 else "the ball fell through"


NECK, BAG = 0.04, 0.06
"""Radius of a neck, 40 mm long above z = 0, and that of the bag that is squeezed through it [m]."""


def squeezed(small: bool) -> Scene:
    """A ram pushes a bag of air through a neck of two thirds of its width."""
    around, subdivisions = (32, 2) if small else (64, 3)
    funnel = {
        "name": "funnel",
        "mesh": "tube",
        "radius": NECK,
        "top_radius": 0.09,
        "height": 0.06,
        "cells": [around, 4],
    }
    neck = {"name": "neck", "mesh": "tube", "radius": NECK, "height": 0.04, "cells": [around, 2]}
    ram = {"name": "ram", "mesh": "capsule", "radius": 0.025, "height": 0.4, "segments": 16}
    low, way = 0.10, 0.32
    return Scene(
        cloth={"mesh": "sphere", "radius": BAG, "subdivisions": subdivisions, "position": [0, 0, low + 0.04]}
        | {"density": 0.3, "thickness": 1e-3, "youngs_modulus": 3e5, "bending_stiffness": 1e-4, "poisson_ratio": 0.4},
        body=[
            funnel | {"position": [0, 0, 0.07]},
            neck | {"position": [0, 0, 0.02]},
            ram | {"position": [0, 0, low + 0.04 + BAG + 0.205], "motion": {"velocity": [0, 0, -0.8]}},
        ],
        effects=ELASTIC | TOUCHING | {"gravity": {}, "friction": {"coefficient": 0.2}, "pressure": {"value": 200.0}},
        solver={"dt": 0.01},
        run={"duration": way / 0.8, "frames_per_second": 50},
    )


def squeezed_out(run: Run) -> str:
    """At the height of the neck all of the bag is inside it; at the end all is below it."""
    for time, x in zip(run.times, frames(run), strict=True):
        level = (x[:, 2] > 0) & (x[:, 2] < 0.04)
        if level.any() and np.hypot(x[level, 0], x[level, 1]).max() >= NECK:
            return f"at {time:.3g} s the bag is beside the neck"
    left = float(run.positions(-1)[:, 2].max())
    return f"{left:.2g} m of the bag are left in the neck" if left > 0 else ""


CASES = (
    Case("B26a", "sheet drawn in by rollers", rollers, drawn, slow=True),
    Case("B26b", "sheets in a trash compactor", pressed, inside_walls, slow=True),
    Case("B26c", "ball on a trampoline", trampoline, bounces, slow=True),
    Case("B26d", "sheet trapped between two jaws that turn", trapped, turns_along, files=trap),
    Case("B26e", "woven strips catch a ball", woven, still_woven, files=weave, slow=True),
    Case("B26f", "bag squeezed through a neck", squeezed, squeezed_out, slow=True),
)
