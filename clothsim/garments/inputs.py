"""Body and garment of a fit from files: part, unit of length, vertical axis; the file of the garment in a new shape."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from clothsim import Body, Cloth, load_scene
from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.base.memo import known_for_arrays
from clothsim.base.triangles import distinct_edges, half_edges
from clothsim.engine import body_mesh, build, cloth_mesh, components, example_file, refuse_unwearable, worn_shape
from clothsim.files import MeshFile, moved_obj, read_clothes, read_mesh
from clothsim.garments.fit.pieces import UNDIVIDED, Division, divided
from transfer.body_frame import BodyFrame, body_frame, legs_score
from transfer.body_parts import BodyParts, body_parts
from transfer.errors import TransferError
from transfer.part_warp import nearest_facing_alike
from transfer.signed_distance import body_surface
from transfer.wrap import union

known_surface = known_for_arrays(body_surface)
"""The surface of a body, or of the wrap of an outfit: each is asked for several times."""
NO_VERTICES: Ints = np.zeros(0, np.int64)
HEADER = "# fitted by clothsim: positions in metres; else as in {name}{changes}\n"


@dataclass(frozen=True)
class Original:
    """OBJ file of a garment; rows (k,): vertex of the garment of each vertex of the file, -1 where it is in none.

    name: of the file, empty where there is none; text: its content.
    """

    name: str = ""
    text: str = field(default="", repr=False)
    rows: Ints = field(default_factory=lambda: NO_VERTICES, repr=False, compare=False)

    @property
    def note(self) -> str:
        """Differences of the copy from the file in words, empty where only the positions differ."""
        left = self.rows[self.rows >= 0]
        differences = [
            (len(self.rows) - len(left), "{:,} vertices that are not of the garment are left out"),
            (len(left) - len(np.unique(left)), "{:,} vertices coincide with those that they were welded to"),
        ]
        return "; ".join(words.format(count) for count, words in differences if count)

    def moved_to(self, positions: Floats) -> str:
        """Text of the file with the garment at `positions` (n, 3) [m]. InputError where its vertices cannot be read."""
        changes = f"; {self.note}" if self.note else ""
        return HEADER.format(name=" ".join(self.name.split()), changes=changes) + moved_obj(
            self.text, positions, self.rows
        )


NO_ORIGINAL = Original()
"""A garment from memory, from a generator, or from a file other than OBJ."""


def original_of(file: Path, mesh: MeshFile, sewn: Ints = NO_VERTICES) -> Original:
    """The OBJ `file` that `mesh` was read from; none for another kind of file.

    sewn (n,): vertex of the garment of each vertex of the mesh; empty: its own.
    """
    if file.suffix.lower() != ".obj":
        return NO_ORIGINAL
    text = file.read_text(encoding="utf-8", errors="replace")
    rows = np.arange(len(mesh.positions))
    if len(sewn):
        rows = sewn
    if len(mesh.used):
        whole = np.full(mesh.used.max() + 1, -1)
        whole[mesh.used] = rows
        rows = whole
    return Original(file.name, text, rows)


def original_of_scene(cloth: Mapping[str, Any], folder: Path, vertices: int) -> Original:
    """The OBJ file of a scene's cloth; none where it takes a part of one or sews it, or generates its mesh."""
    name = cloth["mesh"]
    cut = [key for key in ("group", "component", "vertices", "weld", "rest") if key in cloth]
    file = folder / str(name)
    if not isinstance(name, str) or cut or file.suffix.lower() != ".obj" or not file.is_file():
        return NO_ORIGINAL
    mesh = read_mesh(file)
    if len(mesh.positions) != vertices:
        return NO_ORIGINAL
    return original_of(file, mesh)


def fitted_text(original: Original, positions: Floats) -> str | None:
    """Text of `Original.moved_to`; None where there is no such file, or its rows do not fit the garment."""
    if not original.name or original.rows.max(initial=-1) >= len(positions):
        return None
    try:
        return original.moved_to(positions)
    except (InputError, ValueError, IndexError):  # a file that only the reader of triangles understands
        return None


