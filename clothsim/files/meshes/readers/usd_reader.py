"""Universal Scene Description: the meshes of a stage as polygons; imported where one is read, as it needs usd-core.

Positions are those of the stage's first time, or of samples in time, in metres by its metersPerUnit and by the
transforms of the prims.
Subdivision surfaces are read as their control meshes. Layers that the file names are refused, not opened.
"""

from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError, MissingPackageError
from clothsim.files.meshes.polygons import Polygons

try:
    from pxr import Sdf, Tf, Usd, UsdGeom
except ImportError as error:
    raise MissingPackageError("USD files need the package usd-core.", "Run: pip install 'clothsim[usd]'") from error

_FLATTEN = "Flatten it with `usdcat --flatten`."


def read_usd(path: Path) -> Polygons:
    """The meshes of a USD file at its first time: a group for each mesh and each of its subsets of faces.

    Returns
    -------
    Polygons
        In metres, in the axes of the file.

    Raises
    ------
    InputError
        The file is broken, or names other layers.
    """
    stage = _opened(path)
    return _read_meshes(path, stage, _range(path, stage)[0])


def read_usd_frames(path: Path, rate: float, most: int) -> list[Polygons]:
    """The meshes of a USD file at `rate` frames a second from its first time to its last; errors as of `read_usd`.

    most: largest number of frames. Between its own samples USD interpolates linearly.
    """
    stage = _opened(path)
    first, last = _range(path, stage)
    codes = stage.GetTimeCodesPerSecond() / rate
    if not (0 < codes < np.inf and first <= last):
        raise _broken(path, f"it has {stage.GetTimeCodesPerSecond():g} time codes a second, from {first:g} to {last:g}")
    count = int((last - first) / codes + 1e-6) + 1
    if count > most:
        raise InputError(f"{path} has {count:,} frames at {rate:g} a second, more than {most:,}.", "Use a lower rate.")
    return [_read_meshes(path, stage, first + k * codes) for k in range(count)]


def _opened(path: Path) -> Any:
    """The stage of a file that names no other."""
    try:
        layer = Sdf.Layer.FindOrOpen(str(path))
    except Tf.ErrorException as error:
        raise _broken(path, str(error)) from error
    if layer is None:
        raise _broken(path, "it cannot be opened")
    if layer.GetCompositionAssetDependencies():
        raise InputError(f"{path} names other layers, which are not read.", _FLATTEN)
    stage = Usd.Stage.Open(layer)
    if any(Usd.ClipsAPI(prim).GetClips() for prim in stage.TraverseAll()):
        raise InputError(f"{path} names other layers by value clips, which are not read.", _FLATTEN)
    return stage


def _range(path: Path, stage: Any) -> tuple[float, float]:
    """First and last time code; 0 and 0 where the file gives none."""
    if not stage.HasAuthoredTimeCodeRange():
        return 0.0, 0.0
    first, last = float(stage.GetStartTimeCode()), float(stage.GetEndTimeCode())
    if not (np.isfinite(first) and np.isfinite(last)):
        raise _broken(path, f"its time codes are {first:g} to {last:g}")
    return first, last


def _read_meshes(path: Path, stage: Any, code: float) -> Polygons:
    """The meshes of a stage at a time code."""
    meshes = [UsdGeom.Mesh(prim) for prim in stage.TraverseAll() if prim.IsA(UsdGeom.Mesh)]
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    try:
        parts = [_part(path, mesh, Usd.TimeCode(code), unit) for mesh in meshes]
    except (ValueError, TypeError) as error:  # an attribute that has no value, or of another shape
        raise _broken(path, str(error)) from error
    if not parts:
        raise InputError(f"{path} holds no mesh.")
    up = str(UsdGeom.GetStageUpAxis(stage)).lower()
    # all meshes as one; groups of one name are one
    groups: dict[str, list[np.ndarray]] = {}
    vertices = np.cumsum([0, *(len(part.positions) for part in parts)])
    faces = np.cumsum([0, *(len(part.starts) - 1 for part in parts)])
    edges = np.cumsum([0, *(len(part.corners) for part in parts)])
    for part, first in zip(parts, faces, strict=False):
        for name, own in part.groups.items():
            groups.setdefault(name, []).append(own + first)
    textured = all(len(part.texture) for part in parts)
    return Polygons(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.corners + k for part, k in zip(parts, vertices, strict=False)]),
        np.concatenate([[0], *(part.starts[1:] + k for part, k in zip(parts, edges, strict=False))]).astype(np.int64),
        np.concatenate([part.texture for part in parts]) if textured else np.zeros((0, 2)),
        {name: np.concatenate(own) for name, own in groups.items()},
        (f'{up} up in the file: up = "y" turns it',) if up == "y" else (),
    )


def _broken(path: Path, reason: str) -> InputError:
    return InputError(f"{path} cannot be read as USD ({' '.join(reason.split())[:100]}).", "Export it again.")


def _part(path: Path, mesh: Any, time: Any, unit: float) -> Polygons:
    """One mesh."""
    name = mesh.GetPrim().GetName()
    points = np.array(mesh.GetPointsAttr().Get(time), float).reshape(-1, 3)
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(time), np.int64).ravel()
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time), np.int64).ravel()
    if counts.sum() != len(corners) or (counts < 0).any():
        raise _broken(path, f"the faces of {name} have {len(corners)} corners, not {counts.sum()}")
    to_world = np.array(mesh.ComputeLocalToWorldTransform(time))  # of row vectors
    points = unit * (points @ to_world[:3, :3] + to_world[3, :3])
    groups = {name: np.arange(len(counts))}
    for subset in UsdGeom.Subset.GetGeomSubsets(mesh, UsdGeom.Tokens.face):
        faces = np.array(subset.GetIndicesAttr().Get(time), np.int64).ravel()
        groups[subset.GetPrim().GetName()] = faces[(faces >= 0) & (faces < len(counts))]
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return Polygons(points, corners, starts, _texture(mesh, time, len(corners), corners), groups)


def _texture(mesh: Any, time: Any, count: int, corners: np.ndarray) -> np.ndarray:
    """`primvars:st` of each corner, (c, 2); (0, 2) where it has none by corner or by vertex."""
    st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    if not st or not st.HasValue():
        return np.zeros((0, 2))
    values = np.array(st.ComputeFlattened(time), float).reshape(-1, 2)
    if st.GetInterpolation() in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying) and len(values) > corners.max():
        values = values[corners]
    return values if len(values) == count else np.zeros((0, 2))
