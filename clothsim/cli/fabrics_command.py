"""`clothsim fabrics`: the named fabrics, all values of one with their sources, and a card of their drapes."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.base.text import text_table
from clothsim.cli.report import Report

_DESCRIPTION = """\
List the named fabrics, show all values of one, or draw a drape of each.

  clothsim fabrics denim
  clothsim fabrics --swatches fabrics.png
"""

_VALUES = {
    "density": ("kg/m2", 1.0),
    "thickness": ("mm", 1e3),
    "warp_stiffness": ("N/m", 1.0),
    "weft_stiffness": ("N/m", 1.0),
    "shear_stiffness": ("N/m", 1.0),
    "thread_poisson_ratio": ("", 1.0),
    "warp_extension": ("%", 1e2),
    "weft_extension": ("%", 1e2),
    "bending_warp": ("uN m", 1e6),
    "bending_weft": ("uN m", 1e6),
    "bending_bias": ("uN m", 1e6),
    "youngs_modulus": ("MPa", 1e-6),
    "poisson_ratio": ("", 1.0),
    "bending_stiffness": ("uN m", 1e6),
    "friction": ("", 1.0),
}
"""Rows of `clothsim fabrics NAME`: the scene's key, its unit, and the factor from SI."""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    fabrics = commands.add_parser("fabrics", description=_DESCRIPTION)
    fabrics.add_argument("name", nargs="?", metavar="NAME", help="all values of this fabric, with their sources")
    fabrics.add_argument(
        "--swatches", type=Path, metavar="PNG", help="a picture of a Cusick drape of each (or of NAME)"
    )
    fabrics.add_argument("--json", action="store_true", help="as JSON in SI units: {name: {values, sources}}")
    fabrics.add_argument("--debug", action="store_true", help="show tracebacks")
    fabrics.set_defaults(handler=_fabrics)


def _fabrics(arguments: argparse.Namespace) -> Report:
    name, file = arguments.name, arguments.swatches
    if name is not None:
        engine.fabric_named("NAME", name)
    if file is not None:
        return _swatches([name] if name is not None else list(engine.FABRICS), file)
    names = list(engine.FABRICS) if name is None else [name]
    document = {each: _document(each) for each in names}
    return Report(document, table(names) if name is None else sheet(name))


def _document(name: str) -> dict[str, Any]:
    """Values of a fabric in SI units, null where no source gives one, and their sources."""
    named = engine.FABRICS[name]
    values = {key: getattr(named.fabric, key) for key in _VALUES}
    return {"made_of": named.made_of, "values": values, "sources": dict(named.sources)}


def _swatches(names: list[str], file: Path) -> Report:
    if file.suffix.lower() != ".png":
        raise InputError(f"--swatches is {str(file)!r}.", "A picture ends in .png.")
    if not file.parent.is_dir():
        raise InputError(f"There is no directory {file.parent}.", "Make it first, or choose another.")
    note = engine.draw_swatches(names, file)
    return Report({"file": str(file), "note": note}, f"{file}. {note}")


def table(names: Sequence[str]) -> str:
    """The fabrics in lines: weight, thickness, stiffness along warp and weft and in shear, bending, source."""
    header = (
        "fabric",
        "g/m2",
        "mm",
        "warp N/m",
        "weft N/m",
        "shear N/m",
        "bending uN m",
        "measured by",
        "% at 490 N/m",
        "estimated",
    )
    rows = []
    for named in (engine.FABRICS[name] for name in names):
        fabric = named.fabric
        numbers = (
            f"{1e3 * fabric.density:.0f}",
            f"{1e3 * fabric.thickness:.2f}",
            f"{fabric.stiffness_along_warp:,.0f}",
            f"{fabric.stiffness_along_weft:,.0f}",
            f"{fabric.stiffness_in_shear:,.0f}",
            f"{1e6 * fabric.bending_stiffness:.1f}",
        )
        extensions = f"{100 * fabric.extension_along_warp:.3g}, {100 * fabric.extension_along_weft:.3g}"
        estimated = dict.fromkeys(key.split("_")[-1] for key in named.estimated)
        rows.append((fabric.name, *numbers, named.measured_by, extensions, ", ".join(estimated)))
    lines = text_table(header, rows)
    return f"{lines}\n\nThe extensions along warp and weft act with [effects.strain_limit]."


def sheet(name: str) -> str:
    """All values of a fabric, a line each, with the source of each."""
    named, rows = engine.FABRICS[name], []
    for key, (unit, factor) in _VALUES.items():
        value = getattr(named.fabric, key)
        if value is not None:
            rows.append((key, f"{factor * value:.4g}", unit, named.sources[key]))
    silent = [key for key in _VALUES if getattr(named.fabric, key) is None]
    lines = [f"{named.fabric.name}: {named.made_of}", text_table(("value", "", "unit", "source"), rows)]
    lines.append(f"{named.measured_by}: {named.fabric.source}.")
    if silent:
        lines.append(f"No source gives: {', '.join(silent)}.")
    return "\n\n".join(lines)
