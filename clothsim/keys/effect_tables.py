"""Nested tables of effects: motions, selections, springs, seams, closures, creases and winds."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

from clothsim.keys.key_table import KeyTable
from clothsim.keys.schema import Key, OverTime, Selection, Table, Vector

SELECT = Key("Vertices by side, by number or in a box at the start [m]")
CURVE = Key("A line of edges: a side, a box at the start [m], an edge or label of a pattern, or numbers in order")
CLOTH = Key("Name of the cloth, if there are several", shown="the only one")


@dataclass(frozen=True, kw_only=True)
class Motion(KeyTable):
    """Rigid motion: a constant velocity and a constant rotation about an axis through a centre."""

    section: ClassVar[str] = "motion"

    velocity: Annotated[Vector, Key("Velocity", "m/s", length=3)] = (0.0, 0.0, 0.0)
    rotate_degrees_per_second: Annotated[
        Vector, Key("Angular velocity, as a vector along the axis of rotation", "degrees/s", length=3)
    ] = (0.0, 0.0, 0.0)
    centre: Annotated[
        Vector | None, Key("Point on the axis of rotation", "m", length=3, shown="the object's own position")
    ] = None


@dataclass(frozen=True, kw_only=True)
class PinGroup(KeyTable):
    """A group of pins with a motion of its own: [[effects.pins.group]]."""

    section: ClassVar[str] = "effects.pins.group"

    select: Annotated[Selection, SELECT]
    clamp: Annotated[bool, Key("Also hold the direction of the cloth at the pinned edge")] = False
    motion: Annotated[Motion | Table | None, Key("Rigid motion of the group", tables=(Motion,), shown="none")] = None


@dataclass(frozen=True, kw_only=True)
class Spring(KeyTable):
    """Springs that tie vertices to points: [[effects.springs.spring]]."""

    section: ClassVar[str] = "effects.springs.spring"

    select: Annotated[Selection, SELECT]
    stiffness: Annotated[OverTime, Key("Stiffness of each vertex's spring", "N/m", least=0)]
    to: Annotated[Vector | None, Key("One point for all springs", "m", length=3, shown="see offset")] = None
    offset: Annotated[
        Vector, Key("Displacement from the start of each vertex to the point of its spring", "m", length=3)
    ] = (0.0, 0.0, 0.0)
    rest_length: Annotated[float | None, Key("Rest length", "m", least=0, shown="as at the start")] = None
    slack: Annotated[bool, Key("A tether: no force while it is shorter than its rest length")] = False
    motion: Annotated[Motion | Table | None, Key("Rigid motion of the points", tables=(Motion,), shown="none")] = None
    path: Annotated[
        Sequence[Sequence[float]], Key("Key frames [[time, dx, dy, dz], ...] of a displacement of the points", "s, m")
    ] = ()


@dataclass(frozen=True, kw_only=True)
class Band(KeyTable):
    """An elastic band along edges of the cloth: [[effects.elastic_bands.band]]."""

    section: ClassVar[str] = "effects.elastic_bands.band"

    select: Annotated[Selection, CURVE]
    stiffness: Annotated[OverTime, Key("Force that doubles the length of the band", "N", least=0)]
    length_ratio: Annotated[OverTime, Key("Length of the band at rest over that of the cloth", "1", least=0.05)] = 1.0


@dataclass(frozen=True, kw_only=True)
class Cord(KeyTable):
    """A cord that slides through edges of the cloth: [[effects.cords.cord]]."""

    section: ClassVar[str] = "effects.cords.cord"

    select: Annotated[Selection, CURVE]
    stiffness: Annotated[OverTime, Key("Force that doubles the length of the cord", "N", least=0)]
    length_ratio: Annotated[OverTime, Key("Length of the cord over that of its line at rest", "1", least=0.01)] = 1.0


@dataclass(frozen=True, kw_only=True)
class Stiffener(KeyTable):
    """A rod, straight at rest, sewn along edges of the cloth: [[effects.stiffeners.stiffener]]."""

    section: ClassVar[str] = "effects.stiffeners.stiffener"

    select: Annotated[Selection, CURVE]
    bending_stiffness: Annotated[float, Key("EI of the rod", "N m2", least=0)]
    stretch_stiffness: Annotated[float, Key("EA of the rod: the force that doubles its length", "N", least=0)] = 0.0


@dataclass(frozen=True, kw_only=True)
class SeamLine(KeyTable):
    """A line of border vertices that a seam joins: by side, along points or by vertex numbers."""

    section: ClassVar[str] = "effects.seams.seam.from"

    cloth: Annotated[str | None, CLOTH] = None
    side: Annotated[
        Literal["left", "right", "top", "bottom"] | None,
        Key("A side of the cloth; left and right run upwards, bottom and top to the right", shown="none"),
    ] = None
    through: Annotated[
        Sequence[Sequence[float]], Key("Points [[x, y, z], ...] along the border of the mesh before it is placed", "m")
    ] = ()
    vertices: Annotated[Sequence[int], Key("Vertex numbers in order", "1")] = ()
    panel: Annotated[str | None, Key("A panel of a sewing pattern, with `edge`", shown="none")] = None
    edge: Annotated[
        int | None, Key("Number of the edge of the panel as meshed, from 0", "1", least=0, shown="none")
    ] = None
    nearest: Annotated[
        bool, Key("Only in `to`: the edge of another piece that is nearest to each vertex of `from` at rest")
    ] = False  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Seam(KeyTable):
    """A seam between two borders: [[effects.seams.seam]]."""

    section: ClassVar[str] = "effects.seams.seam"

    from_: Annotated[SeamLine | Table, Key("First border", tables=(SeamLine,))]
    to: Annotated[SeamLine | Table, Key("Second border", tables=(SeamLine,))]
    start: Annotated[float, Key("Time at which the seam starts to close", "s", least=0)] = 0.0
    end: Annotated[float, Key("Time at which it is closed", "s", least=0)] = 1.0
    stiffness: Annotated[
        float | None, Key("Stiffness of a stitch", "N/m", above=0, shown="100 times the fabric's")
    ] = None  # fmt: skip
    flip: Annotated[bool, Key("Reverse the order of the second border")] = False
    match: Annotated[
        Literal["length", "vertices"], Key("Borders meet at equal fractions of their lengths, or vertex by vertex")
    ] = "length"  # fmt: skip
    bends: Annotated[bool, Key("The closed seam bends as the cloth does; false: it folds freely")] = True


@dataclass(frozen=True, kw_only=True)
class Zip(KeyTable):
    """Two borders that are closed and opened over time, and never sewn: [[effects.closures.zip]]."""

    section: ClassVar[str] = "effects.closures.zip"

    from_: Annotated[
        SeamLine | Table, Key("First border, from the end at which it begins to close", tables=(SeamLine,))
    ]
    to: Annotated[SeamLine | Table, Key("Second border", tables=(SeamLine,))]
    flip: Annotated[bool, Key("Reverse the order of the second border")] = False
    closed: Annotated[OverTime, Key("Closed fraction of the border", "1", least=0, most=1)] = 1.0
    gap: Annotated[
        OverTime, Key("Distance between the closed borders; self_contact adds the gap of zero force", "m", least=0)
    ] = 0.0  # fmt: skip
    stiffness: Annotated[
        OverTime | None, Key("Stiffness of each stitch", "N/m", least=0, shown="100 times the fabric's")
    ] = None  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Buttons(Zip):
    """A row of buttons that are done up one after another: [[effects.closures.buttons]]."""

    section: ClassVar[str] = "effects.closures.buttons"

    count: Annotated[int, Key("Number of buttons, evenly spaced from end to end", "1", least=1, most=1000)] = 5


@dataclass(frozen=True, kw_only=True)
class PatternSeams(KeyTable):
    """Settings for all seams of sewing patterns that are open as placed: effects.seams.pattern."""

    section: ClassVar[str] = "effects.seams.pattern"

    start: Annotated[float, Key("Time at which the seams start to close", "s", least=0)] = 0.0
    end: Annotated[float, Key("Time at which they are closed", "s", least=0)] = 1.0
    stiffness: Annotated[
        float | None, Key("Stiffness of a stitch", "N/m", above=0, shown="100 times the fabric's")
    ] = None  # fmt: skip
    bends: Annotated[bool, Key("The closed seams bend as the cloth does; false: they fold freely")] = True


@dataclass(frozen=True, kw_only=True)
class Crease(KeyTable):
    """A line of hinges with a rest angle: [[effects.rest_angle.crease]]."""

    section: ClassVar[str] = "effects.rest_angle.crease"

    angle_degrees: Annotated[OverTime, Key("Rest angle; 0 is flat, positive folds to the back", "degrees")]
    through: Annotated[
        Sequence[Sequence[float]], Key("Points [[x, y, z], ...] on the mesh before it is placed", "m")
    ] = ()
    vertices: Annotated[Sequence[int], Key("Vertex numbers: all inner edges with both ends among them", "1")] = ()
    panel: Annotated[str | None, Key("A panel of a sewing pattern, with `edge`", shown="none")] = None
    edge: Annotated[
        int | None, Key("Number of the welded edge of the panel as meshed, from 0", "1", least=0, shown="none")
    ] = None  # fmt: skip
    label: Annotated[str | None, Key("All welded edges of a sewing pattern with this label", shown="none")] = None
    cloth: Annotated[str | None, CLOTH] = None


@dataclass(frozen=True, kw_only=True)
class Gust(KeyTable):
    """A wind whose strength and direction vary: effects.air.wind with kind = "gust"."""

    section: ClassVar[str] = "effects.air.wind"

    kind: Annotated[Literal["gust"], Key("Kind of wind")] = field(default="gust", init=False)
    velocity: Annotated[Vector, Key("Mean velocity", "m/s", length=3)]
    amplitude: Annotated[float, Key("Relative amplitude of the speed", "1", least=0)] = 0.5
    period: Annotated[float, Key("Period of the gusts", "s", above=0)] = 1.0
    sway_degrees: Annotated[float, Key("Largest change of direction", "degrees", least=0)] = 0.0


@dataclass(frozen=True, kw_only=True)
class Vortex(KeyTable):
    """Air that turns about a line: effects.air.wind with kind = "vortex"."""

    section: ClassVar[str] = "effects.air.wind"

    kind: Annotated[Literal["vortex"], Key("Kind of wind")] = field(default="vortex", init=False)
    circulation: Annotated[float, Key("Circulation", "m2/s")]
    core: Annotated[float, Key("Radius at which the velocity is largest", "m", above=0)]
    centre: Annotated[Vector, Key("Point on the line", "m", length=3)] = (0, 0, 0)
    axis: Annotated[Vector, Key("Direction of the line", "1", length=3)] = (0.0, 0.0, 1.0)
    velocity: Annotated[Vector, Key("Wind that advects the vortex", "m/s", length=3)] = (0, 0, 0)
