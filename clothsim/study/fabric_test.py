"""Test of a fabric by a standard method: repeated specimens, means with their spread, what is known of the error."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clothsim import render
from clothsim.base.errors import InputError
from clothsim.base.text import text_table
from clothsim.study.standard_tests import cusick, strips
from clothsim.study.standard_tests.cusick import PLATE

LAYS, REPEATS, SIZE = 16, 3, 6e-3
"""Lays of a drape, specimens of a strip test, distance of the vertices of a drape [m]."""
MESH_ERROR = (
    "Coefficient of a denim of 19.7 and a soft cotton of 5 uN m at 15, 10, 6, 4 mm: 57.1, 58.2, 60.1, 61.2 and 62.8, "
    "48.9, 43.7, 45.9 % (standard errors to 0.9, of the cotton at 15 and 10 mm 4.3 and 1.7); of a cotton of 9.2 uN m "
    "at 6 and 4 mm 58.6 and 62.7: at 6 mm up to 4 points off, at 10 mm 3, at 15 mm 17."
)
"""Means of 6, 6, 4 and 3 lays, 2026-11-24, elements of a scene that names none."""
SPECIMENS: Mapping[str, Sequence[str]] = {
    "cantilever": ("warp", "weft", "bias"),
    "bias": ("bias",),
    "tensile": ("warp", "weft"),
    "shear": ("warp", "weft"),
}
"""Directions of the specimens of each strip test."""
METHODS = ("cusick", *SPECIMENS)
STRETCH: Mapping[str, float] = {"bias": 0.1, "tensile": 0.05, "shear": np.radians(8.0)}
"""Largest strain, and shear angle [rad] (KES: 8 degrees)."""


@dataclass(frozen=True)
class FabricTest:
    """What a test found.

    Attributes
    ----------
    fabric, method : str
        What was tested, and how.
    rows : tuple of dict
        One for each printed value: name, unit, mean, sd of the specimens (None of one), direction.
    specimens : tuple of dict
        Each specimen's numbers [SI].
    known_error : str
        What is known of the error of mesh and method.
    last : Lay, optional
        The last drape, for its picture.
    """

    fabric: str
    method: str
    rows: tuple[Mapping[str, Any], ...]
    specimens: tuple[Mapping[str, Any], ...]
    known_error: str
    last: "cusick.Lay | None" = None

    def document(self) -> dict[str, Any]:
        """The test as plain data in SI units."""
        return {
            "fabric": self.fabric,
            "method": self.method,
            "values": [dict(row) for row in self.rows],
            "specimens": [dict(each) for each in self.specimens],
            "known_error": self.known_error,
        }

    def text(self) -> str:
        """The values in lines, and the error."""
        cells = []
        for row in self.rows:
            spread = "" if row["sd"] is None else f"{row['sd']:.2g}"
            cells.append((row["name"], row["direction"], f"{row['mean']:.4g}", spread, row["unit"]))
        table = text_table(("value", "direction", "mean", "sd", "unit"), cells)
        return f"{self.fabric}, {self.method}, {len(self.specimens)} specimens\n{table}\n{self.known_error}"


def fabric_tested(
    cloth: Mapping[str, Any],
    method: str,
    lays: int | None = None,
    size: float = SIZE,
    message: Callable[[str], None] | None = None,
) -> FabricTest:
    """Test a fabric.

    Parameters
    ----------
    cloth : mapping
        Keys of the section [cloth] that are not about its mesh: fabric, density, ...
    method : str
        One of `METHODS`.
    lays : int, optional
        Specimens; None: 16 lays of a drape, 3 of each strip.
    size : float
        Distance of neighbouring vertices of a drape [m].
    message : callable, optional
        Gets a line for each specimen.

    Raises
    ------
    InputError
        For another method, or a size from which the drape has no shape.
    """
    if method not in METHODS:
        raise InputError(f"There is no method {method!r}.", f"Choose one of {', '.join(METHODS)}.")
    if not 1e-3 <= size <= 0.02:
        raise InputError(f"The size is {size:g} m.", "Give 1mm to 20mm: the ring of cloth is 60 mm wide.")
    name = str(cloth.get("fabric", "cotton"))
    if set(cloth) - {"fabric"}:
        name += " with " + ", ".join(f"{key} {value:g}" for key, value in cloth.items() if key != "fabric")
    message = message or (lambda line: None)
    if method == "cusick":
        return _drapes(name, cusick.lays(cloth, lays or LAYS, size, message), size)
    specimens: list[dict[str, Any]] = []
    for direction in SPECIMENS[method]:
        for seed in range(lays or REPEATS):
            degrees = strips.DIRECTIONS[direction]
            measured: dict[str, Any]
            if method == "cantilever":
                measured = {"bending_length": strips.bending_length(cloth, degrees, seed)}
            else:
                along = strips.shear if method == "shear" else strips.pull
                stretches, forces = along(cloth, degrees, STRETCH[method], seed)
                kind = "angles" if method == "shear" else "strains"
                measured = {kind: stretches.tolist(), "forces": forces.tolist()}
            specimens.append({"direction": direction, "seed": seed, **measured})
            message(f"{method}, {direction}, specimen {seed + 1}")
    rows = []
    for direction in SPECIMENS[method]:
        own = [each for each in specimens if each["direction"] == direction]
        if method == "cantilever":
            lengths = 1e3 * np.array([each["bending_length"] for each in own])
            rows.append(_row("bending length", "mm", lengths, direction))
            continue
        forces = np.array([each["forces"] for each in own])
        at = np.degrees(own[0]["angles"]) if method == "shear" else 100 * np.array(own[0]["strains"])
        unit = "degrees" if method == "shear" else "%"
        rows += [_row(f"force at {x:.3g} {unit}", "N/m", forces[:, k], direction) for k, x in enumerate(at)]
    return FabricTest(name, method, tuple(rows), tuple(specimens), STRIP_ERRORS[method])


def draw_drape(test: FabricTest, file: Path) -> str:
    """Write a picture of the last drape of a test by `cusick`. Returns the renderer's line."""
    if test.last is None:
        raise InputError(f"A test by {test.method} has no picture.", "Ask for one of --method cusick.")
    surface = render.Surface("specimen", test.last.positions, test.last.triangles, "cloth", np.zeros((0, 2)))
    turn = np.linspace(0, 2 * np.pi, 73)[:-1]
    circle = np.column_stack([PLATE * np.cos(turn), PLATE * np.sin(turn), np.full(72, 0.0)])
    fan = np.column_stack([np.full(72, 72), np.arange(72), (np.arange(72) + 1) % 72])
    lid = render.Surface("lid", np.vstack([circle, np.zeros((1, 3))]), fan, "body", np.zeros((0, 2)))
    return render.draw(file, [surface, lid], size=(800, 640), colour="plain", view=(0.4, -1.0, 0.75), title=test.fabric)


