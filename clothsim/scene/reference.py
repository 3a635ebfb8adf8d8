"""Reference of the keys of a scene: type, default, unit, range and meaning, as text, Markdown and JSON schema."""

import collections.abc
import inspect
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, Literal, get_args, get_origin

from clothsim.base.errors import InputError
from clothsim.base.inputs import did_you_mean
from clothsim.keys.effect_tables import Motion
from clothsim.keys.generator_keys import GENERATOR_KEYS
from clothsim.keys.mesh_keys import (
    BodyTable,
    ClipKeys,
    ClothTable,
    FilePart,
    FramesTable,
    JointKeys,
    ModelTable,
    PatternFile,
    RigidTable,
    RodTable,
    TieKeys,
)
from clothsim.keys.schema import Key, SceneKey, choices, keys_of, members, type_in_words
from clothsim.keys.section_hints import home_of
from clothsim.keys.settings import Contact, RunSettings, Seed, Solver
from clothsim.keys.typed_effects import TYPED_EFFECTS
from clothsim.keys.value_checks import as_toml
from clothsim.scene.effects import EFFECTS

COLUMNS = ("key", "type", "default", "unit", "range", "meaning")


@dataclass(frozen=True)
class Section:
    """A section of a scene.

    Parameters
    ----------
    name : str
        Dotted name, "solver" or "effects.gravity"; of a generated mesh `mesh = "..."`.
    summary : str
        One sentence.
    keys : dict
        The keys by name.
    """

    name: str
    summary: str
    keys: dict[str, SceneKey]


def sections() -> dict[str, Section]:
    """All sections of a scene by name, in the order of a scene file; an effect of a user's own is imported for it.

    Returns
    -------
    dict
        {"cloth": Section, ...}

    Examples
    --------
    >>> sections()["solver"].keys["dt"].key.unit
    's'
    """
    return {section.name: section for section in _sections()}


def row(key: SceneKey) -> tuple[str, ...]:
    """The COLUMNS of a key."""
    return (
        key.name,
        type_in_words(key.annotation, key.key),
        _default(key),
        key.key.unit,
        key.key.range,
        f"{key.key.meaning}." if key.key.meaning else "",
    )


def markdown() -> str:
    """The reference page: a table of the keys for each section."""
    parts = [
        "# Scene reference",
        "This page lists every key of a scene. `clothsim keys SECTION` prints the keys of one section. The unit 1 "
        "marks a number without a unit, and - a value that is not a number.",
    ]
    for section in sections().values():
        title = section.name if section.name.startswith("mesh") else f"[{section.name}]"
        parts.append(f"## {title}\n\n{section.summary}")
        if section.keys:
            head = f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}"
            rows = [
                f"| {' | '.join(_cell(k, text) for k, text in enumerate(row(key)))} |" for key in section.keys.values()
            ]
            parts.append("\n".join([head, *rows]))
    return "\n\n".join(parts) + "\n"


def _sections() -> Iterator[Section]:
    yield _section("cloth", ClothTable, "A cloth; several are [[cloth]].")
    yield _section("body", BodyTable, "A body that cloth collides with; several are [[body]].")
    yield _section("body, animated", FramesTable)
    yield _section("body of a model", ModelTable)
    yield _section("body.motion of a model", ClipKeys)
    yield _section("body.motion", Motion)
    yield _section("rigid", RigidTable)
    yield _section("rigid.joint", JointKeys)
    yield _section("rigid.tie", TieKeys)
    yield _section("rod", RodTable)
    yield _section("cloth or body of a file", FilePart)
    yield _section("cloth of a sewing pattern", PatternFile)
    for name, kind in GENERATOR_KEYS.items():
        yield _section(f'mesh = "{name}"', kind)
    known: set[type] = {Motion}
    for name, effect in EFFECTS.items():
        own = "" if name in TYPED_EFFECTS else f"{effect.summary[:1].upper()}{effect.summary[1:]}."
        yield _section(f"effects.{name}", effect.keys_class, own)
        yield from _nested_sections(f"effects.{name}", effect.keys_class, known)
    for kind in (Solver, Contact, RunSettings, Seed):
        yield _section(kind.section, kind)


