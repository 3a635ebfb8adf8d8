"""Numbers that may explain an edited clip: of fabrics, of forces, and lengths of the rest shape by panel.

Each is the logarithm of a factor, 0 where the scene is as it was. Lengths scale a panel about its centre: across
(width), along (height), and across at its lower end (hem), by factors that are linear in height between that end and
the upper one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.gradients.gradient import Gradient
from clothsim.gradients.parameters import RULED, value_at, with_value
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.mesh.cloth import Cloth
from clothsim.mesh.world import World
from clothsim.physics.energies.edge_curves import edge_curves
from clothsim.physics.energies.key_values import cloth_number, selected_vertices
from clothsim.physics.energies.seams import seam_line
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.scene import Scene

FORCES = {
    "friction": "effects.friction.coefficient",
    "pressure": "effects.pressure.value",
    "damping": "effects.damping.rate",
}
FABRIC = {"stretch": "youngs_modulus", "bending": "bending_stiffness"}
LENGTHS = ("width", "height", "hem")
MOST_PANELS = 4
"""Panels of a cloth above which all of them are scaled alike."""
FLAT = 1e-6
"""Thickness of a rest shape over its size below which it is a plane."""


@dataclass(frozen=True)
class Kind:
    """Of a number: what is known of its logarithm before, its differences, and its largest step and change."""

    prior: float
    step: float
    largest: float
    limit: float


OF_SCENE, OF_LENGTH = Kind(1.0, 0.1, 1.0, float(np.log(100.0))), Kind(0.05, 0.01, 0.1, float(np.log(1.5)))


@dataclass(frozen=True)
class ClipNumber:
    """A number of a clip.

    Attributes
    ----------
    name : str
        "stretch", "friction", "hem"; with the cloth or the panel behind a colon where there are several.
    kind : Kind
    paths : tuple of str
        Keys of the scene that are scaled by it; none for a length.
    cloth, panel : int
        Numbers of what has the length.
    """

    name: str
    kind: Kind
    paths: tuple[str, ...] = ()
    cloth: int = 0
    panel: int = 0


@dataclass(frozen=True, eq=False)
class RestPanel:
    """Part of a rest shape: its points among those of the shape (k,), their centre, and the axis of its height."""

    name: str
    rows: Ints
    centre: Floats
    axis: Floats

    def moved(self, points: Floats, width: float, height: float, hem: float) -> Floats:
        """The points (k, d) of the panel with the logarithms of its lengths."""
        along = (points - self.centre) @ self.axis
        across = points - self.centre - along[:, None] * self.axis
        below = (along.max() - along) / max(float(np.ptp(along)), 1e-300)
        scale = np.exp(width) * (1 + np.expm1(hem) * below)
        return np.asarray(self.centre + scale[:, None] * across + np.exp(height) * along[:, None] * self.axis)


@dataclass(frozen=True, eq=False)
class RestShape:
    """Rest shape of a cloth of arrays: its points, (n, 3) or (3 m, 2) [m], in panels.

    count : (p,) ndarray
        Number of panels that have a point; their displacements are averaged.
    """

    shape: tuple[int, ...]
    points: Floats
    panels: tuple[RestPanel, ...]
    count: Floats = field(repr=False)

    @classmethod
    def of(cls, cloth: Cloth, rest: Floats) -> "RestShape":
        """That of a cloth with rest positions (n, 3), or material coordinates (m, 3, 2) [m]."""
        points = rest.reshape(-1, rest.shape[-1])
        panels = []
        groups: Mapping[str, Ints] = cloth.groups or {cloth.name: np.arange(len(cloth.triangles))}
        if len(groups) > MOST_PANELS and rest.ndim == 2:
            groups = {cloth.name: np.arange(len(cloth.triangles))}
        for name, faces in groups.items():
            corners = (3 * np.asarray(faces)[:, None] + np.arange(3)).ravel()
            rows = corners if rest.ndim == 3 else np.unique(cloth.triangles.ravel()[corners])
            own = points[rows]
            panels.append(RestPanel(name, rows, 0.5 * (own.min(axis=0) + own.max(axis=0)), _axis(own)))
        count = np.bincount(np.concatenate([each.rows for each in panels]), minlength=len(points)).astype(np.float64)
        return cls(rest.shape, points, tuple(panels), np.maximum(count, 1.0)[:, None])

    @property
    def alike(self) -> bool:
        """True where all panels are scaled by the same lengths."""
        return len(self.panels) > MOST_PANELS

    def scaled(self, lengths: Floats) -> Floats:
        """The rest shape with logarithms (panels, 3) of its lengths."""
        moved = self.points.copy()
        for panel, own in zip(self.panels, lengths, strict=True):
            points = self.points[panel.rows]
            moved[panel.rows] += (panel.moved(points, *own) - points) / self.count[panel.rows]
        return moved.reshape(self.shape)


def _axis(points: Floats) -> Floats:
    """Unit vector of the height: y of a plane pattern; z of a shape in space; y of one that lies in a level plane."""
    if points.shape[1] == 2:
        return np.array([0.0, 1.0])
    _, sizes, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    up = np.array([0.0, 0.0, 1.0])
    if sizes[2] > FLAT * sizes[0]:
        return up
    normal = axes[2]
    if abs(normal[2]) > 0.99:
        up = np.array([0.0, 1.0, 0.0])
    along = up - (up @ normal) * normal
    return np.asarray(along / np.linalg.norm(along))


@dataclass(frozen=True, eq=False)
class ClipNumbers:
    """Numbers of a scene, and the scene at other values of them.

    Attributes
    ----------
    scene : Scene
        Its cloths given by arrays where lengths are among the numbers.
    numbers : tuple of ClipNumber
    values : mapping
        Number at each path of the scene.
    shapes : tuple of RestShape
        Of each cloth of arrays; empty where there is none.
    added : tuple of ndarray
        Displacements of each rest shape beside its lengths [m].
    """

    scene: Scene
    numbers: tuple[ClipNumber, ...]
    values: Mapping[str, float]
    shapes: tuple[RestShape, ...]
    added: tuple[Floats, ...]

    @property
    def directions(self) -> list[Floats]:
        """What alone may explain an edit: each number, and all stiffnesses of a fabric together; (k,) each."""
        units = list(np.eye(len(self.numbers)))
        stiff = [name.partition(":") for name in self.names]
        for cloth in dict.fromkeys(cloth for name, _, cloth in stiff if name in FABRIC):
            both = np.array([float(name in FABRIC and own == cloth) for name, _, own in stiff])
            units += [both] if both.sum() > 1 else []
        return units

    @property
    def names(self) -> tuple[str, ...]:
        """Of the numbers."""
        return tuple(each.name for each in self.numbers)

    def of_kind(self, what: str) -> Floats:
        """A field of `Kind` for each number, (k,)."""
        return np.array([getattr(each.kind, what) for each in self.numbers])

    def rests(self, at: Floats) -> list[Floats]:
        """Rest shapes at logarithms (k,) of the factors."""
        return [
            shape.scaled(self._lengths(k, at)) + more.reshape(shape.shape)
            for k, (shape, more) in enumerate(zip(self.shapes, self.added, strict=True))
        ]

    def scene_at(self, at: Floats) -> Scene:
        """The scene at logarithms (k,) of the factors."""
        scene = self.scene
        for number, q in zip(self.numbers, at, strict=True):
            for path in number.paths if q else ():
                scene = with_value(scene, path, np.array(self.values[path] * np.exp(q)))
        if not self.shapes:
            return scene
        tables: list[Any] = list(scene.cloths)
        for k, rest in enumerate(self.rests(at)):
            arrays: MeshArrays = tables[k].mesh
            tables[k] = {**tables[k], "mesh": replace(arrays, rest=rest / tables[k].scale)}
        changed: dict[str, Any] = {"cloth": tables}
        return replace(scene, **changed)

    def derivatives(self, gradient: Gradient, at: Floats) -> Floats:
        """Derivatives (k,) of a loss by the logarithms of the factors, by the adjoint of its run."""
        return np.array([self._derivative(gradient, at, k) for k in range(len(at))])

    def _derivative(self, gradient: Gradient, at: Floats, k: int) -> float:
        number = self.numbers[k]
        if number.paths:
            return sum(float(gradient[path]) * self.values[path] * float(np.exp(at[k])) for path in number.paths)
        aside = 1e-4 * np.eye(len(at))[k]
        ahead, behind = (self.rests(at + sign * aside)[number.cloth] for sign in (1, -1))
        name = self.scene.cloths[number.cloth].name or "cloth"
        return gradient.rest_along((ahead - behind) / 2e-4, name)

    def _lengths(self, cloth: int, at: Floats) -> Floats:
        out = np.zeros((len(self.shapes[cloth].panels), len(LENGTHS)))
        for number, q in zip(self.numbers, at, strict=True):
            if not number.paths and number.cloth == cloth:
                rows = slice(None) if self.shapes[cloth].alike else number.panel
                out[rows, LENGTHS.index(number.name.partition(":")[0])] = q
        return out


def clip_numbers(scene: Scene, free: Sequence[str] = ()) -> ClipNumbers:
    """The numbers of a scene.

    Parameters
    ----------
    scene : Scene
        Lengths are found of cloths of arrays.
    free : sequence of str
        Names of some, as "stretch" or "hem:shirt.front"; a name without a colon is that of all. Empty: every one.

    Raises
    ------
    InputError
        For a name of none.

    Examples
    --------
    >>> import clothsim
    >>> sheet = clothsim.Cloth([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], rest=[[0, 0], [1, 0], [0, 1]])
    >>> scene = clothsim.Scene(sheet, effects={"membrane": {}, "friction": {}, "body_contact": {}})
    >>> clip_numbers(scene).names
    ('stretch', 'friction', 'width', 'height', 'hem')
    """
    world = world_of(scene)
    found, values = _of_scene(scene, world)
    shapes: tuple[RestShape, ...] = ()
    meshes = [keys.mesh for keys in scene.cloths]
    of_arrays = all(isinstance(mesh, MeshArrays) for mesh in meshes) and not scene.rods
    if of_arrays and "membrane" in scene.effects:
        rests = [each.material_coordinates if each.flat else each.rest_positions for each in world.cloths]
        shapes = tuple(RestShape.of(cloth, rest) for cloth, rest in zip(world.cloths, rests, strict=True))
        for k, (cloth, shape) in enumerate(zip(world.cloths, shapes, strict=True)):
            panels = shape.panels[:1] if shape.alike else shape.panels
            for number, panel in enumerate(panels):
                parts = [cloth.name] if len(shapes) > 1 else []
                parts += [panel.name] if len(panels) > 1 else []
                suffix = ":" + ".".join(parts) if parts else ""
                found += [ClipNumber(name + suffix, OF_LENGTH, (), k, number) for name in LENGTHS]
    unknown = [name for name in free if not any(_names(name, each.name) for each in found)]
    if unknown:
        known = ", ".join(dict.fromkeys(each.name for each in found))
        raise InputError(f"The clip has no number {unknown[0]!r}.", f"Known: {known}.")
    chosen = tuple(each for each in found if not free or any(_names(name, each.name) for name in free))
    if not chosen:
        raise InputError("No parameter of the scene can explain an edit.", "Give it a membrane, bending or friction.")
    added = tuple(np.zeros(shape.shape) for shape in shapes)
    return ClipNumbers(_with_vertices_by_number(scene, world) if shapes else scene, chosen, values, shapes, added)


POINTS = {"pins": ("group",), "springs": ("spring",)}
CURVES = {"elastic_bands": ("band",), "cords": ("cord",), "stiffeners": ("stiffener",)}
JOINED = {"seams": ("seam",), "closures": ("zip", "buttons")}
"""Tables of effects that select vertices, lines of edges, and two lines."""


def _with_vertices_by_number(scene: Scene, world: World) -> Scene:
    """The scene that selects by vertex numbers: sides of a sheet are found on its rest shape, which changes."""
    effects: dict[str, Any] = dict(scene.effects)
    for kinds, by_number in ((POINTS, _points), (CURVES, _curves), (JOINED, _joined)):
        for name in kinds.keys() & effects.keys():
            keys = effects[name]
            for kind in kinds[name]:
                tables = getattr(keys, kind)
                where = f"effects.{name}.{kind}"
                made = [one for k, each in enumerate(tables) for one in by_number(f"{where}[{k}]", each, world)]
                keys = keys.with_keys(**{kind: made}) if made else keys
            if "select" in keys.given:
                (keys,) = _points(f"effects.{name}", keys, world)
            effects[name] = keys
    return replace(scene, effects=effects)


def _points(where: str, keys: Any, world: World) -> list[Any]:
    return [keys.with_keys(select=selected_vertices(f"{where}.select", world, keys.select).tolist())]


def _curves(where: str, keys: Any, world: World) -> list[Any]:
    """A table for each connected line."""
    return [
        keys.with_keys(select=each.vertices.tolist()) for each in edge_curves(f"{where}.select", world, keys.select)
    ]


def _joined(where: str, keys: Any, world: World) -> list[Any]:
    ends = {}
    for name in ("from_", "to"):
        line, key = getattr(keys, name), f"{where}.{name.rstrip('_')}"
        if line.side is not None or line.through:
            number = cloth_number(key, world, line.cloth)
            rows = seam_line(key, world, line, 1).vertices - world.cloth_slices[number].start
            ends[name] = {"cloth": world.cloths[number].name, "vertices": rows.tolist()}
    return [keys.with_keys(**ends)]


def _names(given: str, name: str) -> bool:
    return given in (name, name.partition(":")[0])


def _of_scene(scene: Scene, world: World) -> tuple[list[ClipNumber], dict[str, float]]:
    """Stiffnesses by cloth, friction, pressure and damping: those that are positive numbers and act."""
    candidates, sheets = [], world.cloths[: len(scene.cloths)]  # rods are behind them
    for k, cloth in enumerate(sheets):
        where, suffix = (f"cloth[{k}]", f":{cloth.name}") if len(sheets) > 1 else ("cloth", "")
        for name, key in FABRIC.items():
            if {"stretch": "membrane"}.get(name, name) in scene.effects:
                own = [each for each in RULED[key] if getattr(cloth.fabric, each) is not None] or [key]
                candidates.append((name + suffix, [f"{where}.{each}" for each in own]))
    for name, path in FORCES.items():
        if path.split(".")[1] in scene.effects:
            candidates.append((name, [path]))
    found, values = [], dict[str, float]()
    for name, paths in candidates:
        numbers = {path: _number(scene, world, path) for path in paths}
        acting = {path: value for path, value in numbers.items() if value != 0}
        if acting:
            found.append(ClipNumber(name, OF_SCENE, tuple(acting)))
            values |= acting
    return found, values


def _number(scene: Scene, world: World, path: str) -> float:
    """The number at a path; 0 where there is none, or one over time or by cloth."""
    try:
        value = value_at(scene, world, path)
    except InputError:
        return 0.0
    return 0.0 if value.shape else float(value)
