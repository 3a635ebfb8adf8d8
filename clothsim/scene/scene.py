"""A scene: data only. It is checked when it is made, and built by `build`."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from clothsim.errors import InputError
from clothsim.scene.effects import EFFECTS
from clothsim.scene.keys import refuse_deep, refuse_unknown, settings, table
from clothsim.scene.settings import Contact, RunSettings, Seed, Solver

Table = Mapping[str, Any]


@dataclass(frozen=True)
class Scene:
    """What a scene file says, with the same names.

    cloth, body: one table each, or a list of them; effects: {name: {key: value}}; solver, contact, run, seed: tables of
    keys. directory: where relative file names start. InputError for an unknown key, with the nearest known one.
    """

    cloth: Table | Sequence[Table]
    body: Table | Sequence[Table] = ()
    effects: Mapping[str, Table] = field(default_factory=dict)
    solver: Table = field(default_factory=dict)
    contact: Table = field(default_factory=dict)
    run: Table = field(default_factory=dict)
    seed: Table = field(default_factory=dict)
    directory: Path = Path()

    def __post_init__(self) -> None:
        for name in SECTIONS:
            refuse_deep(name, getattr(self, name))
        refuse_unknown("effects", table("effects", self.effects), EFFECTS)
        for name, keys in self.effects.items():
            refuse_unknown(f"effects.{name}", table(f"effects.{name}", keys), EFFECTS[name].keys())
        for check in (self.solver_settings, self.run_settings, self.seed_settings, self.contact_settings):
            check()

    @property
    def cloths(self) -> tuple[Table, ...]:
        """The tables of the cloths."""
        return _several("cloth", self.cloth)

    @property
    def bodies(self) -> tuple[Table, ...]:
        """The tables of the bodies."""
        return _several("body", self.body)

    def solver_settings(self) -> Solver:
        """[solver] with its defaults."""
        if {"dt", "error"} <= table("solver", self.solver).keys():
            raise InputError("solver has dt and error.", "Give one of them: with error the steps are chosen.")
        return settings(Solver, "solver", self.solver)

    def run_settings(self) -> RunSettings:
        """[run] with its defaults."""
        return settings(RunSettings, "run", self.run)

    def seed_settings(self) -> Seed:
        """[seed] with its defaults."""
        return settings(Seed, "seed", self.seed)

    def contact_settings(self) -> Contact:
        """[contact] with its defaults."""
        return settings(Contact, "contact", self.contact)

    def to_text(self) -> str:
        """The scene as JSON text, which `scene_from_text` reads back."""
        sections = {name: getattr(self, name) for name in SECTIONS}
        return json.dumps({**sections, "directory": str(Path(self.directory).resolve())}, default=_plain)


SECTIONS = ("cloth", "body", "effects", "solver", "contact", "run", "seed")


def make_scene(data: Table, directory: Path) -> Scene:
    """A scene from the tables of a file. InputError for an unknown section or key."""
    refuse_unknown("The scene", data, SECTIONS)
    if "cloth" not in data:
        raise InputError("The scene has no cloth.", "Add a [cloth] table with a mesh.")
    return Scene(**data, directory=directory)


def scene_from_text(text: str, here: Path = Path()) -> Scene:
    """The scene that `Scene.to_text` wrote; a relative directory, as in an archive, starts at `here`.

    InputError where the text is another's.
    """
    try:
        data = json.loads(text)
        directory = here / data.pop("directory")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"The scene of the run is broken ({type(error).__name__}: {error}).") from error
    return make_scene(data, directory)


def _several(name: str, value: Any) -> tuple[Table, ...]:
    if isinstance(value, Mapping):
        return (value,)
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise InputError(f"{name} must be a table or a list of tables, not {value!r}.")
    return tuple(table(f"{name}[{k}]", entry) for k, entry in enumerate(value))


def _plain(value: Any) -> Any:
    """NumPy arrays and scalars, tuples, read-only mappings and paths as JSON knows them; of a function its name."""
    if callable(value):
        return {"function": getattr(value, "__qualname__", type(value).__name__)}
    if hasattr(value, "tolist"):
        return value.tolist()
    return dict(value) if isinstance(value, Mapping) else str(value)
