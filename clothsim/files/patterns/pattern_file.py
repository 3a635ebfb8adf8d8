"""Sewing patterns by the ending of their file."""

from pathlib import Path

from clothsim.base.errors import InputError
from clothsim.files.patterns.dxf.reader import read_dxf_pattern
from clothsim.patterns.pattern import Pattern
from clothsim.patterns.specification import read_specification

DXF = ".dxf"


def read_pattern(
    path: str | Path, rotation_order: str = "zyx", seams: str | Path | None = None, sewn: bool = True
) -> Pattern:
    """Read a sewing pattern: a DXF drawing with its sewing file, else a `specification.json`.

    Parameters
    ----------
    path : str or Path
        The file.
    rotation_order : str
        Order of the rotations of a specification, "zyx" or "xyz".
    seams : str or Path, optional
        Sewing file of a drawing; None: NAME.toml beside NAME.dxf.
    sewn : bool
        False: a drawing needs no sewing file.

    Raises
    ------
    MissingPackageError
        A drawing, and ezdxf is not installed.
    InputError
        A file that is no pattern, naming its panel, edge or stitch; seams for a file that names its own.
    """
    if Path(path).suffix.lower() != DXF:
        if seams is not None:
            raise InputError(f"{path} names its own stitches.", "Seams by --seams are for DXF drawings.")
        return read_specification(path, rotation_order)
    return read_dxf_pattern(path, seams, sewn)