def _nested_sections(where: str, kind: type, known: set[type]) -> Iterator[Section]:
    """The tables that keys of a section take, and those in them; each once, as `known` grows."""
    keys_by_table: dict[type, list[str]] = {}
    for name, key in keys_of(kind).items():
        for table in key.key.tables:
            keys_by_table.setdefault(table, []).append(name)
    for table, names in keys_by_table.items():
        if table not in known:
            known.add(table)
            of_kind = f', kind = "{table.kind}"' if hasattr(table, "kind") else ""
            path = f"{where}.{', .'.join(names)}"
            yield _section(f"{path}{of_kind}", table)
            yield from _nested_sections(path, table, known)


def _section(name: str, kind: type, summary: str = "") -> Section:
    keys = sorted(keys_of(kind).items(), key=lambda item: item[0] not in ("mesh", "frames", "model"))
    return Section(name, summary or inspect.cleandoc(kind.__doc__ or "").splitlines()[0], dict(keys))


def _default(key: SceneKey) -> str:
    if key.key.shown:
        return key.key.shown
    if key.required:
        return "required"
    return "none" if key.default in ((), "") else as_toml(key.default)


def _cell(column: int, text: str) -> str:
    """A cell of Markdown: keys and defaults as code, bars escaped."""
    escaped = text.replace("|", "\\|")
    return f"`{escaped}`" if column == 0 else escaped


DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema() -> dict[str, Any]:
    """The JSON schema of a scene file.

    Returns
    -------
    dict
        A schema of draft 2020-12. Of a cloth or body it allows the keys of every generator: which of them go together
        is checked when the scene is read.
    """
    meshes: tuple[type, ...] = (FilePart, *GENERATOR_KEYS.values())
    described = {name: sections()[f"effects.{name}"].summary for name in EFFECTS}
    effects = {name: _table_schema(described[name], (effect.keys_class,), ()) for name, effect in EFFECTS.items()}
    properties = {
        "cloth": _one_or_several(_table_schema("A cloth", (ClothTable, PatternFile, *meshes), ("mesh",))),
        "body": _one_or_several(_table_schema("A body", (BodyTable, FramesTable, ModelTable, *meshes), ())),
        "rigid": _one_or_several(_table_schema("A rigid body", (RigidTable, *meshes), ("mesh",))),
        "rod": _one_or_several(_table_schema("A rod", (RodTable,), ("points", "radius", "youngs_modulus"))),
        "effects": {"type": "object", "properties": effects, "additionalProperties": False},
    }
    for kind in (Solver, Contact, RunSettings, Seed):
        properties[kind.section] = _table_schema((kind.__doc__ or "").splitlines()[0], (kind,), ())
    return {
        "$schema": DIALECT,
        "title": "clothsim scene",
        "type": "object",
        "properties": properties,
        "anyOf": [{"required": [name]} for name in ("cloth", "rigid", "rod")],
        "additionalProperties": False,
    }


def _table_schema(description: str, kinds: tuple[type, ...], required: tuple[str, ...]) -> dict[str, Any]:
    """A table with the keys of several sections; a key of more than one takes what any of them takes."""
    schemas: dict[str, list[dict[str, Any]]] = {}
    for kind in kinds:
        for name, known in keys_of(kind).items():
            one = _value_schema(known)
            if one not in schemas.setdefault(name, []):
                schemas[name].append(one)
    properties = {name: ones[0] if len(ones) == 1 else {"anyOf": ones} for name, ones in schemas.items()}
    made = {"type": "object", "description": description, "properties": properties, "additionalProperties": False}
    return made | ({"required": list(required)} if required else {})


def _one_or_several(table: dict[str, Any]) -> dict[str, Any]:
    return {"anyOf": [table, {"type": "array", "items": table}]}


def _value_schema(known: SceneKey) -> dict[str, Any]:
    """The schema of a value, with its unit, default and meaning."""
    unit = "" if known.key.unit in ("-", "1") else f" [{known.key.unit}]"
    types = [_type_schema(part, known.key) for part in members(known.annotation)]
    distinct = [one for k, one in enumerate(types) if one and one not in types[:k]]
    words = choices(known.annotation)
    if words:
        distinct.append({"enum": list(words)})
    kind = distinct[0] if len(distinct) == 1 else {"anyOf": distinct} if distinct else {}
    plain = isinstance(known.default, str | int | float) and not known.key.shown
    return {**kind, "description": f"{known.key.meaning}{unit}."} | ({"default": known.default} if plain else {})