@dataclass(frozen=True)
class Garment:
    """Garment: positions (n, 3) [m] on its source body; triangles (m, 3); notes: defaults used in reading.

    sewn: its panels were welded, so that three may meet in a seam; original: the file that it came in; division: pieces
    that follow it, or are stitched.
    """

    name: str
    positions: Floats
    triangles: Ints
    notes: tuple[str, ...] = ()
    sewn: bool = False
    original: Original = NO_ORIGINAL
    division: Division = UNDIVIDED


UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001}
SMALLEST, LARGEST = 0.5, 3.0
"""The largest extent of a body [m]: beyond, its file is in another unit."""
NEARLY = 0.7
"""Ratio of the extents in y and z from which the longer one need not be the height."""
FARTHEST = 1e6
"""No coordinate of a garment is larger [m]: distances to a body would lose all their digits, or overflow."""
ASIDE_DEGREES = 20.0
"""Angle from the usual direction up to which a body counts as facing it: feet turned out do not turn a garment."""
LONG = 0.5
"""Least extent of a body candidate as a fraction of the file's extent."""
CELL = 0.006
"""Cell of the lattice on which a body in pieces is wrapped, as a fraction of its largest extent: a centimetre."""


@dataclass(frozen=True)
class BodyMesh:
    """Body: positions (n, 3) [m], triangles (m, 3); scale [m per file unit]; notes: defaults used in reading.

    like: body whose landmarks it has, which are not looked for on its own surface, and whose vertices are the first of
    its own: the others are those of a wrap; None: its own.
    own_pose: this body before it was posed for sewing, from which landmarks, frame and limb names are taken; None: it
    is not posed.
    """

    name: str
    positions: Floats
    triangles: Ints
    scale: float
    notes: tuple[str, ...]
    like: "BodyMesh | None" = field(default=None, repr=False)
    own_pose: "BodyMesh | None" = field(default=None, repr=False)

    @property
    def closed(self) -> "BodyMesh":
        """What is registered, deflated and has the landmarks: itself, or one closed surface round its pieces."""
        return self._union[0]

    @property
    def fault(self) -> str:
        """Why its pieces make no standing body in one surface; empty where they do, or need not."""
        return self._union[1]

    @cached_property
    def _union(self) -> tuple["BodyMesh", str]:
        whole = is_closed(self.triangles)
        label = components(self.triangles, len(self.positions))[self.triangles[:, 0]]
        pieces, sizes = np.unique(label, return_counts=True)
        if whole and len(pieces) == 1:
            return self, ""
        largest = self.triangles[label == pieces[np.argmax(sizes)]]
        if len(pieces) > 1 and is_closed(largest) and stands(BodyMesh(self.name, self.positions, largest, 1.0, ())):
            return self, ""  # its eyes change none of its landmarks
        try:
            surface = known_surface(self.positions, self.triangles)
            cell = CELL * float(np.ptp(self.positions[self.triangles.ravel()], axis=0).max())
            made = BodyMesh(self.name, *union(surface, cell), self.scale, ())
            _ = made.parts
        except TransferError as error:
            return self, f"{self.name} in {len(pieces)} pieces: {error.sentence}"
        return made, ""

    @cached_property
    def parts(self) -> BodyParts:
        """Frame, trunk, arms and legs in its own pose. TransferError where it is not a standing body."""
        if self.own_pose is not None:
            return self.own_pose.parts
        like = self.closed if self.like is None else self.like
        if self.like is not None:
            nearest = nearest_facing_alike(*((each.positions, each.triangles) for each in (self, like)))
            return replace(like.parts, hands=like.parts.hands[:, nearest])
        if like is not self:  # its pieces may face inwards
            nearest = cKDTree(like.positions).query(self.positions)[1]
            return replace(like.parts, hands=like.parts.hands[:, nearest])
        return body_parts(self.positions, self.triangles)

    @cached_property
    def frame(self) -> BodyFrame:
        """Upright, front-facing frame. TransferError where it is not a standing body."""
        if self.own_pose is not None:  # pieces in a pose are not wrapped anew
            return self.own_pose.frame
        like = self.closed if self.like is None else self.like
        if like is not self:
            return like.frame
        try:
            return self.parts.frame
        except TransferError:
            return body_frame(self.positions, self.triangles)

    @cached_property
    def up(self) -> Floats:
        """Vertical axis, (3,): the one of y and z with legs below and a head above, else the longer one."""
        other = self.own_pose or self.like
        if other is not None:
            return other.up
        extent = np.ptp(self.positions, axis=0)
        if extent[1:].min() > NEARLY * extent[1:].max():  # arms held level, a body turned by 90 degrees
            scores = [legs_score(self.closed.positions, self.closed.triangles, axis) for axis in np.eye(3)[1:]]
            if scores[0] != scores[1]:
                return np.eye(3)[1 + int(np.argmax(scores))]
        return np.eye(3)[1 if extent[1] >= extent[2] else 2]

    @property
    def bare(self) -> "BodyMesh":
        """The body without the wrap of what it wears: hems may hang below its soles, and skirts reach past its arms."""
        return self if self.like is None else self.like

    @cached_property
    def floor(self) -> float:
        """Level of the lowest vertex of the bare body along `up` [m]."""
        return float((self.bare.positions @ self.up).min())

    @cached_property
    def height(self) -> float:
        """Extent of the bare body along `up` [m]."""
        return float(np.ptp(self.bare.positions @ self.up))

    @cached_property
    def middle(self) -> Floats:
        """Middle of the bounding box of the bare body, (3,) [m]."""
        positions = self.bare.positions
        return np.asarray((positions.min(axis=0) + positions.max(axis=0)) / 2, np.float64)

    @cached_property
    def front(self) -> Floats:
        """Unit direction that it faces, (3,): that of its feet where it is far from the usual one, else the usual."""
        other = self.own_pose or self.like
        if other is not None:
            return other.front
        usual = usual_front(self.up)
        try:
            front = body_frame(self.positions, self.triangles, self.up).front
        except TransferError:  # no feet to go by
            return usual
        return usual if front @ usual > np.cos(np.radians(ASIDE_DEGREES)) else np.asarray(front, np.float64)


