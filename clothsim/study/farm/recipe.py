"""Recipes: a base scene, and what varies from drape to drape, and the bounds of a usable one in [usable]."""

import math
import tomllib
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from clothsim import Scene, engine, load_scene
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.base.inputs import as_table, is_number, refuse_unknown, shown


@dataclass(frozen=True)
class Rule:
    """A bound on a measured number.

    Attributes
    ----------
    of : str
        Name of what is measured.
    least : bool
        True where the bound is the least allowed value, False where it is the largest.
    unit : str
    meaning : str
        What is measured, for a sentence.
    """

    of: str
    least: bool
    unit: str
    meaning: str


RULES = {
    "stretch_min": Rule("stretch_min", True, "", "the least principal stretch of any step"),
    "stretch_max": Rule("stretch_max", False, "", "the largest principal stretch of any step"),
    "drop_max": Rule("drop", False, "m", "what the centre of a garment fell from its start"),
    "floor_max": Rule("floor", False, "m", "the distance (RMS) to the same drape from a second start"),
}
"""By the key of [usable]. A garment that fell off was worn no more: `drop`; the floor is the error of a label."""


def checked_rules(given: Mapping[str, Any], until: str) -> dict[str, Any]:
    """The rules of a recipe: `at_rest`, true where the drapes run until rest, and bounds. InputError for another key.

    Examples
    --------
    >>> checked_rules({"stretch_max": 1.2}, "rest")
    {'at_rest': True, 'stretch_max': 1.2}
    """
    refuse_unknown("usable", given, ("at_rest", *RULES))
    at_rest = given.get("at_rest", until == "rest")
    if not isinstance(at_rest, bool):
        raise InputError(f"usable.at_rest is {shown(at_rest)}.", "Give true or false.")
    bounds = {key: value for key, value in given.items() if key != "at_rest"}
    for key, value in bounds.items():
        if not is_number(value) or not 0 < value < math.inf:
            raise InputError(f"usable.{key} is {shown(value)}.", "Give a positive number.")
    return {"at_rest": at_rest, **{key: float(value) for key, value in bounds.items()}}


def broken_rule(rules: Mapping[str, Any], at_rest: bool, measured: Mapping[str, float | None]) -> tuple[str, str]:
    """The first rule that a drape breaks and a sentence on it; both empty where it meets all.

    measured: by the name of what is measured; None where it is not known, which breaks the rule.

    Examples
    --------
    >>> broken_rule({"at_rest": False, "stretch_max": 1.2}, False, {"stretch_max": 1.31})
    ('stretch_max', 'The largest principal stretch of any step is 1.31; stretch_max = 1.2.')
    """
    if rules.get("at_rest") and not at_rest:
        return "not at rest", ""
    for key, rule in RULES.items():
        if key not in rules:
            continue
        value, bound = measured.get(rule.of), rules[key]
        if value is None or (value < bound if rule.least else value > bound):
            known = "not known" if value is None else f"{value:.4g} {rule.unit}".strip()
            return key, f"{rule.meaning[0].upper()}{rule.meaning[1:]} is {known}; {key} = {bound:g}."
    return "", ""


# Random draws of scene keys: one stream for each seed, index and key.

KINDS = ("uniform", "log_uniform", "normal", "choice", "grid", "clip")


class Draw(Protocol):
    """Distribution of the values of a key."""

    def value(self, stream: np.random.Generator) -> Any:
        """One value."""

    @property
    def box(self) -> tuple[float, float] | None:
        """Least and largest value; None where the values are not numbers."""


@dataclass(frozen=True)
class Interval:
    """Uniform, log-uniform or normal numbers from `low` to `high`; a normal one is drawn again outside of them."""

    kind: str
    low: float
    high: float
    mean: float = 0.0
    deviation: float = 0.0

    def value(self, stream: np.random.Generator) -> float:
        """One number, rounded to 12 digits, so that its text is short and its own."""
        if self.kind == "log_uniform":
            drawn = math.exp(stream.uniform(math.log(self.low), math.log(self.high)))
        elif self.kind == "normal":
            drawn = self.mean
            for _ in range(64):  # 1 in 80 draws is outside of 2.5 deviations, so that 64 in a row do not occur
                number = float(stream.normal(self.mean, self.deviation))
                if self.low <= number <= self.high:
                    drawn = number
                    break
        else:
            drawn = stream.uniform(self.low, self.high)
        return float(f"{drawn:.12g}")

    @property
    def box(self) -> tuple[float, float]:
        """The ends."""
        return self.low, self.high


@dataclass(frozen=True)
class Choice:
    """One of some values, all equally probable; `in_order`: the values of a grid, taken one by one."""

    values: tuple[Any, ...]
    in_order: bool = False

    def value(self, stream: np.random.Generator) -> Any:
        """One of the values."""
        return self.values[int(stream.integers(len(self.values)))]

    @property
    def box(self) -> tuple[float, float] | None:
        """Least and largest of the numbers."""
        numbers = [each for each in self.values if is_number(each)]
        return (min(numbers), max(numbers)) if len(numbers) == len(self.values) else None


