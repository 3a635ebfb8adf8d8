"""Losses over the logarithms of numbers of a scene and of the pattern of its cloth, each evaluation a run.

The numbers are those of the scene ("cloth.youngs_modulus") and of the pattern of a cloth ("pattern.front.width").
"""

import hashlib
import json
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.file_writing import make_directory, write_atomically
from clothsim.geometry.intersection.crossings import crossings
from clothsim.gradients.gradient import Gradient
from clothsim.gradients.losses import Loss
from clothsim.gradients.parameters import full_path, value_at, with_value
from clothsim.gradients.pattern_numbers import SECTION
from clothsim.gradients.run import Trace, traced
from clothsim.gradients.scene_of_pattern import ShapedScene, quartered, shaped_scene
from clothsim.mesh.world import world_surfaces
from clothsim.patterns.pattern_mesh import PatternMesh
from clothsim.scene.named_files import by_content
from clothsim.scene.scene import Scene

RANGE, PATTERN_RANGE = 100.0, 2.0
"""Largest factor, and its inverse, by which a number of the scene or of a pattern may differ from that of the scene."""
SPREAD, PATTERN_SPREAD = 2.0, 1.05
"""Factor by which numbers of a further start differ at most from the scene's."""


@dataclass(frozen=True)
class KeptResults:
    """Results of runs in files, by what the runs were given: a search that was stopped goes on from them.

    Parameters
    ----------
    folder : str or Path
        A file (.npz) for each result; "": none is kept.
    """

    folder: str | Path = ""

    def of(
        self, scene: Scene, given: Sequence[ArrayLike], compute: Callable[[], Mapping[str, ArrayLike]]
    ) -> Mapping[str, np.ndarray]:
        """Return what was kept for a scene, the content of its files, and arrays; else what is computed now."""
        if not self.folder:
            return {name: np.asarray(value) for name, value in compute().items()}
        tables = by_content(json.loads(scene.to_text(names_of_functions=True)), scene.directory)
        tables.pop("directory", None)
        known = hashlib.sha256(json.dumps(tables, sort_keys=True).encode())
        for values in given:
            array = np.asarray(values, np.float64)
            known.update(f"{array.shape}".encode() + array.tobytes())
        file = Path(self.folder) / f"{known.hexdigest()[:32]}.npz"
        try:
            with np.load(file) as kept:
                return dict(kept)
        except (OSError, ValueError, EOFError, zipfile.BadZipFile):  # none, or a broken one
            found: dict[str, Any] = {name: np.asarray(value) for name, value in compute().items()}
        content = BytesIO()
        np.savez(content, **found)
        make_directory(Path(self.folder))
        write_atomically(file, content.getvalue())
        return found


@dataclass(frozen=True)
class Evaluation:
    """A run of a minimisation.

    Parameters
    ----------
    values : mapping
        Its numbers by path.
    loss : float
        inf where the run cannot be taken.
    slope : (k,) float64
        Derivative of the loss by the logarithms of the numbers.
    newton_error : float
        What the loss would change by if the run were solved exactly.
    intersecting_pairs : int
        Intersecting triangles in the last state, by the exact test.
    failure : str
        Why it cannot be taken; empty where it was.
    """

    values: Mapping[str, float]
    loss: float
    slope: Floats
    newton_error: float = float("nan")
    intersecting_pairs: int = 0
    failure: str = ""


