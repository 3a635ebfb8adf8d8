"""Name, position and unit of a mesh: the keys that [cloth] and [[body]] share."""

from dataclasses import dataclass
from typing import Annotated, Literal

from clothsim.keys.key_table import KeyTable
from clothsim.keys.schema import Key, Vector


@dataclass(frozen=True, kw_only=True)
class PlacedKeys(KeyTable):
    """Name, position and unit of a mesh."""

    name: Annotated[str | None, Key("Name in messages, tables and the trajectory", shown="the section's")] = None
    position: Annotated[Vector, Key("Displacement from where the mesh is", "m", length=3)] = (0.0, 0.0, 0.0)
    rotation_degrees: Annotated[
        Vector, Key("Rotation about x, then y, then z, before the displacement", "degrees", length=3)
    ] = (0.0, 0.0, 0.0)
    scale: Annotated[float, Key("Metres per unit of the mesh", "m", above=0)] = 1.0
    up: Annotated[Literal["z", "y"], Key("Axis of the mesh that points up; y is turned onto z before the rotation")] = (
        "z"
    )