@dataclass(frozen=True)
class DrawnClip:
    """A clip of one of some kinds, drawn from a seed of its own: "squat:31415926"; no two drapes have the same."""

    kinds: tuple[str, ...]

    def value(self, stream: np.random.Generator) -> str:
        """The name of a clip."""
        return f"{self.kinds[int(stream.integers(len(self.kinds)))]}:{int(stream.integers(10**8))}"

    @property
    def box(self) -> None:
        """None: it is not a number."""
        return None


def stream_of(seed: int, index: int, key: str) -> np.random.Generator:
    """The random numbers of one key of one drape: a further varied key changes those of no other."""
    return np.random.default_rng([seed, index, zlib.crc32(key.encode())])


def draw_of(key: str, given: Any) -> Draw:
    """The distribution of an entry of [vary].

    Parameters
    ----------
    key : str
        The varied key.
    given : list or table
        [a, b, c] is a choice; { uniform = [lo, hi] }, { log_uniform = [lo, hi] }, { normal = [mean, deviation] } within
        2.5 deviations, { choice = [...] }, { grid = [...] }, { clip = ["gait", "jump"] } of kinds of motion.

    Raises
    ------
    InputError
        For another entry.

    Examples
    --------
    >>> draw_of("body.chest", {"uniform": [0.95, 1.08]}).box
    (0.95, 1.08)
    >>> draw_of("cloth.fabric", ["cotton", "denim"]).values
    ('cotton', 'denim')
    """
    where = f"vary.{key!r}"
    if isinstance(given, list | tuple):
        return Choice(_values(where, given))
    if not isinstance(given, Mapping) or len(given) != 1:
        raise InputError(f"{where} is {shown(given)}.", 'Write { uniform = [lo, hi] }, a list of values, or "=key".')
    ((kind, numbers),) = given.items()
    if "." not in key and kind not in KINDS:  # a dotted key of TOML is a table of tables
        raise InputError(f"{where} is {shown(given)}.", f'Write the path of the key in quotes: "{key}.{kind}" = ...')
    refuse_unknown(where, [kind], KINDS)
    if kind == "clip":
        return DrawnClip(_values(where, numbers))
    if kind in ("choice", "grid"):
        return Choice(_values(where, numbers), kind == "grid")
    pair = list(numbers) if isinstance(numbers, list | tuple) else []
    if len(pair) != 2 or not all(isinstance(n, int | float) and math.isfinite(n) for n in pair):
        raise InputError(f"{where}.{kind} is {shown(numbers)}.", "Give two numbers.")
    a, b = float(pair[0]), float(pair[1])
    if kind == "normal":
        if b <= 0:
            raise InputError(f"{where}: the deviation is {b:g}.", "Give a positive one.")
        return Interval(kind, a - 2.5 * b, a + 2.5 * b, a, b)
    if not a < b or (kind == "log_uniform" and a <= 0):
        raise InputError(
            f"{where}: {kind} = [{a:g}, {b:g}] is not an interval.", "Give the lower end, then the upper one."
        )
    return Interval(kind, a, b)


def _values(where: str, given: Any) -> tuple[Any, ...]:
    values = tuple(given) if isinstance(given, list | tuple) else ()
    if not values:
        raise InputError(f"{where} is {shown(given)}.", "Give a list of numbers, texts, vectors or tables.")
    return values


FARM_KEYS = ("scene", "count", "seed", "version", "until", "frames", "licence")
MOST = 10_000_000
"""Largest number of drapes."""


@dataclass(frozen=True)
class Recipe:
    """A base scene, and what varies.

    Attributes
    ----------
    scene : Scene
        The base scene, with the changes of [set], one thread, and the end that the recipe names.
    count : int
        Number of drapes.
    seed : int
        Of all draws.
    version : int
        Part of the ids: another version makes every drape again.
    draws : dict of str to Draw
        By the name of the key.
    same : dict of str to str
        Keys that take the value of another one.
    frames : {"last", "all"}
        What is kept of a drape.
    licence : str
        Of the data set.
    rules : dict
        What a usable drape must be, from [usable].
    """

    scene: Scene
    count: int
    seed: int = 0
    version: int = 1
    draws: Mapping[str, Draw] = field(default_factory=dict)
    same: Mapping[str, str] = field(default_factory=dict)
    frames: str = "last"
    licence: str = "unspecified"
    rules: Mapping[str, Any] = field(default_factory=dict)

    def values(self, index: int) -> dict[str, Any]:
        """The values of the varied keys of a drape, from 0."""
        values, rest = {}, index
        for key, draw in self.draws.items():
            if isinstance(draw, Choice) and draw.in_order:
                rest, number = divmod(rest, len(draw.values))
                values[key] = draw.values[number]
            else:
                values[key] = draw.value(stream_of(self.seed, index, key))
        return values | {key: drawn_value(values, other) for key, other in self.same.items()}

    @property
    def boxes(self) -> dict[str, tuple[float, float]]:
        """Least and largest value of each varied key that is a number."""
        boxes = {key: draw.box for key, draw in self.draws.items()}
        return {key: box for key, box in boxes.items() if box is not None}