def usual_front(up: Floats) -> Floats:
    """Direction that bodies of a vertical axis face, (3,): z where y is up, -y where z is."""
    return np.array([0.0, 0.0, 1.0]) if up[1] else np.array([0.0, -1.0, 0.0])


def stands(body: BodyMesh) -> bool:
    """True where a body has arms, legs and a head."""
    try:
        return bool(body.parts.landmarks)
    except TransferError:
        return False


BODY_FILE = "a mesh file, or a scene with a body, such as shirt (a mannequin)"
"""What the name of a body must be."""


def read_body_mesh(
    path: str | Path,
    *,
    scale: float | None = None,
    group: str | Sequence[str] | None = None,
    option: str = "--scale",
) -> BodyMesh:
    """The body in a file: its `group` or several, else its largest closed piece, else its largest; or that of a scene.

    Where that piece is not a standing body, but all pieces together are, as of a jointed figure, all of them.

    scale: metres per unit; None: what makes its largest extent that of a person. InputError where none does, with the
    option that gives it.
    """
    file: Path = example_file(path, what=BODY_FILE)
    if scale is not None:
        scale = as_positive("scale", scale)
    if file.suffix.lower() == ".toml":
        scene = load_scene(file)
        if not scene.bodies:
            raise InputError(f"{file} has no body.", "Name a mesh file, or a scene with a [body].")
        first, notes = body_mesh(scene)
        return _facing_outward(BodyMesh(first.name, first.positions, first.triangles, 1.0, notes))
    named = [group] if isinstance(group, str) else list(group or ())
    whole = read_mesh(file, parts=named)
    if named:
        return _in_metres(file, whole, scale, option)
    mesh, pieces = _largest_piece(file, whole)
    is_long = _extent(mesh) > LONG * _extent(whole)
    if is_long or pieces == 1:
        body = _in_metres(file, mesh, scale, option)
        if pieces == 1 or stands(body):
            return body
    fault = ""
    with suppress(InputError):  # pieces of a room, say, which is not a person in any unit
        together = _in_metres(file, whole, scale, option)
        fault = together.fault
        if together.closed is not together:
            note = f"{file.name}: none of its {pieces} pieces is a standing body alone: all together are"
            return replace(together, notes=(*together.notes, note))
    body = _in_metres(file, mesh, scale, option)
    return replace(body, notes=(*body.notes, fault)) if fault else body


ROUND_OFF = 1e-9
"""Volume of a body below which its sign is of round-off, as a fraction of that of all its tetrahedra."""


