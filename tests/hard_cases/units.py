"""Invariance of a scene under change of units and of origin."""

import tempfile

import numpy as np

from clothsim.keys.fabric_table import FABRICS
from clothsim.run.results import Run
from clothsim.run.simulate import simulate
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case

PLACE = np.array([1e6, -1e6, 1e6])


def draped(cells: int, unit: float = 1.0, place: np.ndarray | None = None) -> Scene:
    """A square of cotton pulled over a turning ball by gravity; lengths in `unit` metres' worth, moved to `place`.

    With lengths times k, seconds and kilograms as they are: areas k^2, so density / k^2, pressures / k, moments k^2.
    """
    k, cotton = unit, FABRICS["cotton"]
    at = np.zeros(3) if place is None else place
    return Scene(
        cloth={
            "mesh": "rectangle",
            "size": [0.6 * k, 0.6 * k],
            "cells": [cells, cells],
            "position": (at + k * np.array([0.013, 0.02, 0.221])).tolist(),
            "density": cotton.density / k**2,
            "thickness": cotton.thickness * k,
            "youngs_modulus": cotton.youngs_modulus / k,
            "bending_stiffness": cotton.bending_stiffness * k**2,
        },
        body={
            "mesh": "sphere",
            "radius": 0.2 * k,
            "subdivisions": 3,
            "position": at.tolist(),
            "motion": {"rotate_degrees_per_second": [0, 0, 30]},
        },
        effects={
            "inertia": {},
            "membrane": {},
            "bending": {},
            "gravity": {"acceleration": [0, 0, -9.81 * k]},
            "damping": {"rate": 2.0},
            "body_contact": {},
            "self_contact": {},
            "friction": {},
        },
        # a tolerance of 1e-8 m/s leaves up to 2e-8 m after ten steps: twice what the runs may differ by
        solver={"dt": 0.02, "threads": 1, "tolerance": 1e-9 * k, "integrator": "bdf2"},
        run={"duration": 0.2},
    )


def same_in(name: str, unit: float) -> Case:
    """The case that compares a run in metres with one in `unit` metres' worth."""

    def check(run: Run) -> str:
        with tempfile.TemporaryDirectory() as folder:
            metres = simulate(draped(8), folder).positions(-1)
        off = float(np.abs(run.positions(-1) / unit - metres).max())
        return f"positions/k differ by {off:.2g} m" if off > 1e-8 else ""

    return Case(name, f"drape with all lengths times {unit:g}", lambda small: draped(8, unit), check, jitters=False)


def same_elsewhere(run: Run) -> str:
    """The shape is that at the origin, to 1e-7 m."""
    with tempfile.TemporaryDirectory() as folder:
        here = simulate(draped(8), folder).positions(-1)
    off = float(np.abs(run.positions(-1) - PLACE - here).max())
    return f"the shape differs by {off:.2g} m" if off > 1e-7 else ""


CASES = (
    same_in("B18a", 1e-3),
    same_in("B18b", 1e3),
    Case("B19", "drape 1e6 m from the origin", lambda small: draped(8, 1.0, PLACE), same_elsewhere, jitters=False),
)