def drawn_value(values: Mapping[str, Any], key: str) -> Any:
    """The value of a varied key, or an entry of a varied table. KeyError where it is neither.

    Examples
    --------
    >>> drawn_value({"body.shape": {"height": 1.8}}, "body.shape.height")
    1.8
    """
    if key in values:
        return values[key]
    table, _, entry = key.rpartition(".")
    return values[table][entry]


def load_recipe(path: str | Path) -> Recipe:
    """The recipe in a TOML file.

    Parameters
    ----------
    path : path
        The file; names of files in it start at its own folder.

    Raises
    ------
    InputError
        For a file that is not a recipe, with the key.
    """
    file = Path(path)
    try:
        absent = "Name a TOML file with [farm] and [vary]."
        data = tomllib.loads(read_regular_file(file, 1 << 24, absent).decode("utf-8"))
    except ValueError as error:
        raise InputError(f"{file} is not a TOML file: {error}.", "Write key = value, as in toml.io.") from error
    if "cloth" in data and "farm" not in data:
        remedy = f'Write a recipe that names it: [farm] with scene = "{file.name}", and [vary].'
        raise InputError(f"{file} is a scene, not a recipe.", remedy)
    refuse_unknown("The recipe", data, ("farm", "set", "usable", "vary"))
    farm = as_table("farm", data.get("farm", {}))
    refuse_unknown("farm", farm, FARM_KEYS)
    named = farm.get("scene")
    if not isinstance(named, str):
        raise InputError(
            "farm.scene is missing.", 'Write scene = "shirt", the name of an example, or a file beside the recipe.'
        )
    beside = file.parent / named
    scene = load_scene(beside if beside.is_file() else named)
    fixed, varied, usable = (as_table(name, data.get(name, {})) for name in ("set", "vary", "usable"))
    return make_recipe(scene, farm, fixed, varied, file.parent, usable)


def make_recipe(
    scene: Scene,
    farm: Mapping[str, Any],
    fixed: Mapping[str, Any],
    vary: Mapping[str, Any],
    folder: Path = Path(),
    usable: Mapping[str, Any] = MappingProxyType({}),
) -> Recipe:
    """A recipe from its tables; folder: where the names of files start. InputError names a bad key."""
    until = farm.get("until", "rest")
    frames = farm.get("frames", "last")
    for name, value, known in (("until", until, ("rest", "time")), ("frames", frames, ("last", "all"))):
        if value not in known:
            raise InputError(f"farm.{name} is {shown(value)}.", f"Known: {', '.join(known)}.")
    same = {key: text[1:].strip() for key, text in vary.items() if isinstance(text, str) and text.startswith("=")}
    draws = {key: draw_of(key, _resolved(given, folder)) for key, given in vary.items() if key not in same}
    for key, other in same.items():
        table, _, entry = other.rpartition(".")
        tables = getattr(draws.get(table), "values", ())
        if other not in draws and not (tables and all(isinstance(t, Mapping) and entry in t for t in tables)):
            raise InputError(f"vary.{key!r} takes the value of {other!r}, which does not vary.", "Name a varied key.")
    grids = math.prod(len(draw.values) for draw in draws.values() if isinstance(draw, Choice) and draw.in_order)
    whole = {name: farm.get(name, usual) for name, usual in (("count", grids), ("seed", 0), ("version", 1))}
    for name, value in whole.items():
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise InputError(f"farm.{name} is {shown(value)}.", "Give a whole number from 0.")
    if not 1 <= whole["count"] <= MOST:
        raise InputError(f"farm.count is {whole['count']}.", f"Give a number from 1 to {MOST}.")
    base = changed(scene, {**{k: _resolved(v, folder) for k, v in _flat(fixed).items()}, "run.until": until})
    base = changed(base, {"solver.threads": 1})
    licence = str(farm.get("licence", "unspecified"))
    rules = checked_rules(usable, until)
    return Recipe(base, whole["count"], whole["seed"], whole["version"], draws, same, frames, licence, rules)


def changed(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """The scene with keys changed: {"body.chest": 1.02}. InputError names a bad one."""
    for key, value in values.items():
        try:
            scene = engine.replace(scene, key, value)
        except (TypeError, ValueError) as error:
            raise InputError(f"{key} cannot be {shown(value)}.", "Give a number, a text or a list.") from error
    return scene


def _flat(given: Mapping[str, Any], path: str = "") -> dict[str, Any]:
    """Nested tables as {"solver.dt": .05}; both ways of writing a key mean the same."""
    flat: dict[str, Any] = {}
    for key, value in given.items():
        name = f"{path}.{key}" if path else key
        flat |= _flat(value, name) if isinstance(value, Mapping) else {name: value}
    return flat


def _resolved(given: Any, folder: Path) -> Any:
    """Texts that name a file beside the recipe as its full path."""
    if isinstance(given, Mapping):
        return {key: _resolved(value, folder) for key, value in given.items()}
    if isinstance(given, list | tuple):
        return [_resolved(value, folder) for value in given]
    if isinstance(given, str) and "." in given and (folder / given).is_file():
        return str((folder / given).resolve())
    return given