def _extent(mesh: MeshFile) -> float:
    """Largest extent of the triangles, in the mesh's units."""
    return float(np.ptp(mesh.positions[mesh.triangles.ravel()], axis=0).max())


def _in_metres(file: Path, mesh: MeshFile, scale: float | None, option: str) -> BodyMesh:
    factor, guess = scale, ""
    if factor is None:  # the unit that makes the extent that of a person
        extent = _extent(mesh)
        unit = next((name for name, size in UNITS.items() if SMALLEST <= size * extent <= LARGEST), None)
        if unit is None:
            raise InputError(
                f"{file} is {extent:.3g} units tall, which is a person's height in none of the units "
                f"{', '.join(UNITS)}.",
                f"Give its unit with {option} METRES_PER_UNIT, which may be anything.",
            )
        factor = UNITS[unit]
        guess = "" if unit == "m" else f"{extent:.3g} units tall: read as {unit} ({factor * extent:.3g} m)"
    notes = tuple(f"{file.name}: {note}" for note in (*mesh.messages, *([guess] if guess else [])))
    return _facing_outward(BodyMesh(file.name, factor * mesh.positions, mesh.triangles, factor, notes))


def as_body_mesh(body: Any) -> BodyMesh:
    """The body of a `clothsim.Body` or a mesh object, in metres. InputError for faults that no body may have."""
    made, notes = body_mesh(body if isinstance(body, Body) else Body(body))
    return _facing_outward(BodyMesh(made.name, made.positions, made.triangles, 1.0, notes))


def _facing_outward(body: BodyMesh) -> BodyMesh:
    """The body, with all triangles turned where it encloses a negative volume: they face inwards, as after mirroring.

    Not by pieces: of a body whose vertices are not welded they are open, and a hollow body has an inner surface.
    """
    corners = body.positions[body.triangles] - body.positions[body.triangles.ravel()].mean(axis=0)
    volumes = np.linalg.det(corners)
    if volumes.sum() >= -ROUND_OFF * np.abs(volumes).sum():
        return body
    note = f"{body.name}: its triangles face inwards: they are turned"
    return replace(body, triangles=body.triangles[:, ::-1].copy(), notes=(*body.notes, note))


def garment_of(cloth: Any, weld: float) -> Garment:
    """The garment of a `clothsim.Cloth` or a mesh object, in metres, as it lies on its body.

    weld: borders closer than that are sewn [m], in place of that of the cloth. InputError for a mesh that is not cloth.
    """
    given = cloth if isinstance(cloth, Cloth) else Cloth(cloth)
    made, notes = cloth_mesh(given, weld)
    sewn_already = bool(weld or given.weld or given.sewn)
    return Garment(made.name, made.positions, made.triangles, notes, sewn=sewn_already)


def read_garment(
    path: str | Path,
    made_for: str | Path | None,
    scale: float,
    *,
    part: tuple[int, int] | None = None,
    weld: float = 0.0,
    body: Floats | None = None,
) -> Garment:
    """The garment in a mesh file, or in MakeHuman clothes (.mhclo) on the base mesh `made_for`.

    scale: metres per unit; part: (lo, hi) vertices of the file; weld: borders closer than that are sewn [m];
    body: positions (k, 3) [m] of what it is worn by, from which a garment of inconsistent winding is turned away.
    InputError for a mesh that is not a cloth.
    """
    file = source = Path(path)
    if file.suffix.lower() == ".mhclo":
        if made_for is None:
            raise InputError(f"{file} lies on the base mesh of MakeHuman.", "Give the file of that body.")
        clothes = read_clothes(file)
        source = clothes.obj_file
        mesh = read_mesh(source)
        on_base = clothes.on(read_mesh(made_for).positions)
        if len(on_base) != len(mesh.positions):
            raise InputError(
                f"{file} places {len(on_base):,} vertices, {clothes.obj_file.name} has {len(mesh.positions):,}."
            )
        mesh = replace(mesh, positions=on_base)
    else:
        mesh = read_mesh(file, vertices=part)
    shape = worn_shape(file.name, scale * mesh.positions, mesh.triangles, mesh.messages, weld, body)
    farthest = float(np.abs(shape.positions).max())
    if farthest > FARTHEST:
        raise InputError(f"{file.name} has a vertex {farthest:.3g} m from the origin.", "Give its unit with --scale.")
    original = original_of(source, mesh, shape.sewn)
    every = len(np.unique(shape.triangles)) == len(shape.positions)
    division = divided(shape.positions, shape.triangles) if every else UNDIVIDED
    if division.embedded:
        shape = replace(shape, positions=shape.positions[division.vertices], triangles=division.triangles)
    warnings = refuse_unwearable(file.name, shape.positions, shape.triangles, sewn=bool(weld))
    remarks = (*shape.notes, *division.notes, *warnings)
    notes = tuple(f"{file.name}: {note}" for note in remarks)
    return Garment(file.name, shape.positions, shape.triangles, notes, bool(weld), original, division)


