"""Six small scenes with one solution each, on which errors and their estimates are compared with a reference.

Each has one effect that a study found hard to estimate: wind, a start inside d_hat, an impact, buckling, a fold over a
ball, torsion. Meshes are generated, so that their cells can be refined.
"""

from clothsim import Scene

ELASTIC = {"inertia": {}, "membrane": {}, "bending": {"model": "midedge"}}
PAPER = {
    "density": 0.12,
    "thickness": 2e-4,
    "youngs_modulus": 2e6,
    "poisson_ratio": 0.3,
    "bending_stiffness": 2e-4,
}
"""Cloth as stiff to bending as thin paper: on 16 cells its folds are resolved."""


def _scene(size, cells, effects, duration, body=(), dt=0.01, fabric=None, **cloth):
    """A rectangle of PAPER, or of `fabric`, with elastic effects and inertia beside `effects`."""
    material = PAPER if fabric is None else fabric
    return Scene(
        cloth={"name": "cloth", "mesh": "rectangle", "size": size, "cells": cells, **material, **cloth},
        body=body,
        effects={**ELASTIC, **effects},
        solver={"dt": dt, "threads": 1},
        run={"duration": duration, "frames_per_second": 25},
    )


def _wind() -> Scene:
    """A sheet of wool that hangs from an edge, blown by a light wind."""
    effects = {"gravity": {}, "air": {"wind": [1.0, 2.5, 0.0]}, "pins": {"select": "top"}}
    wool = {"fabric": "wool", "bending_stiffness": 1e-4}
    return _scene([0.4, 0.4], [8, 8], effects, 0.4, fabric=wool, rotation_degrees=[75, 0, 0])


def _ramp() -> Scene:
    """A card that starts inside d_hat of a ramp and slides down against friction."""
    body = {"name": "ramp", "mesh": "slab", "size": [1.0, 0.4, 0.02], "rotation_degrees": [0, 25, 0]}
    effects = {"gravity": {}, "body_contact": {"d_hat": 2e-3}, "friction": {"coefficient": 0.2}}
    start = {"rotation_degrees": [0, 25, 0], "position": [0.0046, 0.0, 0.0099]}
    return _scene([0.2, 0.1], [12, 6], effects, 0.4, body, **start)


def _landing() -> Scene:
    """A strip that falls on a table, one end first.

    With a damping of 2 per second it bounces: dt / 2 moves the result by 3 to 7 mm at every dt, so none is a reference.
    """
    body = {"name": "table", "mesh": "slab", "size": [0.6, 0.4, 0.02], "position": [0, 0, -0.01]}
    contact = {"body_contact": {"d_hat": 2e-3}, "friction": {"coefficient": 0.3}}
    effects = {"gravity": {}, "damping": {"rate": 20.0}, **contact}
    return _scene([0.3, 0.075], [16, 4], effects, 0.2, body, rotation_degrees=[0, 12, 0], position=[0, 0, 0.06])


def _compressed() -> Scene:
    """A strip whose clamped ends approach by 15 %; they are tilted by two degrees, so that it buckles to one side."""
    pins = [
        {"select": "left", "clamp": True, "motion": {"velocity": [0.0375, 0, 0]}},
        {"select": "right", "clamp": True, "motion": {"velocity": [-0.0375, 0, 0]}},
    ]
    effects = {"gravity": {"acceleration": [0, 0, 0.5]}, "damping": {"rate": 5.0}, "pins": {"group": pins}}
    return _scene([0.2, 0.05], [16, 4], effects, 0.4, rotation_degrees=[0, 2, 0])


def _ball() -> Scene:
    """A sheet that lies down over a ball, off its centre."""
    body = {"name": "ball", "mesh": "sphere", "radius": 0.08, "position": [0.01, 0.02, -0.0825]}
    contact = {"body_contact": {"d_hat": 2e-3}, "friction": {"coefficient": 0.3}}
    effects = {"gravity": {}, "damping": {"rate": 4.0}, **contact}
    return _scene([0.24, 0.24], [12, 12], effects, 0.2, body)


def _twisted() -> Scene:
    """A ribbon that is twisted by 120 degrees; gravity decides where it sags."""
    turn = {"rotate_degrees_per_second": [300, 0, 0]}
    pins = [{"select": "left", "clamp": True}, {"select": "right", "clamp": True, "motion": turn}]
    effects = {"gravity": {}, "damping": {"rate": 5.0}, "pins": {"group": pins}}
    return _scene([0.3, 0.06], [16, 4], effects, 0.4)


ERROR_SCENES = {
    "wind": _wind(),
    "ramp": _ramp(),
    "landing": _landing(),
    "compressed": _compressed(),
    "ball": _ball(),
    "twisted": _twisted(),
}
"""Scenes by name."""
