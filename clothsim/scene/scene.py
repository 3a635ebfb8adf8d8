"""Scene: the data of a simulation, checked when it is made."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
import tomli_w

from clothsim.base.errors import InputError
from clothsim.base.inputs import as_table, shown
from clothsim.keys.key_table import FrozenTable, KeyTable, frozen
from clothsim.keys.mesh_arrays import TEXT, MeshArrays
from clothsim.keys.mesh_keys import (
    BodyTable,
    ClothTable,
    FramesTable,
    ModelTable,
    RigidTable,
    RodTable,
    check_body,
    check_cloth,
    check_rigid,
    check_rod,
)
from clothsim.keys.schema import FUNCTION
from clothsim.keys.section_hints import effect_remedy, section_remedy
from clothsim.keys.settings import Contact, RunSettings, Seed, Solver
from clothsim.keys.typed_effects import EffectKeys, effects_by_name
from clothsim.keys.value_checks import refuse_deep, refuse_unknown_key
from clothsim.scene.cloth_arrays import Body, Cloth, Rigid
from clothsim.scene.effects import EFFECTS
from clothsim.scene.mesh_objects import is_mesh, mesh_arrays
from clothsim.scene.named_keys import named_keys

Table = Mapping[str, Any]
BodyKind = BodyTable | FramesTable | ModelTable


@dataclass(frozen=True, init=False, eq=False)
class Scene:
    """The data of a simulation, with the same names as in a scene file.

    Parameters
    ----------
    cloth : dict, Cloth, mesh object, or a list of them
        Keys of [cloth].
    body : dict, Body, mesh object, or a list of them
        Keys of [[body]].
    rigid : dict, Rigid, mesh object, or a list of them
        Keys of [[rigid]].
    rod : dict, or a list of them
        Keys of [[rod]].
    effects : dict or list of effects
        {name: {key: value}}, or typed effects.
    solver, contact, run, seed : dict or Solver, Contact, RunSettings, Seed
        Keys of the sections of these names.
    directory : path
        Folder that relative file names start from.

    Attributes
    ----------
    cloth, body, rigid, rod, effects[...], solver, contact, run, seed
        Sections. Each key is an attribute, with its default if it was not given. As a mapping, a section has only the
        given keys.
    cloths, bodies, rigid_bodies, rods
        All sections of each kind, even if there is only one.

    Raises
    ------
    InputError
        For an unknown key, with the nearest known one, and for a value of another type or out of range.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.Scene(
    ...     cloth={"mesh": "rectangle", "cells": [8, 8]},
    ...     effects=[clothsim.Inertia(), clothsim.Membrane(), clothsim.Gravity()],
    ...     run=clothsim.RunSettings(duration=0.1),
    ... )
    >>> scene.effects
    {'inertia': Inertia(), 'membrane': Membrane(), 'gravity': Gravity()}
    >>> scene.effects["gravity"].acceleration, scene.cloth.size, scene.solver.dt
    ((0.0, 0.0, -9.81), (1.0, 1.0), 0.01)
    """

    # Any: type checkers let `dataclasses.replace` take tables for them; `cloths`, `solver_settings` ... have the types.
    cloth: Any
    body: Any
    effects: Mapping[str, Any]
    solver: Any
    contact: Any
    run: Any
    seed: Any
    directory: Path
    rigid: Any
    rod: Any

    def __new__(cls, *_: Any, **sections: Any) -> Self:
        """InputError for a keyword that is not a section, in place of Python's TypeError."""
        refuse_unknown_key("clothsim.Scene", sections, (*SECTIONS, "directory"))
        return super().__new__(cls)

    def __init__(
        self,
        cloth: Table | Cloth | Any = (),
        body: Table | Body | Any = (),
        effects: Mapping[str, Any] | Iterable[EffectKeys] = (),
        solver: Table | Solver | None = None,
        contact: Table | Contact | None = None,
        run: Table | RunSettings | None = None,
        seed: Table | Seed | None = None,
        directory: Path = Path(),
        rigid: Table | Sequence[Table] = (),
        rod: Table | Sequence[Table] = (),
    ) -> None:
        objects = {"cloth": cloth, "body": body, "rigid": rigid, "rod": rod}
        for name, value in (*objects.items(), ("effects", effects)):
            refuse_deep(name, value)
        named = effects_by_name(effects)
        refuse_unknown_key("effects", as_table("effects", named, "Write [effects.gravity]."), EFFECTS)
        built: dict[str, EffectKeys] = {}
        for name, keys in named.items():
            table = as_table(f"effects.{name}", keys, effect_remedy(name))
            built[name] = EFFECTS[name].keys_class.parsed(f"effects.{name}", table)
        made: dict[str, Any] = {"effects": FrozenTable(built)}
        settings: dict[str, tuple[type[KeyTable], Any]] = {
            "solver": (Solver, solver),
            "run": (RunSettings, run),
            "seed": (Seed, seed),
            "contact": (Contact, contact),
        }
        for name, (kind, value) in settings.items():
            refuse_deep(name, value)
            made[name] = kind.parsed(name, {} if value is None else value)
        for name, value in objects.items():
            made[name] = _sections(name, value)
        for name, value in {**made, "directory": directory}.items():
            object.__setattr__(self, name, value)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self._content == other._content

    def __hash__(self) -> int:
        return hash(self._content)

    @property
    def _content(self) -> tuple[Any, ...]:
        settings = (self.solver, self.contact, self.run, self.seed)
        directory = Path(self.directory).resolve()
        return (self.cloths, self.bodies, self.rigid_bodies, self.rods, self.effects, *settings, directory)

    def __reduce__(self) -> tuple[Any, ...]:
        tables = {name: _tables(getattr(self, name)) for name in SECTIONS}
        return partial(Scene, **tables, directory=self.directory), ()

    @property
    def cloths(self) -> tuple[ClothTable, ...]:
        """The cloths."""
        return _several(self.cloth)

    @property
    def bodies(self) -> tuple[BodyKind, ...]:
        """The bodies."""
        return _several(self.body)

    @property
    def file_names(self) -> tuple[str, ...]:
        """Names of the files of the scene, as given; for an animation, the pattern."""
        data = json.loads(self.to_text(names_of_functions=True))
        return tuple(str(table[key]) for _, table, key in named_keys(data))

    @property
    def files(self) -> tuple[Path, ...]:
        """Paths of the files of the scene."""
        return tuple(self.directory / name for name in self.file_names)

    @property
    def rigid_bodies(self) -> tuple[RigidTable, ...]:
        """The rigid bodies."""
        return _several(self.rigid)

    @property
    def rods(self) -> tuple[RodTable, ...]:
        """The rods."""
        return _several(self.rod)

    @property
    def solver_settings(self) -> Solver:
        """[solver]."""
        return self.solver

    @property
    def run_settings(self) -> RunSettings:
        """[run]."""
        return self.run

    @property
    def seed_settings(self) -> Seed:
        """[seed]."""
        return self.seed

    @property
    def contact_settings(self) -> Contact:
        """[contact]."""
        return self.contact

    def refuse_without_cloth(self, what: str) -> None:
        """Raise an InputError for a scene of rigid bodies alone, if `what` is a measure of cloth."""
        if not self.cloths:
            raise InputError(f"The scene has no cloth, and {what} needs one.", "Add a [cloth], or leave it out.")

    @property
    def up(self) -> tuple[float, ...]:
        """Unit vector against gravity; z if there is none."""
        acceleration = np.array(self.effects["gravity"].acceleration if "gravity" in self.effects else (), np.float64)
        length = float(np.linalg.norm(acceleration))
        return tuple((-acceleration / length).tolist()) if length else (0.0, 0.0, 1.0)

    @staticmethod
    def from_text(text: str, here: Path = Path()) -> "Scene":
        """The scene that `to_text` wrote. A relative directory, as in an archive, starts at `here`.

        Raises
        ------
        InputError
            If the text is not that of a scene.
        """
        return scene_from_text(text, here)

    def to_text(self, names_of_functions: bool = False, here: Path | None = None) -> str:
        """The scene as JSON text, which `from_text` reads back. The text contains meshes in memory.

        Parameters
        ----------
        names_of_functions : bool
            True: write only the name of a Python function, for the record of a run. A scene that is read back has lost
            the function, and says so when its effect is built.
        here : Path, optional
            Folder of the text. A scene whose file names start there can be moved with it.

        Raises
        ------
        InputError
            For a scene with a Python function, if only its name could be written.
        """
        sections = {
            name: getattr(self, name) for name in SECTIONS if name not in ("rigid", "rod") or getattr(self, name)
        }
        if not names_of_functions:
            for name, section in sections.items():
                _refuse_functions(name, section)
        directory = Path(self.directory).resolve()
        moves = here is not None and here.resolve() == directory
        return json.dumps({**sections, "directory": "." if moves else str(directory)}, default=_plain)

    def to_toml(self) -> str:
        """The text of a scene file in `directory`, which `load_scene` reads back as the same scene.

        For a file elsewhere: `scene.starting_at(folder).to_toml()`. Meshes in memory are in the text.

        Raises
        ------
        InputError
            For a scene with a Python function.

        Examples
        --------
        >>> import clothsim
        >>> scene = clothsim.Scene(cloth={"mesh": "rectangle", "cells": [4, 4]}, effects=[clothsim.Gravity()])
        >>> "[effects.gravity]" in scene.to_toml()
        True
        """
        sections = json.loads(self.to_text())
        return tomli_w.dumps({name: _without_none(keys) for name, keys in sections.items() if name != "directory"})

    def starting_at(self, directory: Path) -> "Scene":
        """The scene with file names that start at another folder; the files themselves are the same.

        Raises
        ------
        InputError
            For a scene with a Python function.
        """
        data = json.loads(self.to_text())
        for _, keys, key in named_keys(data):
            keys[key] = str((self.directory / keys[key]).resolve())
        return scene_from_text(json.dumps({**data, "directory": "."}), directory)


