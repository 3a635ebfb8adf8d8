"""Flat sheets pressed beyond their Euler load: a saddle, from which every step must descend."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from clothsim.files.meshes.readers.obj import obj_text
from clothsim.mesh.generators.shapes import rectangle
from clothsim.run.results import Run
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case, Check, all_of, energy_falls

LENGTH, WIDTH = 0.5, 0.1
MEMBRANE, BENDING = 240.0, 5e-3
"""E2 [N/m] and D [N m]; nu = 0, so that the width plays no part."""
CRITICAL = np.pi**2 * BENDING / LENGTH**2
"""Euler's load of a strip on hinges [N/m]."""
CLOSE = 0.02
SOFT = 1.24
"""How much softer hinges bend a free strip on an alternating grid than its D (docs/results/validation.md, A3)."""


def squeeze(load: float) -> float:
    """The stretch l that presses with load times the critical one: mu (1/l - l) = N, mu = E2/2."""
    return float(brentq(lambda s: MEMBRANE / 2 * (1 / s - s) - load * CRITICAL, 0.1, 1.0))


def files(small: bool, load: float) -> Mapping[str, str]:
    """The strip at rest and pressed flat."""
    rest, triangles = rectangle((LENGTH, WIDTH), (20, 4) if small else (60, 12))
    return {"strip.obj": obj_text(rest, triangles), "pressed.obj": obj_text(rest * (squeeze(load), 1, 1), triangles)}


def column(dynamic: bool) -> Scene:
    """The strip, its ends held where they were pressed to."""
    moving: dict[str, Any] = {"inertia": {}, "damping": {"rate": 5.0}} if dynamic else {}
    pins = {"group": [{"select": "left"}, {"select": "right"}]}
    return Scene(
        cloth={
            "mesh": "strip.obj",
            "thickness": 1e-3,
            "youngs_modulus": MEMBRANE / 1e-3,
            "poisson_ratio": 0.0,
            "bending_stiffness": BENDING,
        },
        effects=moving | {"membrane": {}, "bending": {}, "pins": pins},
        solver={"dt": 0.02, "tolerance": 1e-4},
        run={"duration": 4.0 if dynamic else 0.1, "frames_per_second": 1.0 if dynamic else 10.0},
        seed={"from": "file", "file": "pressed.obj"},
    )


def amplitude(load: float, critical: float = CRITICAL) -> float:
    """Deflection of the elastica of the same length and chord [m]; its own thrust shortens it a little.

    Chord/L = 2 E(k)/K(k) - 1, height/L = k/K(k), thrust = N_cr (2 K/pi)^2 (e.g. Timoshenko & Gere 1961, section 2.7).
    """

    def short(modulus: float) -> float:
        K, E = ellipk(modulus**2), ellipe(modulus**2)
        length = 1 - critical * (2 * K / np.pi) ** 2 / MEMBRANE
        return float(length * (2 * E / K - 1) - squeeze(load))

    modulus = brentq(short, 1e-9, 0.9)
    return float(LENGTH * modulus / ellipk(modulus**2))


def stands_out(load: float) -> Check:
    """The strip stands out as the elastica of its D does, or of a D as soft as its hinges, from the flat start too."""

    def check(run: Run) -> str:
        height = float(np.abs(run.positions(-1)[:, 2]).max())
        least, most = (1 - CLOSE) * amplitude(load), (1 + CLOSE) * amplitude(load, CRITICAL / SOFT)
        right = least <= height <= most
        return "" if right else f"it stands out by {height:.4g} m, the elastica by {least:.4g} ... {most:.4g} m"

    return check


def case(name: str, load: float, dynamic: bool = True) -> Case:
    """The case of a strip under so many critical loads."""
    check = all_of(energy_falls, stands_out(load)) if load > 1.5 else energy_falls
    title = f"flat strip under {load:g} times its Euler load" + ("" if dynamic else ", without inertia")
    return Case(name, title, lambda small: column(dynamic), check, files=lambda small: files(small, load))


CASES = (
    case("B22a", 1.01),
    case("B22b", 2.0),
    case("B22c", 10.0),
    case("B22d", 100.0),
    case("B22e", 100.0, dynamic=False),
)
