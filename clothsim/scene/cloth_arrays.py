"""Cloths and bodies from arrays: `clothsim.Cloth`, `clothsim.Body` and `clothsim.Rigid`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from numpy.typing import ArrayLike

from clothsim.base.errors import InputError
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.keys.mesh_keys import BodyKeys, ClothKeys, FrameRate, RigidKeys
from clothsim.scene.mesh_objects import checked_mesh


class _Arrays:
    """Mixin that refuses a name in place of arrays before the keys are looked at."""

    def __new__(cls, *given: Any, **keys: Any) -> Any:
        """InputError for the name of a file or of a generator."""
        vertices = given[0] if given else keys.get("vertices")
        if isinstance(vertices, str | Path):
            name, table = cls.__name__, {"mesh": str(vertices), **keys}
            table.pop("vertices", None)
            raise InputError(
                f"clothsim.{name} takes arrays or a mesh object, not the name {str(vertices)!r}.",
                f"Write a table: {name.lower()}={table!r}.",
            )
        return super().__new__(cls, *given, **keys)


@dataclass(frozen=True, eq=False)
class Cloth(_Arrays, ClothKeys):
    """A cloth from arrays or a mesh object, with the keys of [cloth].

    Parameters
    ----------
    vertices : (n, 3) array_like [m], or mesh object
        Positions at the start, before `scale`, `rotation_degrees` and `position`; or a trimesh.Trimesh,
        pyvista.PolyData, meshio.Mesh or scikit-fem MeshTri.
    triangles : (m, 3) array_like, optional
        Vertex numbers; omitted if `vertices` is a mesh object.
    rest : (n, 2), (n, 3) or (m, 3, 2) array_like [m], optional
        Rest shape: coordinates in the material plane by vertex or by corner of a triangle, or positions in space.
        None: the vertices are the rest shape.
    groups : mapping of str to (k,) array_like, optional
        Triangles of each panel, none in two panels. `fabric_of` and values by panel refer to the names.
    fabric : str
        Named fabric; density and the other keys of a fabric override its values.

    Raises
    ------
    InputError
        For a wrong shape, a number that is not finite or an index out of range; the message names array and index.

    Examples
    --------
    >>> import clothsim
    >>> cloth = clothsim.Cloth([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], position=[0, 0, 0.5], density=0.2)
    >>> cloth.as_table()["mesh"]
    MeshArrays(3 vertices, 1 triangles)
    """

    section: ClassVar[str] = "cloth"

    vertices: ArrayLike | Any
    triangles: ArrayLike | None = None
    rest: ArrayLike | None = None
    groups: Mapping[str, ArrayLike] | None = None
    arrays: MeshArrays = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        made = checked_mesh(self.section, self.vertices, self.triangles, rest=self.rest, groups=self.groups)
        _keep(self, made, "rest", "groups")

    def as_table(self) -> dict[str, Any]:
        """The table of [cloth] with the arrays as its mesh."""
        return {"mesh": self.arrays, **super().as_table()}


@dataclass(frozen=True, eq=False)
class Body(_Arrays, BodyKeys, FrameRate):
    """A body from arrays or a mesh object, with the keys of [[body]].

    Parameters
    ----------
    vertices : (n, 3) array_like [m], or mesh object
        Positions at time 0, before `scale`, `rotation_degrees` and `position`; or a trimesh.Trimesh,
        pyvista.PolyData, meshio.Mesh or scikit-fem MeshTri.
    triangles : (m, 3) array_like, optional
        Vertex numbers; omitted if `vertices` is a mesh object.
    frames : (k, n, 3) array_like [m], optional
        Positions in each frame of an animation, in place of `vertices`; the first frame is at time 0.
    frames_per_second : float [1/s]
        Frame rate of `frames`.
    motion : Motion or dict, optional
        Rigid motion, in place of frames.

    Raises
    ------
    InputError
        For a wrong shape, a number that is not finite or an index out of range; the message names array and index.

    Examples
    --------
    >>> import clothsim
    >>> floor = clothsim.Body([[0, 0, 0], [9, 0, 0], [0, 9, 0]], [[0, 1, 2]], name="floor")
    >>> floor.as_table()["name"]
    'floor'
    """

    section: ClassVar[str] = "body"

    vertices: ArrayLike | Any
    triangles: ArrayLike | None = None
    frames: ArrayLike | None = None
    arrays: MeshArrays = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.frames is not None and self.motion is not None:
            raise InputError("body has frames and motion.", "Give motion or frames, not both.")
        _keep(self, checked_mesh(self.section, self.vertices, self.triangles, frames=self.frames), "frames")

    def as_table(self) -> dict[str, Any]:
        """The table of [[body]] with the arrays as its mesh."""
        return {"mesh": self.arrays, **super().as_table()}


@dataclass(frozen=True, eq=False)
class Rigid(_Arrays, RigidKeys):
    """A rigid body from arrays or a mesh object, with the keys of [[rigid]].

    Parameters
    ----------
    vertices : (n, 3) array_like [m], or mesh object
        Positions at the start, before `scale`, `rotation_degrees` and `position`, of a closed surface; or a
        trimesh.Trimesh, pyvista.PolyData, meshio.Mesh or scikit-fem MeshTri.
    triangles : (m, 3) array_like, optional
        Vertex numbers; omitted if `vertices` is a mesh object.
    density : float [kg/m3]
        Density of the solid inside.
    velocity, spin_degrees_per_second : (3,) array_like [m/s, degrees/s]
        At the start.
    joint : dict, optional
        `point`, and `axis` of a hinge.

    Raises
    ------
    InputError
        For a wrong shape, a number that is not finite or an index out of range; the message names array and index.

    Examples
    --------
    >>> import clothsim
    >>> tetrahedron = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    >>> clothsim.Rigid(*tetrahedron, density=600.0).as_table()["density"]
    600.0
    """

    section: ClassVar[str] = "rigid"

    vertices: ArrayLike | Any
    triangles: ArrayLike | None = None
    arrays: MeshArrays = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        _keep(self, checked_mesh(self.section, self.vertices, self.triangles))

    def as_table(self) -> dict[str, Any]:
        """The table of [[rigid]] with the arrays as its mesh."""
        return {"mesh": self.arrays, **super().as_table()}


def _keep(made: Any, arrays: MeshArrays, *others: str) -> None:
    """Set the read-only copies in place of what was given."""
    for field_name in ("vertices", "triangles", *others):
        object.__setattr__(made, field_name, getattr(arrays, field_name))
    object.__setattr__(made, "arrays", arrays)