SECTIONS = ("cloth", "body", "rigid", "rod", "effects", "solver", "contact", "run", "seed")


def make_scene(data: Table, directory: Path) -> Scene:
    """A scene from the tables of a file.

    directory: folder at which relative file names start. InputError for an unknown section or key.
    """
    for name in data:
        if name not in SECTIONS:
            raise InputError(f"The scene has no key {name!r}.", section_remedy(name, SECTIONS))
    if not {"cloth", "rigid", "rod"} & set(data):
        raise InputError("The scene has no cloth.", "Add a [cloth] table with a mesh, a [[rigid]] body or a [[rod]].")
    return Scene(**{"cloth": (), **data}, directory=directory)


def scene_from_text(text: str, here: Path = Path()) -> Scene:
    """The scene that `Scene.to_text` wrote; a relative directory, as in an archive, starts at `here`.

    InputError if the text is none of a scene.
    """
    try:
        data = json.loads(text)
        directory = here / data.pop("directory")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(
            f"The scene of the run is broken ({type(error).__name__}: {error}).", "Repeat the run from its scene."
        ) from error
    return make_scene(data, directory)


def _several(sections: Any) -> tuple[Any, ...]:
    """The sections of one or several."""
    return sections if isinstance(sections, tuple) else (sections,)


def _sections(name: str, value: Any) -> Any:
    """The section of a cloth or body, or those of several."""
    several = isinstance(value, list | tuple)
    if not several and not isinstance(value, Mapping | MeshArrays) and not is_mesh(value):
        raise InputError(
            f"{name} must be a table or a list of tables, not {shown(value)}.",
            "Write [[rod]] with points; in Python a dict."
            if name == "rod"
            else f"Write [{name}] or [[{name}]] with a mesh; in Python a dict, clothsim.{name.capitalize()} or a mesh.",
        )
    entries = value if several else (value,)
    made = tuple(
        _CHECKS[name](where := f"{name}[{k}]" if len(entries) > 1 else name, _mesh_table(where, entry))
        for k, entry in enumerate(entries)
    )
    return made if several else made[0]


