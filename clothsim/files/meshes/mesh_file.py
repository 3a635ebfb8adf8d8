"""Mesh files, read as triangles in metres."""

import contextlib
import io
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from clothsim.base.errors import InputError
from clothsim.base.safe_files.regular_file import read_regular_file
from clothsim.files.meshes.gmsh import read_msh
from clothsim.files.meshes.library_readers import LIBRARY_READERS
from clothsim.files.meshes.mesh_part import MeshFile, Part, choose
from clothsim.files.meshes.obj import read_obj
from clothsim.files.meshes.off import read_off
from clothsim.files.meshes.polygons import Polygons, cut_polygons
from clothsim.files.meshes.usd_reader import USD_ENDINGS, read_usd
from clothsim.files.meshes.vtk_legacy import read_vtk

TEXT_READERS = {".obj": read_obj, ".off": read_off}
BYTE_READERS = {".vtk": read_vtk, ".msh": read_msh}
ENDINGS = (*TEXT_READERS, *BYTE_READERS, *LIBRARY_READERS)


def read_mesh(
    path: str | Path,
    *,
    scale: float = 1.0,
    group: str | None = None,
    component: int | None = None,
    vertices: Sequence[int] | None = None,
) -> MeshFile:
    r"""Read a mesh file or one part of it.

    A part keeps the order of its vertices and triangles and drops the vertices that it does not use; the whole file
    keeps them all.

    Parameters
    ----------
    path : str or Path
        An obj, ply, stl, off, vtk, vtu, msh or glb file; usd, usda or usdc with ``clothsim[usd]``.
    scale : float
        Metres per unit of the file.
    group : str, optional
        A group or object of an OBJ, a node of a glb, a mesh or subset of a USD file.
    component : int, optional
        A connected piece, numbered from 0 by decreasing number of vertices.
    vertices : (lo, hi), optional
        The vertices lo to hi - 1 of the file.

    Returns
    -------
    MeshFile
        Its triangles, in metres.

    Raises
    ------
    InputError
        The file cannot be read; the sentence has the path, and of an OBJ the line.

    Examples
    --------
    >>> from pathlib import Path
    >>> file = Path("quad.obj")
    >>> _ = file.write_text("v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nf 1 2 3 4\n")
    >>> mesh = read_mesh(file, scale=0.01)
    >>> mesh.triangles.tolist(), float(mesh.positions.max())
    ([[0, 1, 2], [0, 2, 3]], 0.1)
    >>> mesh.messages
    ('1 quads cut into triangles', 'scaled by 0.01')
    """
    file = Path(path)
    polygons = read_polygons(file)
    part = Part(scale, group, component, vertices)
    return choose(file, polygons, cut_polygons(polygons), part)


def read_polygons(file: Path) -> Polygons:
    """The polygons of a file, with finite vertices and corners in range. InputError as of `read_mesh`."""
    return checked(file, _read(file))


def _read(file: Path) -> Polygons:
    ending = file.suffix.lower()
    if ending not in (*ENDINGS, *USD_ENDINGS):
        known = ", ".join((*ENDINGS, *USD_ENDINGS))
        raise InputError(f"{file} has an unknown ending {ending!r}.", f"Known are {known}.")
    try:
        content = read_regular_file(file)
    except FileNotFoundError as error:
        raise InputError(f"{file} cannot be opened ({error.strerror}).") from error
    if not content.strip():
        raise InputError(f"{file} is empty.")
    if ending in USD_ENDINGS:
        return read_usd(file)
    if ending in TEXT_READERS:
        if b"\0" in content:
            raise InputError(f"{file} is a binary file, not {ending[1:]} text.")
        return TEXT_READERS[ending](file, content.decode("utf-8", errors="replace"))
    if ending in BYTE_READERS:
        return BYTE_READERS[ending](file, content)
    return _read_with_library(file, ending, content)


def _read_with_library(file: Path, ending: str, content: bytes) -> Polygons:
    """Read by a library; all its exceptions, exits and prints become one sentence of an InputError."""
    try:
        nowhere = io.StringIO()
        with warnings.catch_warnings(), contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
            warnings.simplefilter("ignore")
            return LIBRARY_READERS[ending](file, content)
    except (InputError, ImportError):
        raise
    except (Exception, SystemExit) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{file} cannot be read as {ending[1:]} ({reason[:100]}).") from error


def checked(file: Path, polygons: Polygons) -> Polygons:
    """The polygons. InputError for a vertex that is not finite and for a face of vertices that are not there."""
    points, corners = polygons.positions, polygons.corners
    # Of a file that is no mesh nothing is repeated: it may be anything.
    notes = "".join(f", {message}" for message in polygons.messages if len(points))
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"{file} has vertices of shape {points.shape}, not (n, 3).")
    if not len(corners):
        raise InputError(f"{file} holds no faces ({len(points)} vertices{notes}).")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InputError(
            f"{file}: vertex {bad[0]} is {points[bad[0]].tolist()}, not finite ({len(bad)} such vertices)."
        )
    bad = np.flatnonzero((corners < 0) | (corners >= len(points)))
    if len(bad):
        face = np.searchsorted(polygons.starts, bad[0], side="right") - 1
        raise InputError(
            f"{file}: face {face} names vertex {corners[bad[0]]}, out of range 0..{len(points) - 1} "
            f"({len(bad)} such corners)."
        )
    small = np.flatnonzero(np.diff(polygons.starts) < 3)
    if len(small):
        raise InputError(f"{file}: face {small[0]} has fewer than three corners ({len(small)} such faces).")
    return polygons
