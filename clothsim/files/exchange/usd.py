"""Universal Scene Description: a UsdGeomMesh a surface, its points as time samples; needs usd-core.

Stage: metersPerUnit, upAxis, a time code a frame (timeCodesPerSecond is the rate). Mesh: points, normals and extent
sampled over time, no subdivision; texture coordinates `primvars:st` by corner; panels as GeomSubsets of the family
"panel"; colours of the vertices in `primvars:displayColor`, stretch of the triangles in `primvars:stretch`.
"""

from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError, MissingPackageError
from clothsim.base.file_writing import replacing
from clothsim.base.srgb import linear_rgb
from clothsim.files.exchange.animation import (
    AnimatedPart,
    Animation,
    PartFrame,
    different,
    flat_texture,
    identifier,
)

try:
    from pxr import Gf, Sdf, Tf, Usd, UsdGeom, Vt
except ImportError as error:
    raise MissingPackageError("USD files need the package usd-core.", "Run: pip install 'clothsim[usd]'") from error

ROOT = "/World"
BODY_COLOUR = (0.2, 0.2, 0.2)


def files(animation: Animation, target: Path) -> list[Path]:
    """One file."""
    return [target]


def write(animation: Animation, target: Path) -> None:
    """Write the file."""
    # Until every sample is there the layer lies in memory; its file needs the ending, which chooses text or binary.
    layer = Sdf.Layer.CreateAnonymous(f"clothsim{target.suffix}")
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y if animation.up == "y" else UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, animation.unit)
    stage.GetRootLayer().comment = "clothsim"
    if not animation.alone:
        stage.SetTimeCodesPerSecond(animation.rate)
        stage.SetFramesPerSecond(animation.rate)
        stage.SetStartTimeCode(time_code(animation, animation.times[0]))
        stage.SetEndTimeCode(time_code(animation, animation.times[-1]))
    root = UsdGeom.Xform.Define(stage, ROOT)
    stage.SetDefaultPrim(root.GetPrim())
    names = different([part.name for part in animation.parts], identifier)
    first = animation.at(0)
    meshes = [
        _mesh(stage, f"{ROOT}/{name}", part, shape, animation)
        for name, part, shape in zip(names, animation.parts, first, strict=True)
    ]
    for k, time in enumerate(animation.times):
        code = Usd.TimeCode.Default() if animation.alone else Usd.TimeCode(time_code(animation, time))
        for mesh, part, shape in zip(meshes, animation.parts, animation.at(k), strict=True):
            if k == 0 or part.moving:
                _sample(mesh, part, shape, code if part.moving else Usd.TimeCode.Default())
    with replacing(target) as beside:
        ended = beside.with_name(f"{beside.name}{target.suffix}")
        try:
            layer.Export(str(ended))
            ended.replace(beside)
        except Tf.ErrorException as error:
            raise InputError(f"{target} cannot be written by usd-core.", "Free space, or choose another.") from error
        finally:
            ended.unlink(missing_ok=True)


def time_code(animation: Animation, time: float) -> float:
    """Time code of a time [s]: whole numbers for frames at the rate."""
    code = time * animation.rate
    return float(round(code)) if abs(code - round(code)) < 1e-6 else float(code)


def _mesh(stage: Any, path: str, part: AnimatedPart, shape: PartFrame, animation: Animation) -> Any:
    """A mesh with all that is the same at all times."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    vertices, sizes = part.corners(part.triangles)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(sizes.astype(np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(vertices.astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(part.role == "cloth")
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    if animation.origin.any():
        mesh.AddTranslateOp().Set(Gf.Vec3d(*animation.origin.tolist()))
    primvars = UsdGeom.PrimvarsAPI(mesh)
    if len(part.texture):
        rows, corners = flat_texture(part)
        st = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
        st.Set(Vt.Vec2fArray.FromNumpy(rows.astype(np.float32)))
        st.SetIndices(Vt.IntArray.FromNumpy(part.corners(corners)[0].astype(np.int32)))
    if part.groups:
        for name, (label, faces) in zip(different(list(part.groups), identifier), part.groups.items(), strict=True):
            polygons = np.unique(np.searchsorted(part.first_triangles, faces, side="right") - 1)
            indices = Vt.IntArray.FromNumpy(polygons.astype(np.int32))
            subset = UsdGeom.Subset.CreateGeomSubset(mesh, name, UsdGeom.Tokens.face, indices, "panel")
            subset.GetPrim().SetDisplayName(label)
    if not len(shape.colours):
        mesh.CreateDisplayColorAttr([Gf.Vec3f(*BODY_COLOUR)])
    else:
        mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    if len(shape.stretch):
        primvars.CreatePrimvar("stretch", Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.uniform)
    mesh.GetPrim().SetDisplayName(part.name)
    return mesh


def _sample(mesh: Any, part: AnimatedPart, shape: PartFrame, code: Any) -> None:
    """Write what changes at a time."""
    points = shape.points.astype(np.float32)
    mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points), code)
    mesh.GetNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(shape.normals.astype(np.float32)), code)
    box = np.stack([points.min(axis=0), points.max(axis=0)])
    mesh.GetExtentAttr().Set(Vt.Vec3fArray.FromNumpy(box), code)
    primvars = UsdGeom.PrimvarsAPI(mesh)
    if len(shape.colours):
        colours = linear_rgb(shape.colours).astype(np.float32)
        mesh.GetDisplayColorAttr().Set(Vt.Vec3fArray.FromNumpy(colours), code)
    if len(shape.stretch):
        first = part.first_triangles
        means = np.add.reduceat(shape.stretch, first) / np.diff(np.append(first, len(shape.stretch)))
        primvars.GetPrimvar("stretch").Set(Vt.FloatArray.FromNumpy(means.astype(np.float32)), code)