@dataclass(frozen=True)
class LossOfNumbers:
    """A loss over the logarithms of numbers at paths.

    Parameters
    ----------
    scene : Scene
        The scene, whose numbers are the first start.
    loss : Loss
        Of its run.
    paths : tuple of str
        The numbers.
    origin : (k,) float64
        Logarithms of the scene's numbers.
    stiffness : mapping
        Contact stiffnesses that are held [Pa], by effect.
    first : Evaluation
        The run of the scene itself.
    shaped : ShapedScene, optional
        The pattern whose numbers are among them.
    kept : KeptResults
        Where results of runs are kept.
    """

    scene: Scene
    loss: Loss
    paths: tuple[str, ...]
    origin: Floats
    stiffness: Mapping[str, float]
    first: Evaluation
    shaped: ShapedScene | None = None
    kept: KeptResults = KeptResults()

    @property
    def ranges(self) -> Floats:
        """Largest changes of the logarithms, (k,)."""
        return np.log([PATTERN_RANGE if path.startswith(SECTION) else RANGE for path in self.paths])

    @property
    def spreads(self) -> Floats:
        """Largest changes of the logarithms in further starts, (k,)."""
        return np.log([PATTERN_SPREAD if path.startswith(SECTION) else SPREAD for path in self.paths])

    def values(self, logarithms: Floats) -> dict[str, float]:
        """Return the numbers by path."""
        return dict(zip(self.paths, np.exp(logarithms).tolist(), strict=True))

    def scene_at(self, logarithms: Floats) -> Scene:
        """Return the scene with other numbers."""
        return scene_with(self.scene, self.values(logarithms), self.shaped)

    def evaluated(self, logarithms: Floats) -> Evaluation:
        """Take a run with its gradient; a failed one is an evaluation too.

        So are numbers that another key does not allow: the scene's own were run before, so the search goes on.
        """
        values = self.values(logarithms)

        def run() -> Mapping[str, ArrayLike]:
            trace = traced(scene, self.stiffness)
            each = evaluation(values, trace, trace.gradient(self.loss), self.shaped)
            return {
                "loss": each.loss,
                "slope": each.slope,
                "newton_error": each.newton_error,
                "pairs": each.intersecting_pairs,
            }

        try:
            scene = self.scene_at(logarithms)  # the loss is known by that of the first run
            found = self.kept.of(scene, (*self.held, self.first.loss, self.first.slope), run)
        except ClothsimError as error:
            return Evaluation(values, float("inf"), np.zeros(len(values)), failure=error.sentence)
        numbers = float(found["loss"]), found["slope"], float(found["newton_error"]), int(found["pairs"])
        return Evaluation(values, *numbers)

    @property
    def held(self) -> tuple[float, ...]:
        """The stiffnesses that are held [Pa], in the order of the names of their effects."""
        return tuple(self.stiffness[name] for name in sorted(self.stiffness))


def scene_with(scene: Scene, values: Mapping[str, float], shaped: ShapedScene | None) -> Scene:
    """Return a scene with other numbers, of itself and of the pattern of its cloth."""
    of_pattern = {path: value for path, value in values.items() if path.startswith(SECTION)}
    for path in values.keys() - of_pattern.keys():
        scene = with_value(scene, path, np.array(values[path]))
    return scene if shaped is None else shaped.with_numbers(of_pattern, scene)


def derivatives(
    values: Mapping[str, float], gradient: Gradient, shaped: ShapedScene | None, halvings: int = 0
) -> Floats:
    """Return the derivatives of a loss by numbers of the scene and of its pattern, (k,).

    halvings: how often the run's cloth has four triangles for one of the pattern's mesh.
    """
    of_pattern = {path: value for path, value in values.items() if path.startswith(SECTION)}
    out = list[float]()
    for path in values:
        if shaped is None or path not in of_pattern:
            out.append(float(gradient[path]))
            continue
        field = shaped.numbers.field(of_pattern, path)
        for _ in range(halvings):
            field = quartered(field)
        out.append(gradient.rest_along(field, shaped.name))
    return np.array(out)


def evaluation(
    values: Mapping[str, float], trace: Trace, gradient: Gradient, shaped: ShapedScene | None = None
) -> Evaluation:
    """Return what a run tells of its numbers."""
    slope = derivatives(values, gradient, shaped) * list(values.values())
    return Evaluation(values, gradient.value, slope, gradient.newton_error, count_intersecting_pairs(trace))


def count_intersecting_pairs(trace: Trace) -> int:
    """Return the number of intersecting triangles in the last state, by the exact test."""
    world = trace.session.built.world
    found = crossings(trace.steps[-1].end.positions, world_surfaces(world))
    return sum(len(each.pairs) for each in found)


def problem_of(
    scene: Scene,
    loss: Loss,
    free: Sequence[str],
    pattern: PatternMesh | None = None,
    kept: KeptResults = KeptResults(),
) -> LossOfNumbers:
    """Run a scene once, and return the loss of its numbers; pattern: as of `shaped_scene`.

    Raises
    ------
    InputError
        For a path that names no positive number, or a scene that has no gradient.
    ClothsimError
        Where the run fails.
    """
    paths = tuple(dict.fromkeys(full_path(name) for name in free))
    if not paths:
        raise InputError("There is no number to vary.", "Name some, such as youngs_modulus,bending_stiffness.")
    shaped = shaped_scene(scene, pattern) if any(path.startswith(SECTION) for path in paths) else None
    scene = scene if shaped is None else shaped.scene
    of_pattern = {path: shaped.numbers.value(path) for path in paths if path.startswith(SECTION) and shaped is not None}
    trace = traced(scene)
    values = dict[str, float]()
    for path in paths:
        own = of_pattern.get(path)
        value = value_at(scene, trace.session.built.world, path) if own is None else np.asarray(own)
        if value.shape or not value > 0:
            raise InputError(f"{path} is {value}; positive numbers can be recovered.", "Name another, or a component.")
        values[path] = float(value)
    first = evaluation(values, trace, trace.gradient(loss), shaped)
    return LossOfNumbers(scene, loss, paths, np.log(list(values.values())), trace.stiffness, first, shaped, kept)