STRIP_ERRORS: Mapping[str, str] = {
    "cantilever": "Mesh of 32 cells: within 2 % of the closed form (D (1 - nu^2)/(rho g))^(1/3) of a strip.",
    "bias": "Elastic sheet without slip of threads; the strip is 4 times as long as wide, its ends do not narrow.",
    "tensile": "The membrane of small strains: a woven cloth pulled tight needs [effects.strain_limit].",
    "shear": "No pretension, no friction of threads; the ends of the specimen take 5 % off G times the angle.",
}


def _drapes(name: str, lays: Sequence[cusick.Lay], size: float) -> FabricTest:
    values = np.array([[each.shape.coefficient, each.shape.folds, each.shape.depth] for each in lays])
    units = ("drape coefficient", "%", 100.0), ("n_eff", "folds", 1.0), ("sd r", "mm", 1e3)
    rows = [_row(label, unit, factor * values[:, k]) for k, (label, unit, factor) in enumerate(units)]
    specimens = [
        {"seed": seed, "coefficient": c, "n_eff": n, "sd_r": d, "at_rest": lay.at_rest, "radii": lay.radii.tolist()}
        for seed, (lay, (c, n, d)) in enumerate(zip(lays, values.tolist(), strict=True))
    ]
    vertices = len(lays[-1].positions)
    error = f"Mesh of {1e3 * size:g} mm, {vertices} vertices beyond the plate. {MESH_ERROR}"
    unfinished = sum(not lay.at_rest for lay in lays)
    if unfinished:
        error += f" {unfinished} of {len(lays)} lays were not at rest."
    return FabricTest(name, "cusick", tuple(rows), tuple(specimens), error, lays[-1])


def _row(name: str, unit: str, values: Any, direction: str = "") -> dict[str, Any]:
    sd = float(np.std(values, ddof=1)) if len(values) > 1 else None
    return {"name": name, "direction": direction, "mean": float(np.mean(values)), "sd": sd, "unit": unit}
