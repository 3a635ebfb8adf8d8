"""The section [[rigid]]: a solid that forces move."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from clothsim.keys.effect_tables import SELECT
from clothsim.keys.key_table import KeyTable
from clothsim.keys.mesh_keys import MESH, section_of, sources
from clothsim.keys.placed_keys import PlacedKeys
from clothsim.keys.schema import Key, Selection, Vector


@dataclass(frozen=True, kw_only=True)
class JointKeys(KeyTable):
    """A joint of a rigid body to the world: a ball joint, or with an axis a hinge."""

    section: ClassVar[str] = "rigid.joint"

    point: Annotated[Vector, Key("Point that the body turns about, at the start", "m", length=3)]
    axis: Annotated[
        Vector | None, Key("Direction of the hinge", "1", length=3, shown="none, a ball joint")
    ] = None  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class TieKeys(KeyTable):
    """Cloth tied to a rigid body, as a button or a hanger is."""

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
        Vector, Key("Angular velocity at the start, along the axis of rotation", "degrees/s", length=3)
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
    """A rigid body that weight, contact and cloth move: a closed mesh, generated, of a file or in memory."""

    mesh: Annotated[str | Any, MESH]


def check_rigid(where: str, keys: Any) -> RigidTable:
    """The section of a table of a rigid body. InputError names a bad key."""
    return section_of(where, keys, rigid_sections)  # type: ignore[return-value]


def rigid_sections(where: str, keys: Mapping[str, Any]) -> tuple[type[KeyTable], ...]:
    """The sections whose keys a rigid body has: its own, and those of its generator or part of a file."""
    return (RigidTable, *sources(where, keys))