_CHECKS: dict[str, Any] = {"cloth": check_cloth, "body": check_body, "rigid": check_rigid, "rod": check_rod}


def _tables(value: Any) -> Any:
    """The tables of a section, of several or of the effects."""
    if isinstance(value, KeyTable):
        return frozen(dict(value))
    if isinstance(value, tuple):
        return tuple(_tables(each) for each in value)
    return {name: _tables(each) for name, each in value.items()}


def _mesh_table(where: str, value: Any) -> Any:
    section = where.partition("[")[0]
    if isinstance(value, Cloth | Body | Rigid):
        if value.section != section:
            given, right = value.section.capitalize(), section.capitalize()
            raise InputError(f"{where} is a clothsim.{given}.", f"Give a clothsim.{right}.")
        return value
    if isinstance(value, MeshArrays) or is_mesh(value):
        return {"mesh": mesh_arrays(where, value)}
    keys = as_table(
        where,
        value,
        f"Write [[{section}]]; arrays go into clothsim.{section.capitalize()}(vertices, triangles).",
    )
    mesh = keys.get("mesh")
    if mesh is None or isinstance(mesh, str | int | float | bytes | MeshArrays):
        return keys
    return {**keys, "mesh": mesh_arrays(f"{where}.mesh", mesh)}


def _refuse_functions(where: str, value: Any) -> None:
    """InputError for a Python function among the values of a table."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            _refuse_functions(f"{where}.{key}", inner)
    elif isinstance(value, list | tuple):
        for number, inner in enumerate(value):
            _refuse_functions(f"{where}[{number}]", inner)
    elif callable(value):
        name = getattr(value, "__qualname__", type(value).__name__)
        raise InputError(
            f"{where} is the Python function {name!r}: such a scene can be neither printed nor farmed.",
            "Give a number or key frames [[time, value], ...], or simulate in this program.",
        )


def _without_none(value: Any) -> Any:
    """Tables and lists without what is None, which TOML has no word for."""
    if isinstance(value, Mapping):
        return {key: _without_none(entry) for key, entry in value.items() if entry is not None}
    return [_without_none(entry) for entry in value] if isinstance(value, list) else value


def _plain(value: Any) -> Any:
    """Values that JSON does not know: arrays, scalars, mappings, meshes and paths; of a function its name."""
    if isinstance(value, MeshArrays):
        return {TEXT: value.text}
    if callable(value):
        return {FUNCTION: getattr(value, "__qualname__", type(value).__name__)}
    if isinstance(value, np.ndarray | np.generic) or hasattr(value, "tolist"):
        return value.tolist()
    return dict(value) if isinstance(value, Mapping) else str(value)
