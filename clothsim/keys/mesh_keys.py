"""The sections [cloth] and [body]: fabric, position and source of a mesh."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from clothsim.base.errors import InputError
from clothsim.base.inputs import nearest, table
from clothsim.keys.effect_tables import Motion
from clothsim.keys.generator_keys import GENERATOR_KEYS
from clothsim.keys.key_table import KeyTable, composed
from clothsim.keys.keys import refuse_unknown
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.keys.model_keys import ModelTable
from clothsim.keys.placed_keys import PlacedKeys
from clothsim.keys.schema import Key, Vector, keys_of

MESH = Key("A generator, one of the sections of these names; a mesh file; or in Python arrays or a mesh object")


@dataclass(frozen=True, kw_only=True)
class ClothKeys(PlacedKeys):
    """Fabric, initial velocity and sewing of a cloth."""

    section: ClassVar[str] = "cloth"

    velocity: Annotated[Vector, Key("Velocity at the start", "m/s", length=3)] = (0.0, 0.0, 0.0)
    fabric: Annotated[str, Key("Named fabric, whose values the next keys override; see `clothsim fabrics`")] = "cotton"
    fabric_of: Annotated[
        Mapping[str, Any] | None,
        Key("Named fabrics of panels (groups of a file, panels of a pattern), by name; * stands for any letters",
            shown="none"),
    ] = None  # fmt: skip
    density: Annotated[float | None, Key("Area density", "kg/m2", above=0, shown="the fabric's")] = None
    thickness: Annotated[float | None, Key("Thickness", "m", above=0, shown="the fabric's")] = None
    youngs_modulus: Annotated[
        float | None, Key("Young's modulus; it replaces the stiffnesses of the threads", "Pa", least=0,
                          shown="the fabric's")
    ] = None  # fmt: skip
    poisson_ratio: Annotated[
        float | None, Key("Poisson's ratio", "1", above=-1, most=0.5, shown="the fabric's")
    ] = None  # fmt: skip
    bending_stiffness: Annotated[
        float | None, Key("Bending stiffness; it replaces those along warp, weft and bias", "N m", least=0,
                          shown="the fabric's")
    ] = None  # fmt: skip
    bending_warp: Annotated[float | None, Key("Bending stiffness along warp", "N m", least=0, shown="the fabric's")] = (
        None
    )
    bending_weft: Annotated[float | None, Key("Bending stiffness along weft", "N m", least=0, shown="the fabric's")] = (
        None
    )
    bending_bias: Annotated[
        float | None, Key("Bending stiffness at 45 degrees to warp and weft", "N m", above=0, shown="the fabric's")
    ] = None
    warp_stiffness: Annotated[float | None, Key("Stiffness along warp", "N/m", least=0, shown="the fabric's")] = None
    weft_stiffness: Annotated[float | None, Key("Stiffness along weft", "N/m", least=0, shown="the fabric's")] = None
    shear_stiffness: Annotated[float | None, Key("Stiffness in shear", "N/m", least=0, shown="the fabric's")] = None
    thread_poisson_ratio: Annotated[
        float | None,
        Key("Geometric mean of both Poisson's ratios of the threads", "1", above=-1, below=1, shown="the fabric's"),
    ] = None  # fmt: skip
    warp_extension: Annotated[
        float | None, Key("Strain under 490 N/m along warp, for strain_limit", "1", above=0, shown="the fabric's")
    ] = None
    weft_extension: Annotated[
        float | None, Key("Strain under 490 N/m along weft, for strain_limit", "1", above=0, shown="the fabric's")
    ] = None
    weld: Annotated[float, Key("Border vertices closer than this are sewn; 0 is none", "m", least=0)] = 0.0
    sewn: Annotated[bool, Key("The mesh is sewn already: seams of three layers are no fault")] = False


@dataclass(frozen=True, kw_only=True)
class FilePart(KeyTable):
    """A part of a mesh file: one of group, component and vertices."""

    section: ClassVar[str] = "a file"

    group: Annotated[str | None, Key("A group or object of an OBJ file, a node of a glb", shown="all")] = None
    component: Annotated[
        int | None, Key("A connected piece, numbered by decreasing number of vertices", "1", least=0, shown="all")
    ] = None
    vertices: Annotated[
        Sequence[int] | None, Key("Range [lo, hi) of the file's vertices", "1", least=0, length=2, shown="all")
    ] = None


@dataclass(frozen=True, kw_only=True)
class PatternFile(KeyTable):
    """Mesh of a sewing pattern (`specification.json`), as cloth."""

    section: ClassVar[str] = "a sewing pattern"

    size: Annotated[float, Key("Distance of neighbouring vertices", "m", above=0)] = 0.02
    rotation_order: Annotated[
        Literal["zyx", "xyz"], Key('Rotation of a panel: "zyx" is Rz Ry Rx; "xyz" as GarmentCode from 2.0 on writes it')
    ] = "zyx"


@dataclass(frozen=True, kw_only=True)
class ClothTable(ClothKeys):
    """A cloth: a generated mesh, or one of a file or in memory."""

    mesh: Annotated[str | Any, MESH]
    rest: Annotated[
        str, Key('Rest shape of a file: "file", its own shape, or "vt", its texture coordinates in metres')
    ] = "file"


@dataclass(frozen=True, kw_only=True)
class BodyKeys(PlacedKeys):
    """Position and rigid motion of a body."""

    section: ClassVar[str] = "body"

    motion: Annotated[
        Motion | Mapping[str, Any] | None, Key("Rigid motion of the body", tables=(Motion,), shown="none")
    ] = None


@dataclass(frozen=True, kw_only=True)
class BodyTable(BodyKeys):
    """A body at rest or in rigid motion: a generated mesh, or one of a file or in memory."""

    mesh: Annotated[str | Any, MESH]


@dataclass(frozen=True, kw_only=True)
class FrameRate(KeyTable):
    """Frame rate of an animated body."""

    section: ClassVar[str] = "frames"

    frames_per_second: Annotated[float, Key("Frames for each second of the animation", "1/s", above=0)] = 25.0


@dataclass(frozen=True, kw_only=True)
class FramesTable(PlacedKeys, FrameRate):
    """An animated body: `frames` in place of a mesh."""

    section: ClassVar[str] = "body"

    frames: Annotated[str, Key("Pattern of the mesh files of the frames, in place of mesh")]


def check_cloth(where: str, keys: Any) -> ClothTable:
    """The section of a table of a cloth. InputError names a bad key."""
    return section_of(where, keys, cloth_sections)  # type: ignore[return-value]


def check_body(where: str, keys: Any) -> BodyTable | FramesTable | ModelTable:
    """The section of a table of a body. InputError names a bad key."""
    return section_of(where, keys, body_sections)  # type: ignore[return-value]


def cloth_sections(where: str, keys: Mapping[str, Any]) -> tuple[type[KeyTable], ...]:
    """The sections whose keys a cloth has: its own, and those of its generator, sewing pattern or part of a file."""
    mesh = keys.get("mesh")
    is_pattern = isinstance(mesh, str) and mesh.isprintable() and Path(mesh).suffix.lower() == ".json"
    return (ClothTable, *((PatternFile,) if is_pattern else sources(where, keys)))


def body_sections(where: str, keys: Mapping[str, Any]) -> tuple[type[KeyTable], ...]:
    """The sections whose keys a body has: of a model, of frames, or its own with those of its generator or file."""
    for source, kinds in {"model": (ModelTable,), "frames": (FramesTable, FilePart)}.items():
        if source not in keys:
            continue
        for other in ("mesh", "frames", "motion") if source == "frames" else ("mesh", "frames"):
            if other in keys and other != source:
                raise InputError(f"{where} has {source} and {other}.", f"Give {other} or {source}, not both.")
        return kinds
    return (BodyTable, *sources(where, keys))


def sources(where: str, keys: Mapping[str, Any]) -> tuple[type[KeyTable], ...]:
    """The section of the generator, or of a part of a file, that the key `mesh` names."""
    mesh = keys.get("mesh")
    if isinstance(mesh, MeshArrays):
        return () if mesh.frames is None else (FrameRate,)
    if not isinstance(mesh, str) or not mesh or not mesh.isprintable():
        raise InputError(f"{where} has no mesh.", f"Give one of {', '.join(GENERATOR_KEYS)}, or a file.")
    if mesh in GENERATOR_KEYS:
        return (GENERATOR_KEYS[mesh],)
    if "." not in Path(mesh).name:
        known = f"Give one of {', '.join(GENERATOR_KEYS)}, or a file with its ending."
        hint = " ".join(filter(None, [nearest(mesh, GENERATOR_KEYS), known]))
        raise InputError(f"{where}.mesh is {mesh!r}, which is no generator and no file.", hint)
    return (FilePart,)


def section_of(
    where: str, keys: Any, kinds: Callable[[str, Mapping[str, Any]], tuple[type[KeyTable], ...]]
) -> KeyTable:
    """The section of a table of keys; kinds: the sections whose keys it has. InputError names a bad key."""
    given = table(where, keys)
    parts = kinds(where, given)
    kind = composed(parts)
    if type(given) is kind:
        return given
    source = "model" if ModelTable in parts else parts[-1].section if len(parts) > 1 else "arrays"
    refuse_unknown(f"{where} ({source})", given, keys_of(kind))
    return kind.of_known_keys(where, given)
