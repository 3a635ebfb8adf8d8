"""Presets: named settings of mesh, time step, tolerance and bending model; `preset_errors` has their errors."""

from dataclasses import dataclass, replace
from fractions import Fraction

from clothsim.build.refinement import with_cells
from clothsim.errors import InputError
from clothsim.scene.keys import nearest
from clothsim.scene.scene import Scene


@dataclass(frozen=True)
class Preset:
    """Settings of a preset.

    Parameters
    ----------
    cells : Fraction
        Factor of the scene's own cells.
    dt : float
        Time step [s].
    tolerance : float
        Convergence tolerance [m/s].
    max_iterations : int
        Newton iterations of a step.
    bending : str
        Bending model.
    """

    cells: Fraction
    dt: float
    tolerance: float
    max_iterations: int
    bending: str


PRESETS = {
    "draft": Preset(Fraction(1, 2), 0.04, 1e-2, 100, "quadratic"),
    "standard": Preset(Fraction(1), 0.01, 1e-3, 100, "midedge"),
    "fine": Preset(Fraction(2), 0.0025, 1e-4, 200, "midedge"),
}

OF_HINGES = ("rest_angle", "plastic_bending")
"""Effects that need the bending model "hinge"."""


def with_preset(scene: Scene, name: str, models: bool = True) -> tuple[Scene, str]:
    """A scene with the settings of a preset.

    Parameters
    ----------
    scene : Scene
        Scene to change; it stays as it is.
    name : str
        A name of PRESETS.
    models : bool
        False: the scene's own bending model stays, as it does beside an effect of OF_HINGES.

    Returns
    -------
    scene : Scene
        A cloth of a file keeps its mesh; a scene without bending gets none.
    settings : str
        The settings in words.

    Raises
    ------
    InputError
        For an unknown name.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.Scene(cloth={"mesh": "rectangle", "cells": [8, 8]})
    >>> with_preset(scene, "draft")[1]
    'cells x 1/2, dt 0.04 s, tolerance 0.01 m/s'
    """
    if name not in PRESETS:
        raise InputError(f"There is no preset {name!r}.", nearest(name, PRESETS) or f"Known: {', '.join(PRESETS)}.")
    preset = PRESETS[name]
    settings = [f"dt {preset.dt:g} s", f"tolerance {preset.tolerance:g} m/s"]
    try:
        scene = with_cells(scene, preset.cells, nearest=True)
        settings.insert(0, f"cells x {preset.cells}" if preset.cells != 1 else "the scene's own cells")
    except InputError as error:
        settings.insert(0, f"the mesh as it is ({error.sentence.rstrip('.')})")
    solver = {key: value for key, value in scene.solver.items() if key != "error"}
    solver.update(dt=preset.dt, tolerance=preset.tolerance, max_iterations=preset.max_iterations)
    effects = dict(scene.effects)
    shifted = next((name for name in OF_HINGES if name in effects), None)
    if models and "bending" in effects and shifted is not None:
        settings.append(f"bending as it is, for {shifted}")
    elif models and "bending" in effects:
        effects["bending"] = {**effects["bending"], "model": preset.bending}
        settings.append(f"bending {preset.bending}")
    return replace(scene, solver=solver, effects=effects), ", ".join(settings)