def _type_schema(part: Any, key: Key) -> dict[str, Any]:
    """The schema of one type of a union; empty for what no file holds."""
    origin = get_origin(part) or part
    if origin in (float, int):
        bounds = {
            "minimum": key.least,
            "maximum": key.most,
            "exclusiveMinimum": key.above,
            "exclusiveMaximum": key.below,
        }
        kind = "integer" if origin is int else "number"
        return {"type": kind} | {name: bound for name, bound in bounds.items() if bound is not None}
    if origin is bool:
        return {"type": "boolean"}
    if origin is str:
        return {"type": "string"}
    if origin is Sequence:
        return _array_schema(get_args(part)[0], key)
    if origin is Mapping:
        tables = [_nested_schema(kind) for kind in key.tables]
        return tables[0] if len(tables) == 1 else {"anyOf": tables} if tables else {"type": "object"}
    return {}


def _array_schema(entry: Any, key: Key) -> dict[str, Any]:
    if entry in (float, int):
        length = {"minItems": key.length, "maxItems": key.length} if key.length else {}
        return {"type": "array", "items": _type_schema(entry, key), **length}
    if words := choices(entry):
        return {"type": "array", "items": {"enum": list(words)}}
    if key.tables and collections.abc.Mapping in [get_origin(part) for part in members(entry)]:
        return {"type": "array", "items": _nested_schema(key.tables[0])}
    return {"type": "array"}


def _nested_schema(kind: type) -> dict[str, Any]:
    required = tuple(name for name, known in keys_of(kind).items() if known.required)
    return _table_schema((kind.__doc__ or "").splitlines()[0], (kind,), required)


SIMILAR = 0.75
"""Similarity, from 0 to 1, from which on a name is taken for another one misspelt."""


def reference_text(form: Literal["markdown", "json"]) -> str:
    """The reference of all sections: a page in Markdown, or a JSON schema for editors."""
    return markdown() if form == "markdown" else json.dumps(json_schema(), indent=2)


def reference(name: str | None = None) -> dict[str, Any]:
    """The sections whose name is `name` or holds it as a word, or all; "solver.dt" is one key.

    Returns
    -------
    dict
        {section: {"summary": ..., "keys": {key: {column: text}}}}, the COLUMNS but the first.

    Raises
    ------
    InputError
        For a name that is neither a section nor a key, with the nearest known one.
    """
    matching, only = (list(sections().values()), None) if name is None else _matching(name)
    return {
        section.name: {
            "summary": section.summary,
            "keys": {
                key.name: dict(zip(COLUMNS[1:], row(key)[1:], strict=True))
                for key in section.keys.values()
                if only in (None, key.name)
            },
        }
        for section in matching
    }


def _matching(name: str) -> tuple[list[Section], str | None]:
    """The sections of a name, and the name of the only key that is meant. InputError for an unknown one."""
    known = sections()
    words = _words(name)
    matching = [
        section for section in known.values() if section.name == name or (words and words <= _words(section.name))
    ]
    only = None
    if not matching:
        parent, _, only = name.rpartition(".")
        having = [section for section in known.values() if only in section.keys]
        matching = [
            section for section in having if parent in ("", section.name) or section.name == f"effects.{parent}"
        ]
    if not matching and parent in ("cloth", "body"):  # keys of its generators
        matching = [section for section in having if section.name.startswith("mesh = ")]
    if not matching:
        known = sections()
        words = {word for section in known for word in _words(section)}
        keys = {f"{section.name}.{key}" for section in known.values() for key in section.keys}
        last = name.rpartition(".")[2]
        of_name = did_you_mean(name, [*known, *sorted(keys)], SIMILAR) if "." in name else ""
        of_word = did_you_mean(last, sorted(words), SIMILAR)
        close = get_close_matches(last, {key.rpartition(".")[2] for key in keys}, n=1, cutoff=SIMILAR)
        of_key = home_of(close[0]) if close else ""
        raise InputError(
            f"There is no section or key {name!r}.",
            of_name or of_word or home_of(last) or of_key or "`clothsim keys` lists the sections.",
        )
    return matching, only


def _words(name: str) -> set[str]:
    return set(name.replace('"', "").replace(",", "").replace("=", " ").replace(".", " ").split())
