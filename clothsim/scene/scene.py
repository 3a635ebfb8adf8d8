"""Scene: the data of a simulation, checked when it is made."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from clothsim.keys.frozen import frozen
from clothsim.keys.key_table import KeyTable, as_tables
from clothsim.keys.keys import refuse_deep, refuse_unknown, shown, table
from clothsim.keys.mesh_arrays import TEXT, MeshArrays
from clothsim.keys.mesh_keys import check_body, check_cloth
from clothsim.keys.rigid_keys import check_rigid
from clothsim.keys.schema import FUNCTION
from clothsim.keys.section_hints import effect_remedy, section_remedy
from clothsim.keys.settings import Contact, RunSettings, Seed, Solver
from clothsim.keys.typed_effects import TYPED_EFFECTS, EffectKeys, effect_tables
from clothsim.keys.value_checks import check_table
from clothsim.scene.cloth_arrays import Body, Cloth, Rigid
from clothsim.scene.effects import EFFECTS
from clothsim.scene.given_meshes import mesh_arrays
from clothsim.scene.mesh_objects import is_mesh

Table = Mapping[str, Any]


@dataclass(frozen=True, init=False)
class Scene:
    """Data of a simulation, with the names of a scene file.

    Parameters
    ----------
    cloth : dict, Cloth, mesh object, or a list of them
        Keys of [cloth].
    body : dict, Body, mesh object, or a list of them
        Keys of [[body]].
    rigid : dict, Rigid, mesh object, or a list of them
        Keys of [[rigid]].
    effects : dict or list of effects
        {name: {key: value}}, or typed effects.
    solver, contact, run, seed : dict or Solver, Contact, RunSettings, Seed
        Keys of the sections of these names.
    directory : path
        Folder at which relative file names start.

    Attributes
    ----------
    solver_settings, contact_settings, run_settings, seed_settings
        The sections with their defaults.

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
    {'inertia': {}, 'membrane': {}, 'gravity': {}}
    >>> scene.solver_settings.dt
    0.01
    """

    cloth: Table | Sequence[Table]
    body: Table | Sequence[Table]
    effects: Mapping[str, Table]
    solver: Table
    contact: Table
    run: Table
    seed: Table
    directory: Path
    rigid: Table | Sequence[Table]

    def __init__(
        self,
        cloth: Table | Cloth | Any,
        body: Table | Body | Any = (),
        effects: Mapping[str, Any] | Iterable[EffectKeys] = (),
        solver: Table | Solver | None = None,
        contact: Table | Contact | None = None,
        run: Table | RunSettings | None = None,
        seed: Table | Seed | None = None,
        directory: Path = Path(),
        rigid: Table | Sequence[Table] = (),
    ) -> None:
        for name, value in (("cloth", cloth), ("body", body), ("rigid", rigid), ("effects", effects)):
            refuse_deep(name, value)
        given = {
            "cloth": _mesh_tables("cloth", cloth),
            "body": _mesh_tables("body", body),
            "rigid": _mesh_tables("rigid", rigid),
            "effects": effect_tables(effects),
            "directory": directory,
        }
        for name, value in (("solver", solver), ("contact", contact), ("run", run), ("seed", seed)):
            given[name] = value.as_table() if isinstance(value, KeyTable) else {} if value is None else value
        for name, value in given.items():
            object.__setattr__(self, name, value)
        self._check()
        for name in SECTIONS:
            object.__setattr__(self, name, frozen(given[name]))

    def _check(self) -> None:
        """Check every section; parse the settings once."""
        refuse_unknown("effects", table("effects", self.effects, "Write [effects.gravity]."), EFFECTS)
        for name, given in self.effects.items():
            section, where = TYPED_EFFECTS.get(name), f"effects.{name}"
            keys = table(where, given, effect_remedy(name))
            if section is not None:
                check_table(where, keys, section)
            else:  # an effect of a user's own: its builder's keywords
                refuse_unknown(where, keys, EFFECTS[name].keys())
        settings: dict[str, type[KeyTable]] = {"solver": Solver, "run": RunSettings, "seed": Seed, "contact": Contact}
        for name, kind in settings.items():
            refuse_deep(name, getattr(self, name))
            object.__setattr__(self, f"_{name}", kind.parsed(name, getattr(self, name)))
        for k, keys in enumerate(self.cloths):
            check_cloth("cloth" if len(self.cloths) == 1 else f"cloth[{k}]", keys)
        for k, keys in enumerate(self.bodies):
            check_body("body" if len(self.bodies) == 1 else f"body[{k}]", keys)
        for k, keys in enumerate(self.rigid_bodies):
            check_rigid("rigid" if len(self.rigid_bodies) == 1 else f"rigid[{k}]", keys)

    @property
    def cloths(self) -> tuple[Table, ...]:
        """The tables of the cloths."""
        return _several("cloth", self.cloth)

    @property
    def bodies(self) -> tuple[Table, ...]:
        """The tables of the bodies."""
        return _several("body", self.body)

    @property
    def rigid_bodies(self) -> tuple[Table, ...]:
        """The tables of the rigid bodies."""
        return _several("rigid", self.rigid)

    @property
    def solver_settings(self) -> Solver:
        """[solver] with its defaults."""
        return self._solver  # type: ignore[attr-defined]

    @property
    def run_settings(self) -> RunSettings:
        """[run] with its defaults."""
        return self._run  # type: ignore[attr-defined]

    @property
    def seed_settings(self) -> Seed:
        """[seed] with its defaults."""
        return self._seed  # type: ignore[attr-defined]

    @property
    def contact_settings(self) -> Contact:
        """[contact] with its defaults."""
        return self._contact  # type: ignore[attr-defined]

    def to_text(self, names_of_functions: bool = False) -> str:
        """The scene as JSON text, which `scene_from_text` reads back; meshes in memory are in it.

        Parameters
        ----------
        names_of_functions : bool
            True: of a Python function its name is written, for the record of a run; a scene that is read back has lost
            it, and says so when its effect is built.

        Raises
        ------
        InputError
            For a scene with a Python function otherwise.
        """
        sections = {name: getattr(self, name) for name in SECTIONS if name != "rigid" or self.rigid}
        if not names_of_functions:
            for name, section in sections.items():
                _refuse_functions(name, section)
        return json.dumps({**sections, "directory": str(Path(self.directory).resolve())}, default=_plain)


SECTIONS = ("cloth", "body", "rigid", "effects", "solver", "contact", "run", "seed")


def make_scene(data: Table, directory: Path) -> Scene:
    """A scene from the tables of a file.

    Parameters
    ----------
    data : dict
        Tables by section.
    directory : Path
        Folder at which relative file names start.

    Raises
    ------
    InputError
        For an unknown section or key.
    """
    for name in data:
        if name not in SECTIONS:
            raise InputError(f"The scene has no key {name!r}.", section_remedy(name, SECTIONS))
    if "cloth" not in data:
        raise InputError("The scene has no cloth.", "Add a [cloth] table with a mesh.")
    return Scene(**data, directory=directory)


def scene_from_text(text: str, here: Path = Path()) -> Scene:
    """The scene that `Scene.to_text` wrote; a relative directory, as in an archive, starts at `here`.

    Raises
    ------
    InputError
        Where the text is none of a scene.
    """
    try:
        data = json.loads(text)
        directory = here / data.pop("directory")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(
            f"The scene of the run is broken ({type(error).__name__}: {error}).", "Repeat the run from its scene."
        ) from error
    return make_scene(data, directory)


def _mesh_tables(name: str, value: Any) -> Any:
    """The tables of cloths or bodies, with meshes in memory as `MeshArrays`; what is none of them as it is."""
    if isinstance(value, list | tuple):
        several = len(value) > 1
        return [_mesh_table(f"{name}[{k}]" if several else name, entry) for k, entry in enumerate(value)]
    return _mesh_table(name, value)


def _mesh_table(where: str, value: Any) -> Any:
    if isinstance(value, Cloth | Body | Rigid):
        if value.section != where.partition("[")[0]:
            given, right = value.section.capitalize(), where.partition("[")[0].capitalize()
            raise InputError(f"{where} is a clothsim.{given}.", f"Give a clothsim.{right}.")
        return value.as_table()
    if not isinstance(value, Mapping):
        return {"mesh": mesh_arrays(where, value)} if isinstance(value, MeshArrays) or is_mesh(value) else value
    keys = as_tables(value)
    mesh = keys.get("mesh")
    if mesh is None or isinstance(mesh, str | int | float | bytes):
        return keys
    return {**keys, "mesh": mesh_arrays(f"{where}.mesh", mesh)}


def _several(name: str, value: Any) -> tuple[Table, ...]:
    if isinstance(value, Mapping):
        return (value,)
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise InputError(
            f"{name} must be a table or a list of tables, not {shown(value)}.",
            f"Write [{name}] or [[{name}]] with a mesh; in Python a dict, clothsim.{name.capitalize()} or a mesh.",
        )
    return tuple(
        table(
            f"{name}[{k}]",
            entry,
            f"Write [[{name}]]; arrays go into clothsim.{name.capitalize()}(vertices, triangles).",
        )
        for k, entry in enumerate(value)
    )


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


def _plain(value: Any) -> Any:
    """Values that JSON does not know: arrays, scalars, mappings, meshes and paths; of a function its name."""
    if isinstance(value, MeshArrays):
        return {TEXT: value.text}
    if isinstance(value, KeyTable):
        return value.as_table()
    if callable(value):
        return {FUNCTION: getattr(value, "__qualname__", type(value).__name__)}
    if isinstance(value, np.ndarray | np.generic) or hasattr(value, "tolist"):
        return value.tolist()
    return dict(value) if isinstance(value, Mapping) else str(value)
