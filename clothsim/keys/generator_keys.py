"""Keys of the generated meshes: shapes, sheets, the mannequin and its garments.

The generators of `mesh.generators`, which a scene need not import, are functions of these sections.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from clothsim.keys.key_table import KeyTable
from clothsim.keys.schema import Key


@dataclass(frozen=True, kw_only=True)
class Rectangle(KeyTable):
    """A flat rectangle in z = 0, centred on the origin."""

    section: ClassVar[str] = "rectangle"

    size: Annotated[Sequence[float], Key("Lengths along x and y", "m", above=0, length=2)] = (1.0, 1.0)
    cells: Annotated[Sequence[int], Key("Cells along x and y", "1", least=1, most=4096, length=2)] = (40, 40)
    diagonals: Annotated[
        Literal["right", "alternating", "crisscross", "delaunay"], Key("Pattern of the triangles in the cells")
    ] = "alternating"


@dataclass(frozen=True, kw_only=True)
class Disk(KeyTable):
    """A flat disk in z = 0."""

    section: ClassVar[str] = "disk"

    radius: Annotated[float, Key("Radius", "m", above=0)] = 0.5
    cells: Annotated[int, Key("Number of rings", "1", least=1, most=1024)] = 20


@dataclass(frozen=True, kw_only=True)
class Tube(KeyTable):
    """An open cylinder or cone along z."""

    section: ClassVar[str] = "tube"

    radius: Annotated[float, Key("Radius of the lower end", "m", above=0)] = 0.2
    height: Annotated[float, Key("Height", "m", above=0)] = 0.6
    cells: Annotated[Sequence[int], Key("Cells around and along", "1", least=1, most=4096, length=2)] = (48, 24)
    top_radius: Annotated[float | None, Key("Radius of the upper end", "m", above=0, shown="radius")] = None


@dataclass(frozen=True, kw_only=True)
class Pillow(KeyTable):
    """Two disks joined at their rim: a closed balloon without air."""

    section: ClassVar[str] = "pillow"

    radius: Annotated[float, Key("Radius", "m", above=0)] = 0.5
    cells: Annotated[int, Key("Number of rings", "1", least=1, most=1024)] = 20
    gap: Annotated[float, Key("Distance between the disks in the middle", "m", above=0)] = 0.002


@dataclass(frozen=True, kw_only=True)
class Sphere(KeyTable):
    """A subdivided icosahedron."""

    section: ClassVar[str] = "sphere"

    radius: Annotated[float, Key("Radius", "m", above=0)] = 0.3
    subdivisions: Annotated[
        int, Key("Number of times that each triangle is divided into four", "1", least=0, most=8)
    ] = 4


@dataclass(frozen=True, kw_only=True)
class Slab(KeyTable):
    """A closed box."""

    section: ClassVar[str] = "slab"

    size: Annotated[Sequence[float], Key("Lengths along x, y and z", "m", above=0, length=3)] = (1.0, 1.0, 0.1)
    cells: Annotated[Sequence[int], Key("Cells along x, y and z", "1", least=1, most=4096, length=3)] = (1, 1, 1)


@dataclass(frozen=True, kw_only=True)
class Capsule(KeyTable):
    """A cylinder along z with round ends."""

    section: ClassVar[str] = "capsule"

    radius: Annotated[float, Key("Radius", "m", above=0)] = 0.1
    height: Annotated[float, Key("Height from tip to tip", "m", above=0)] = 0.5
    segments: Annotated[int, Key("Edges around", "1", least=4, most=4096)] = 32


@dataclass(frozen=True, kw_only=True)
class Ring(KeyTable):
    """A ring of a round bar about z; with a stretch, the link of a chain."""

    section: ClassVar[str] = "ring"

    radius: Annotated[float, Key("Radius of the circle in the middle of the bar", "m", above=0)] = 0.05
    thickness: Annotated[float, Key("Diameter of the bar", "m", above=0)] = 0.02
    segments: Annotated[int, Key("Edges along the ring", "1", least=4, most=4096)] = 24
    around: Annotated[int, Key("Edges about the bar", "1", least=3, most=4096)] = 12
    stretch: Annotated[float, Key("Length by which its halves are pulled apart along x", "m", least=0)] = 0.0


@dataclass(frozen=True, kw_only=True)
class Cone(KeyTable):
    """A closed cone along z, tip up."""

    section: ClassVar[str] = "cone"

    radius: Annotated[float, Key("Radius of the base", "m", above=0)] = 0.1
    height: Annotated[float, Key("Height", "m", above=0)] = 0.3
    segments: Annotated[int, Key("Edges of the base", "1", least=3, most=4096)] = 32


@dataclass(frozen=True, kw_only=True)
class Proportions(KeyTable):
    """Height of the mannequin, and factors of the measures that it has at that height.

    A wider chest moves the shoulder joints out as well; longer legs shorten the trunk. Beyond the bounds the warped
    surface would fold.
    """

    section: ClassVar[str] = "mannequin"

    height: Annotated[float, Key("Height of the figure", "m", least=0.5, most=2.5)] = 1.7
    chest: Annotated[float, Key("Factor of the chest girth", "1", least=0.8, most=1.35)] = 1.0
    waist: Annotated[float, Key("Factor of the waist girth", "1", least=0.75, most=1.6)] = 1.0
    hips: Annotated[float, Key("Factor of the hip girth", "1", least=0.8, most=1.45)] = 1.0
    shoulder_width: Annotated[float, Key("Factor of the shoulder width", "1", least=0.95, most=1.15)] = 1.0
    limb_girth: Annotated[float, Key("Factor of the girths of arms and legs", "1", least=0.75, most=1.2)] = 1.0
    neck: Annotated[float, Key("Factor of the neck girth", "1", least=0.85, most=1.25)] = 1.0
    arm_girth: Annotated[
        float, Key("Factor of the girths of the upper arms, in addition to limb_girth", "1", least=0.8, most=1.3)
    ] = 1.0
    arm_length: Annotated[float, Key("Factor of the length from shoulder to wrist", "1", least=0.85, most=1.15)] = 1.0
    leg_length: Annotated[float, Key("Factor of the height of the crotch", "1", least=0.9, most=1.12)] = 1.0
    waist_height: Annotated[
        float, Key("Factor of the height of the waist, in addition to leg_length", "1", least=0.93, most=1.05)
    ] = 1.0
    thigh: Annotated[float, Key("Factor of the thigh girth, in addition to limb_girth", "1", least=0.85, most=1.2)] = (
        1.0
    )
    calf: Annotated[float, Key("Factor of the calf girth, in addition to limb_girth", "1", least=0.8, most=1.3)] = 1.0


@dataclass(frozen=True, kw_only=True)
class Mannequin(Proportions):
    """A closed human figure that stands on z = 0."""

    pose: Annotated[Literal["a", "t", "walk", "reach", "arms_down"], Key("Named pose")] = "a"
    joints_degrees: Annotated[
        Mapping[str, Any] | None,
        Key("Rotation vectors by joint, in place of those of the pose", "degrees", shown="none"),
    ] = None


@dataclass(frozen=True, kw_only=True)
class GarmentKeys(Proportions):
    """Ease and edge length of a garment for the mannequin of the same figure."""

    ease: Annotated[float, Key("Smallest distance from the body", "m", above=0)] = 0.008
    edge: Annotated[float, Key("Length of the edges", "m", least=0.006, most=0.04)] = 0.018


@dataclass(frozen=True, kw_only=True)
class Shirt(GarmentKeys):
    """A shirt with sleeves, also a jacket or a hoody."""

    section: ClassVar[str] = "shirt"

    ease: Annotated[float, Key("Smallest distance from the body", "m", above=0)] = 0.012
    sleeve: Annotated[
        float, Key("Length from shoulder joint to cuff, for a height of 1.7 m", "m", least=0.13, most=0.46)
    ] = 0.20
    opening: Annotated[float, Key("Width of the opening down the front; 0: closed", "m", least=0, most=0.2)] = 0.0
    hood: Annotated[bool, Key("Add a hood over the head")] = False


@dataclass(frozen=True, kw_only=True)
class Skirt(GarmentKeys):
    """A flared skirt."""

    section: ClassVar[str] = "skirt"

    hem: Annotated[
        float, Key("Height of the hem above the ground, for a height of 1.7 m", "m", least=0.15, most=0.75)
    ] = 0.50


@dataclass(frozen=True, kw_only=True)
class Trousers(GarmentKeys):
    """A pair of trousers."""

    section: ClassVar[str] = "trousers"

    hem: Annotated[
        float, Key("Height of the hem above the ground, for a height of 1.7 m", "m", least=0.10, most=0.60)
    ] = 0.12


GENERATOR_KEYS: dict[str, type[KeyTable]] = {
    kind.section: kind
    for kind in (
        Rectangle, Disk, Tube, Pillow, Sphere, Slab, Capsule, Cone, Ring, Mannequin, Shirt, Skirt, Trousers
    )
}  # fmt: skip
