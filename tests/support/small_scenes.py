"""Scenes of a few dozen vertices."""

import numpy as np

from clothsim import Scene

EFFECTS = {
    "inertia": {},
    "membrane": {},
    "bending": {"model": "hinge"},
    "gravity": {},
    "damping": {"rate": 2.0},
    "body_contact": {},
}

SHEET = {"mesh": "rectangle", "size": [1.0, 1.0], "cells": [4, 4], "position": [0.0, 0.0, 0.33]}
BALL = {"name": "ball", "mesh": "sphere", "radius": 0.3, "subdivisions": 1}
SOLVER = {"dt": 0.02, "threads": 1, "linear": "superlu"}
RUN = {"duration": 0.16, "frames_per_second": 25}


def small_scene(cloth=SHEET, body=BALL, effects=EFFECTS, solver=SOLVER, run=RUN, **sections):
    """A sheet that falls on a ball for four frames, but for what is given."""
    return Scene(cloth=cloth, body=body, effects=effects, solver=solver, run=run, **sections)


def without(*names):
    """The effects but for some."""
    return {name: keys for name, keys in EFFECTS.items() if name not in names}


def changed(sections):
    """Sections of the small scene with some keys changed: tables are merged, all else is replaced."""
    usual = {"cloth": SHEET, "body": BALL}
    return {name: usual[name] | value if value and name in usual else value for name, value in sections.items()}


def frames(run):
    """Positions of all frames of a completed run, (f, n, 3) [m]."""
    assert run.status == "completed", run.reason
    return np.array([run.positions(k) for k in range(len(run.times))])


def end(simulation, steps=4):
    """The positions of all cloths after some steps."""
    for _ in range(steps):
        simulation.step()
    return np.concatenate([*simulation.state.positions.values()])
