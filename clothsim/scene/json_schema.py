"""JSON schema of a scene file, for editors that complete and check TOML."""

import collections.abc
from collections.abc import Mapping, Sequence
from typing import Any, get_args, get_origin

from clothsim.keys.generator_keys import GENERATOR_KEYS
from clothsim.keys.mesh_keys import BodyTable, ClothTable, FilePart, FramesTable, ModelTable, PatternFile, RigidTable
from clothsim.keys.schema import Key, SceneKey, choices, keys_of, members
from clothsim.keys.settings import Contact, RunSettings, Seed, Solver
from clothsim.scene.effects import EFFECTS
from clothsim.scene.reference import sections

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
    effects = {name: _object(described[name], (effect.keys_class,), ()) for name, effect in EFFECTS.items()}
    properties = {
        "cloth": _one_or_several(_object("A cloth", (ClothTable, PatternFile, *meshes), ("mesh",))),
        "body": _one_or_several(_object("A body", (BodyTable, FramesTable, ModelTable, *meshes), ())),
        "rigid": _one_or_several(_object("A rigid body", (RigidTable, *meshes), ("mesh",))),
        "effects": {"type": "object", "properties": effects, "additionalProperties": False},
    }
    for kind in (Solver, Contact, RunSettings, Seed):
        properties[kind.section] = _object((kind.__doc__ or "").splitlines()[0], (kind,), ())
    return {
        "$schema": DIALECT,
        "title": "clothsim scene",
        "type": "object",
        "properties": properties,
        "required": ["cloth"],
        "additionalProperties": False,
    }


def _object(description: str, kinds: tuple[type, ...], required: tuple[str, ...]) -> dict[str, Any]:
    """A table with the keys of several sections; a key of more than one takes what any of them takes."""
    schemas: dict[str, list[dict[str, Any]]] = {}
    for kind in kinds:
        for name, known in keys_of(kind).items():
            one = _value(known)
            if one not in schemas.setdefault(name, []):
                schemas[name].append(one)
    properties = {name: ones[0] if len(ones) == 1 else {"anyOf": ones} for name, ones in schemas.items()}
    made = {"type": "object", "description": description, "properties": properties, "additionalProperties": False}
    return made | ({"required": list(required)} if required else {})


def _one_or_several(table: dict[str, Any]) -> dict[str, Any]:
    return {"anyOf": [table, {"type": "array", "items": table}]}


def _value(known: SceneKey) -> dict[str, Any]:
    """The schema of a value, with its unit, default and meaning."""
    unit = "" if known.key.unit in ("-", "1") else f" [{known.key.unit}]"
    types = [_type(part, known.key) for part in members(known.annotation)]
    distinct = [one for k, one in enumerate(types) if one and one not in types[:k]]
    words = choices(known.annotation)
    if words:
        distinct.append({"enum": list(words)})
    kind = distinct[0] if len(distinct) == 1 else {"anyOf": distinct} if distinct else {}
    plain = isinstance(known.default, str | int | float) and not known.key.shown
    return {**kind, "description": f"{known.key.meaning}{unit}."} | ({"default": known.default} if plain else {})


def _type(part: Any, key: Key) -> dict[str, Any]:
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
        return _array(get_args(part)[0], key)
    if origin is Mapping:
        tables = [_nested(kind) for kind in key.tables]
        return tables[0] if len(tables) == 1 else {"anyOf": tables} if tables else {"type": "object"}
    return {}


def _array(entry: Any, key: Key) -> dict[str, Any]:
    if entry in (float, int):
        length = {"minItems": key.length, "maxItems": key.length} if key.length else {}
        return {"type": "array", "items": _type(entry, key), **length}
    if words := choices(entry):
        return {"type": "array", "items": {"enum": list(words)}}
    if key.tables and collections.abc.Mapping in [get_origin(part) for part in members(entry)]:
        return {"type": "array", "items": _nested(key.tables[0])}
    return {"type": "array"}


def _nested(kind: type) -> dict[str, Any]:
    required = tuple(name for name, known in keys_of(kind).items() if known.required)
    return _object((kind.__doc__ or "").splitlines()[0], (kind,), required)
