"""The sections [cloth], [body], [rigid] and [rod]: name and position, material, source of the mesh."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from clothsim.base.errors import InputError
from clothsim.base.inputs import as_table, did_you_mean
from clothsim.keys.effect_tables import SELECT, Motion
from clothsim.keys.generator_keys import GENERATOR_KEYS
from clothsim.keys.key_table import KeyTable, composed
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.keys.schema import Key, OverTime, Selection, Vector, keys_of
from clothsim.keys.value_checks import refuse_unknown_key


@dataclass(frozen=True, kw_only=True)
class PlacedKeys(KeyTable):
    """Name, position and unit of a mesh."""

    name: Annotated[str | None, Key("Name in messages, tables and the trajectory", shown="the section's")] = None
    position: Annotated[Vector, Key("Displacement of the mesh", "m", length=3)] = (0.0, 0.0, 0.0)
    rotation_degrees: Annotated[
        Vector, Key("Rotation about x, then y, then z, before the displacement", "degrees", length=3)
    ] = (0.0, 0.0, 0.0)
    scale: Annotated[float, Key("Metres per unit of the mesh", "m", above=0)] = 1.0
    up: Annotated[Literal["z", "y"], Key("Axis of the mesh that points up; y is turned onto z before the rotation")] = (
        "z"
    )


@dataclass(frozen=True, kw_only=True)
class ClipKeys(KeyTable):
    """Skeletal motion of a body model: its clip, the part of it, and the way into it."""

    section: ClassVar[str] = "body.motion"

    clip: Annotated[
        str,
        Key(
            'A clip: "walk" or "turn"; a random one, such as "squat:3"; a .bvh file, an AMASS .npz file; or "own", the '
            "animation of the model's file"
        ),
    ]
    animation: Annotated[str | None, Key("Name of the animation, with `own`", shown="the first")] = None
    scale: Annotated[
        float | None, Key("Metres per unit of the clip", "m", above=0, shown="the ratio of the thighs")
    ] = None
    start: Annotated[float, Key("First time of the clip that is used", "s", least=0)] = 0.0
    end: Annotated[float | None, Key("Last time of the clip that is used", "s", above=0, shown="its end")] = None
    loop: Annotated[bool, Key("Repeat this part of the clip; the body continues from where it is")] = False
    lead_in: Annotated[float, Key("Time from the pose of the body to the start of the clip", "s", least=0)] = 0.7
    keep_apart: Annotated[
        bool, Key("Turn shoulders and hips by the least angles that leave 1.2 % of the height between limbs and trunk")
    ] = False
    place: Annotated[
        Literal["start", "clip"] | None,
        Key(
            "Begin at the position and heading of the body, or at those of the clip",
            shown='"clip" with `own`, else "start"',
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class ModelTable(PlacedKeys):
    """A posed or moving body model: `model` in place of a mesh."""

    section: ClassVar[str] = "body"

    model: Annotated[
        str,
        Key('A body model: "mannequin"; a rigged .glb or .gltf; or an .npz with the keys of SMPL, in place of mesh'),
    ]
    shape: Annotated[
        Sequence[float] | Mapping[str, float] | None,
        Key("Measures of the mannequin or weights of morph targets by name; shape parameters of an .npz", shown="none"),
    ] = None
    pose: Annotated[
        str | Mapping[str, Any] | None,
        Key(
            "Pose at the start: a name for the mannequin, otherwise rotation vectors by joint from the rest pose",
            "degrees",
            shown="the rest pose",
        ),
    ] = None
    motion: Annotated[
        str | ClipKeys | Mapping[str, Any] | None,
        Key("Skeletal motion: the clip's name or a table", tables=(ClipKeys,), shown="none"),
    ] = None
    group: Annotated[str | None, Key("Only this skinned node of a .glb", shown="all")] = None
    up: Annotated[
        Literal["z", "y"] | None,
        Key("Axis of the model that points up; y is turned onto z", shown="z for the mannequin, else y"),
    ] = None  # type: ignore[assignment]


MESH = Key("A generator (the sections mesh = ...), a mesh file, or in Python arrays or a mesh object")


@dataclass(frozen=True, kw_only=True)
class ClothKeys(PlacedKeys):
    """Fabric, initial velocity and sewing of a cloth."""

    section: ClassVar[str] = "cloth"

    velocity: Annotated[Vector, Key("Velocity at the start", "m/s", length=3)] = (0.0, 0.0, 0.0)
    fabric: Annotated[str, Key("Named fabric; keys such as density override it; see `clothsim fabrics`")] = "cotton"
    fabric_of: Annotated[
        Mapping[str, Any] | None,
        Key("Named fabrics of panels (groups of a file, panels of a pattern), by name; * stands for any characters",
            shown="none"),
    ] = None  # fmt: skip
    density: Annotated[float | None, Key("Area density", "kg/m2", above=0, shown="the fabric's")] = None
    thickness: Annotated[float | None, Key("Thickness", "m", above=0, shown="the fabric's")] = None
    youngs_modulus: Annotated[
        OverTime | None, Key("Young's modulus; it replaces the stiffnesses of the threads", "Pa", least=0,
                          shown="the fabric's")
    ] = None  # fmt: skip
    poisson_ratio: Annotated[
        float | None, Key("Poisson's ratio", "1", above=-1, most=0.5, shown="the fabric's")
    ] = None  # fmt: skip
    bending_stiffness: Annotated[
        OverTime | None, Key("Bending stiffness; it replaces those along warp, weft and bias", "N m", least=0,
                          shown="the fabric's")
    ] = None  # fmt: skip
    bending_warp: Annotated[
        OverTime | None, Key("Bending stiffness along warp", "N m", least=0, shown="the fabric's")
    ] = None
    bending_weft: Annotated[
        OverTime | None, Key("Bending stiffness along weft", "N m", least=0, shown="the fabric's")
    ] = None
    bending_bias: Annotated[
        OverTime | None, Key("Bending stiffness at 45 degrees to warp and weft", "N m", above=0, shown="the fabric's")
    ] = None
    bending_slope: Annotated[
        float | None,
        Key("Slope s of the moment D k + s k^2 at curvature k; a negative s softens bending, down to 0.2 D",
            "N m2", shown="the fabric's"),
    ] = None  # fmt: skip
    bending_slope_warp: Annotated[
        float | None, Key("Value of bending_slope along warp", "N m2", shown="bending_slope")
    ] = None  # fmt: skip
    bending_slope_weft: Annotated[
        float | None, Key("Value of bending_slope along weft", "N m2", shown="bending_slope")
    ] = None  # fmt: skip
    bending_slope_bias: Annotated[
        float | None, Key("Value of bending_slope at 45 degrees to warp and weft", "N m2", shown="from warp and weft")
    ] = None  # fmt: skip
    rest_curvature_warp: Annotated[
        OverTime | None, Key("Curvature at rest (curl) along warp, above 0 towards the front", "1/m",
                          shown="the fabric's")
    ] = None  # fmt: skip
    rest_curvature_weft: Annotated[
        OverTime | None, Key("Curvature at rest (curl) along weft, above 0 towards the front", "1/m",
                          shown="the fabric's")
    ] = None  # fmt: skip
    bending_hysteresis: Annotated[
        float | None,
        Key("Width 2HB of the hysteresis loop of moment over curvature", "N m/m", least=0, shown="the fabric's"),
    ] = None
    bending_hysteresis_warp: Annotated[
        float | None, Key("Width 2HB along warp", "N m/m", least=0, shown="bending_hysteresis")
    ] = None
    bending_hysteresis_weft: Annotated[
        float | None, Key("Width 2HB along weft", "N m/m", least=0, shown="bending_hysteresis")
    ] = None
    hysteresis_curvature: Annotated[
        float | None,
        Key("Change of curvature over which the friction of bending grows to its limit", "1/m", above=0,
            shown="the fabric's"),
    ] = None  # fmt: skip
    warp_stiffness: Annotated[OverTime | None, Key("Stiffness along warp", "N/m", least=0, shown="the fabric's")] = None
    weft_stiffness: Annotated[OverTime | None, Key("Stiffness along weft", "N/m", least=0, shown="the fabric's")] = None
    shear_stiffness: Annotated[OverTime | None, Key("Stiffness in shear", "N/m", least=0, shown="the fabric's")] = None
    thread_poisson_ratio: Annotated[
        float | None,
        Key("Geometric mean of the Poisson's ratios along warp and weft", "1", above=-1, below=1, shown="the fabric's"),
    ] = None  # fmt: skip
    warp_extension: Annotated[
        float | None, Key("Strain under 490 N/m along warp, for strain_limit", "1", above=0, shown="the fabric's")
    ] = None
    weft_extension: Annotated[
        float | None, Key("Strain under 490 N/m along weft, for strain_limit", "1", above=0, shown="the fabric's")
    ] = None
    shrinkage_warp: Annotated[
        OverTime, Key("Fraction by which the rest shape is shorter along warp; below 0 it is longer", "1", below=1)
    ] = 0.0
    shrinkage_weft: Annotated[
        OverTime, Key("Fraction by which the rest shape is shorter along weft; below 0 it is longer", "1", below=1)
    ] = 0.0
    weld: Annotated[float, Key("Border vertices closer than this are sewn together; 0: none", "m", least=0)] = 0.0
    sewn: Annotated[bool, Key("The mesh is sewn already: seams where three layers meet are no fault")] = False


@dataclass(frozen=True, kw_only=True)
class FilePart(KeyTable):
    """A part of a mesh file, chosen by one of group, parts, component and vertices."""

    section: ClassVar[str] = "a file"

    group: Annotated[str | None, Key("A group or object of an OBJ file, or a node of a .glb", shown="all")] = None
    parts: Annotated[
        Sequence[str],
        Key("Several such groups that together form the body, such as skin and shoes; the others are left out",
            shown="all"),
    ] = ()  # fmt: skip
    component: Annotated[
        int | None, Key("A connected piece, numbered by decreasing number of vertices", "1", least=0, shown="all")
    ] = None
    vertices: Annotated[
        Sequence[int] | None, Key("Range [lo, hi) of the file's vertices", "1", least=0, length=2, shown="all")
    ] = None


@dataclass(frozen=True, kw_only=True)
class PatternFile(KeyTable):
    """A cloth meshed from a sewing pattern (`specification.json`)."""

    section: ClassVar[str] = "a sewing pattern"

    size: Annotated[float, Key("Distance between neighbouring vertices", "m", above=0)] = 0.02
    rotation_order: Annotated[
        Literal["zyx", "xyz"],
        Key('Order of panel rotations: "zyx" for Rz Ry Rx; "xyz" for files of GarmentCode from 2.0 on'),
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

    frames_per_second: Annotated[float, Key("Frames per second of the animation", "1/s", above=0)] = 25.0


@dataclass(frozen=True, kw_only=True)
class FramesTable(PlacedKeys, FrameRate):
    """An animated body: `frames` in place of a mesh."""

    section: ClassVar[str] = "body"

    frames: Annotated[str, Key("Mesh files of the frames, as a pattern with *, in place of mesh")]


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
        hint = " ".join(filter(None, [did_you_mean(mesh, GENERATOR_KEYS), known]))
        raise InputError(f"{where}.mesh is {mesh!r}, which is neither a generator nor a file.", hint)
    return (FilePart,)


def section_of(
    where: str, keys: Any, kinds: Callable[[str, Mapping[str, Any]], tuple[type[KeyTable], ...]]
) -> KeyTable:
    """The section of a table of keys; kinds: the sections whose keys it has. InputError names a bad key."""
    given = as_table(where, keys)
    parts = kinds(where, given)
    kind = composed(parts)
    if type(given) is kind:
        return given
    source = "model" if ModelTable in parts else parts[-1].section if len(parts) > 1 else "arrays"
    refuse_unknown_key(f"{where} ({source})", given, keys_of(kind))
    return kind.of_known_keys(where, given)


@dataclass(frozen=True, kw_only=True)
class JointKeys(KeyTable):
    """A joint between a rigid body and the world: a ball joint, or a hinge if it has an axis."""

    section: ClassVar[str] = "rigid.joint"

    point: Annotated[Vector, Key("Point that the body turns about, at the start", "m", length=3)]
    axis: Annotated[
        Vector | None, Key("Direction of the hinge", "1", length=3, shown="none, a ball joint")
    ] = None  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class TieKeys(KeyTable):
    """Cloth tied to a rigid body, such as a button or a hanger."""

    section: ClassVar[str] = "rigid.tie"

    select: Annotated[Selection, SELECT]
    stiffness: Annotated[
        float | None, Key("Stiffness of the tie of each vertex", "N/m", above=0, shown="100 times the fabric's")
    ] = None


@dataclass(frozen=True, kw_only=True)
class RigidKeys(PlacedKeys):
    """Mass, start, joint and ties of a rigid body."""

    section: ClassVar[str] = "rigid"

    density: Annotated[float, Key("Density of the solid inside the mesh", "kg/m3", above=0)] = 1000.0
    velocity: Annotated[Vector, Key("Velocity of the centre of mass at the start", "m/s", length=3)] = (0.0, 0.0, 0.0)
    spin_degrees_per_second: Annotated[
        Vector, Key("Angular velocity at the start, as a vector along the axis of rotation", "degrees/s", length=3)
    ] = (0.0, 0.0, 0.0)
    joint: Annotated[
        JointKeys | Mapping[str, Any] | None, Key("Joint to the world", tables=(JointKeys,), shown="none")
    ] = None
    tie: Annotated[
        Sequence[TieKeys | Mapping[str, Any]], Key("Vertices of cloth that are tied to it", tables=(TieKeys,))
    ] = ()
    stiffness: Annotated[float, Key("Stiffness of the energy that keeps it rigid", "Pa", above=0)] = 1e8


@dataclass(frozen=True, kw_only=True)
class RigidTable(RigidKeys):
    """A rigid body moved by weight, contact and cloth: a closed mesh from a generator, a file or memory."""

    mesh: Annotated[str | Any, MESH]


def check_rigid(where: str, keys: Any) -> RigidTable:
    """The section of a table of a rigid body. InputError names a bad key."""
    return section_of(where, keys, rigid_sections)  # type: ignore[return-value]


def rigid_sections(where: str, keys: Mapping[str, Any]) -> tuple[type[KeyTable], ...]:
    """The sections whose keys a rigid body has: its own, and those of its generator or part of a file."""
    return (RigidTable, *sources(where, keys))


@dataclass(frozen=True, kw_only=True)
class RodTable(PlacedKeys):
    """A round wire, cord or thread, straight at rest, that is not part of a cloth."""

    section: ClassVar[str] = "rod"

    points: Annotated[Sequence[Sequence[float]], Key("Points [[x, y, z], ...] of its centre line at the start", "m")]
    edge: Annotated[
        float | None, Key("Length of the edges that divide the line", "m", above=0, shown="as the points")
    ] = None  # fmt: skip
    loop: Annotated[bool, Key("Join its ends")] = False
    radius: Annotated[float, Key("Radius of its cross-section", "m", above=0)]
    density: Annotated[float, Key("Density", "kg/m3", above=0)] = 1000.0
    youngs_modulus: Annotated[float, Key("Young's modulus: EA = E pi r^2, EI = E pi r^4/4", "Pa", above=0)]
    velocity: Annotated[Vector, Key("Velocity at the start", "m/s", length=3)] = (0.0, 0.0, 0.0)


def check_rod(where: str, keys: Any) -> RodTable:
    """The section of a table of a rod. InputError names a bad key."""
    return RodTable.parsed(where, keys)
