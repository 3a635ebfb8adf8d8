"""Named settings: how fine a mesh, how short a step, how tight a solve. What they were worth is in `preset_errors`."""

from dataclasses import dataclass, replace
from fractions import Fraction

from clothsim.build.refinement import with_cells
from clothsim.errors import InputError
from clothsim.scene.keys import nearest
from clothsim.scene.scene import Scene


@dataclass(frozen=True)
class Preset:
    """What a preset sets: cells, times the scene's own; dt [s]; tolerance [m/s]; Newton iterations; bending model."""

    cells: Fraction
    dt: float
    tolerance: float
    max_iterations: int
    bending: str


PRESETS = {
    "draft": Preset(Fraction(1, 2), 0.04, 1e-2, 100, "quadratic"),
    "standard": Preset(Fraction(1), 0.01, 1e-3, 100, "hinge"),
    "fine": Preset(Fraction(2), 0.0025, 1e-4, 200, "midedge"),
}

OF_HINGES = ("rest_angle", "plastic_bending")
"""Effects that go with no other bending model than "hinge"."""


def with_preset(scene: Scene, name: str, models: bool = True) -> tuple[Scene, str]:
    """`scene` with the settings of a preset, and what it set in words. InputError for a name that there is not.

    A cloth that is a file keeps its mesh, and the words say so; a scene without bending gets none. models: False keeps
    the scene's own bending model, and so does an effect that shifts the rest angles of hinges.
    """
    if name not in PRESETS:
        raise InputError(f"There is no preset {name!r}.", nearest(name, PRESETS) or f"Known: {', '.join(PRESETS)}.")
    preset = PRESETS[name]
    said = [f"dt {preset.dt:g} s", f"tolerance {preset.tolerance:g} m/s"]
    try:
        scene = with_cells(scene, preset.cells, nearest=True)
        said.insert(0, f"cells x {preset.cells}" if preset.cells != 1 else "the scene's own cells")
    except InputError as error:
        said.insert(0, f"the mesh as it is ({error.sentence.rstrip('.')})")
    solver = {key: value for key, value in scene.solver.items() if key != "error"}
    solver.update(dt=preset.dt, tolerance=preset.tolerance, max_iterations=preset.max_iterations)
    effects = dict(scene.effects)
    shifted = next((name for name in OF_HINGES if name in effects), None)
    if models and "bending" in effects and shifted is not None:
        said.append(f"bending as it is, for {shifted}")
    elif models and "bending" in effects:
        effects["bending"] = {**effects["bending"], "model": preset.bending}
        said.append(f"bending {preset.bending}")
    return replace(scene, solver=solver, effects=effects), ", ".join(said)