EFFECTS_OF_A_FIT = (
    *("inertia", "membrane", "bending", "gravity", "damping", "body_contact", "self_contact", "friction", "seams"),
)
"""Effects of a scene that a fit has too."""


def worn_in_scene(path: str | Path) -> tuple[Garment, BodyMesh]:
    """The first cloth of a scene in its initial positions, sewn and untangled per scene, and the first body.

    InputError for a scene without a body, or one that cannot be built.
    """
    file = Path(path)
    scene = load_scene(file)
    built = build(scene, affordable=True)
    if not built.world.bodies:
        raise InputError(f"{file} has no body.", "A scene to fit from holds the garment and the body that it lies on.")
    cloth, body = built.world.cloths[0], built.world.bodies[0]
    origin = built.world.origin
    several = ((len(built.world.cloths), "cloths"), (len(built.world.bodies), "bodies"))
    remarks = tuple(f"{file.name}: only the first of {count} {what} is fitted" for count, what in several if count > 1)
    left_out = [name for name in scene.effects if name not in EFFECTS_OF_A_FIT]
    if left_out:
        remarks += (f"{file.name}: a fit has effects of its own: {', '.join(left_out)} of the scene is left out",)
    original = original_of_scene(scene.cloths[0], scene.directory, len(cloth.positions))
    notes = (*built.notes, *remarks)
    garment = Garment(cloth.name, cloth.positions + origin, cloth.triangles, notes, sewn=True, original=original)
    return garment, _facing_outward(BodyMesh(body.name, body.positions + origin, body.triangles, 1.0, ()))


def _largest_piece(file: Path, mesh: MeshFile) -> tuple[MeshFile, int]:
    """Largest closed piece of a file, by number of vertices, that is as long as a body, and the number of pieces.

    Eyes are closed too. Where none is closed, the largest of the long ones; where none is long, of all.
    """
    label = components(mesh.triangles, len(mesh.positions))
    of_triangle = label[mesh.triangles[:, 0]]
    pieces = np.unique(of_triangle)
    sizes = np.bincount(label)[pieces]
    order = pieces[np.argsort(-sizes, kind="stable")]
    whole = np.ptp(mesh.positions[mesh.triangles.ravel()], axis=0).max()
    long = [piece for piece in order if np.ptp(mesh.positions[label == piece], axis=0).max() > LONG * whole]
    candidates = long or list(order)
    for piece in candidates:
        chosen = mesh.triangles[of_triangle == piece]
        if is_closed(chosen):
            return _only(mesh, chosen, f"the largest closed piece of {len(pieces)}", len(pieces)), len(pieces)
    chosen = mesh.triangles[of_triangle == candidates[0]]
    return _only(mesh, chosen, f"the largest piece of {len(pieces)}, which is not closed", 2), len(pieces)


def _only(mesh: MeshFile, triangles: Ints, what: str, pieces: int) -> MeshFile:
    used, renumbered = np.unique(triangles, return_inverse=True)
    remarks = (f"{what}: {len(used):,} of {len(mesh.positions):,} vertices",) if pieces > 1 else ()
    faces = renumbered.reshape(-1, 3).astype(np.int64)
    return MeshFile(mesh.positions[used], faces, np.zeros((0, 3, 2)), (*mesh.messages, *remarks))


def is_closed(triangles: Ints) -> bool:
    """True where each edge has exactly two triangles."""
    return bool((distinct_edges(half_edges(triangles))[2] == 2).all())
