"""Presets: three resolutions, each with dt, cells and d_hat refined by two against the one before.

Refined together they lie near the front of error against time on the scenes of `tests.known_answers.error_scenes`; one
alone leaves the error of the others. The error of a run with a preset is estimated in that run, not tabulated.
"""

from dataclasses import dataclass, replace
from fractions import Fraction

from clothsim import Scene, engine
from clothsim.base.errors import InputError
from clothsim.base.inputs import did_you_mean
from clothsim.engine import with_cells
from clothsim.study.parameters import d_hats

BDF2 = "bdf2"


@dataclass(frozen=True)
class Preset:
    """Settings of a preset.

    Parameters
    ----------
    cells, d_hat : Fraction
        Factors of the scene's own cells, and of a d_hat that it gives.
    dt : float
        Time step [s].
    """

    cells: Fraction
    d_hat: Fraction
    dt: float


PRESETS = {
    "draft": Preset(Fraction(1, 2), Fraction(1), 0.02),
    "standard": Preset(Fraction(1), Fraction(1, 2), 0.01),
    "fine": Preset(Fraction(2), Fraction(1, 4), 0.005),
}
BENDING = "midedge"
"""Bending model of every preset, the one that converges."""


def with_preset(scene: Scene, name: str, models: bool = True) -> tuple[Scene, str]:
    """A scene with the settings of a preset.

    Parameters
    ----------
    scene : Scene
        Scene to change; it stays as it is.
    name : str
        A name of PRESETS.
    models : bool
        False: the scene's own bending model stays.

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
    'cells x 1/2, dt 0.02 s, bdf2'
    """
    if name not in PRESETS:
        raise InputError(
            f"There is no preset {name!r}.", did_you_mean(name, PRESETS) or f"Known: {', '.join(PRESETS)}."
        )
    preset = PRESETS[name]
    settings = [f"dt {preset.dt:g} s", BDF2]
    try:
        scene = with_cells(scene, preset.cells, nearest=True)
        settings.insert(0, f"cells x {preset.cells}" if preset.cells != 1 else "the scene's own cells")
    except InputError as error:
        settings.insert(0, f"the mesh as it is ({error.sentence.rstrip('.')})")
    replaced = ("error", "tolerance", "newton_error_fraction")
    solver = {key: value for key, value in scene.solver.items() if key not in replaced}
    scene = replace(scene, solver={**solver, "dt": preset.dt, "integrator": BDF2})
    for contact, d_hat in d_hats(scene).items():
        scene = engine.replace(scene, f"effects.{contact}.d_hat", d_hat * float(preset.d_hat))
        settings.append(f"{contact} d_hat x {preset.d_hat}")
    if models and "bending" in scene.effects:
        scene = engine.replace(scene, "effects.bending.model", BENDING)
        settings.append(f"bending {BENDING}")
    return scene, ", ".join(settings)
