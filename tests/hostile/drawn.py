"""Scenes drawn from the keys: their types and ranges are those of the table of keys, their values are not kind.

A scene is a small sheet or disk, perhaps a second one, over a body or none, with some effects; then a few keys of its
sections get values: within the range, at its ends, beyond it, tiny, huge, of another type. What decides the cost alone
(cells, duration, steps) stays cheap. Any answer in a sentence is right; what completes is checked by the oracle.
"""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_origin

import numpy as np

from clothsim.keys.schema import SceneKey, choices, members
from clothsim.scene.reference import sections
from tests.hostile.case import Case
from tests.hostile.oracle import fault_of_run
from tests.hostile.scenes import RUN

ANY = "refused|found|completed|stopped"
CHEAP = {
    "solver": {"dt", "threads", "linear", "error", "estimate", "budget", "max_iterations", "converge", "tolerance"},
    "run": {"duration", "frames_per_second", "until"},
    "cloth": {"mesh", "name"},
    "body": {"mesh", "name"},
}
"""Keys that are not drawn: names, and what decides the cost."""
EFFECTS = (
    "membrane",
    "bending",
    "gravity",
    "air",
    "damping",
    "body_contact",
    "self_contact",
    "friction",
    "strain_limit",
    "pins",
    "plastic_bending",
    "pressure",
)
NESTED = {
    "body.motion": ("body", "motion", False),
    "effects.pins.group": ("effects.pins", "group", True),
    "effects.springs.spring": ("effects.springs", "spring", True),
    "effects.seams.seam": ("effects.seams", "seam", True),
    "effects.rest_angle.crease": ("effects.rest_angle", "crease", True),
    'effects.air.wind, kind = "gust"': ("effects.air", "wind", False),
    'effects.air.wind, kind = "vortex"': ("effects.air", "wind", False),
}
"""Nested tables: their owner, its key, and whether that takes a list of them."""
SHAPES = {"rectangle": {"cells": [4, 3]}, "disk": {"cells": 3}, "tube": {"cells": [6, 3]}, "pillow": {"cells": 2}}
BODIES = {"sphere": {"subdivisions": 1}, "slab": {"cells": [1, 1, 1]}, "capsule": {}, "cone": {}}


def drawn_cases(count: int, seed: int) -> list[Case]:
    """That many cases; each depends on the seed and its own number alone."""
    return [_case(seed, number) for number in range(count)]


def _case(seed: int, number: int) -> Case:
    stream = np.random.default_rng([seed, number])
    return Case(f"drawn {seed}: {number}", RUN, ANY, {"a.toml": as_toml(drawn(stream))}, check=_right)


def _right(folder: Path, text: str) -> str:
    return fault_of_run(folder / "out")


def drawn(stream: np.random.Generator) -> dict[str, Any]:
    """The tables of a scene."""
    contact = bool(stream.random() < 0.8)
    scene: dict[str, Any] = {
        "cloth": [_cloth(stream, k) for k in range(1 + (stream.random() < 0.25))],
        "body": [_body(stream, k) for k in range(int(stream.integers(0, 3)))],
        "effects": {name: {} for name in EFFECTS if stream.random() < 0.4},
        "solver": {"dt": float(stream.choice([0.005, 0.02])), "threads": 1, "linear": "superlu"},
        "run": {"duration": 0.04, "frames_per_second": 50},
        "contact": {},
    }
    effects = scene["effects"]
    effects |= {"membrane": {}, **({"inertia": {}} if stream.random() < 0.9 else {})}
    effects |= {"body_contact": {}, "self_contact": {}} if contact else {}
    places = [(f"effects.{name}", effects[name]) for name in effects]
    places += [(name, scene[name]) for name in ("solver", "run", "contact")]
    places += [(name, table) for name in ("cloth", "body") for table in scene[name]]
    places += [(f'mesh = "{table["mesh"]}"', table) for name in ("cloth", "body") for table in scene[name]]
    for _ in range(int(stream.integers(0, 5))):
        where, table = places[int(stream.integers(len(places)))]
        _draw_key(stream, where, table)
    for where, (owner, key, several) in NESTED.items():
        if stream.random() < 0.06:
            name = owner.removeprefix("effects.")
            inner = _nested(stream, where)
            tables = scene.get(owner, []) if owner == "body" else [effects.setdefault(name, {})]
            for table in tables[:1]:
                table[key] = [inner] if several else inner
    if stream.random() < 0.15:
        scene["rigid"] = [_body(stream, 3) | {"density": 500.0, "name": "block"}]
        _draw_key(stream, "rigid", scene["rigid"][0])
    return {name: table for name, table in scene.items() if table}


def _nested(stream: np.random.Generator, where: str) -> dict[str, Any]:
    """A nested table: its required keys and perhaps another one."""
    keys = sections()[where].keys
    chosen = [name for name, known in keys.items() if known.required or stream.random() < 0.25]
    return {name: _value(stream, keys[name]) for name in chosen}


def _cloth(stream: np.random.Generator, k: int) -> dict[str, Any]:
    mesh = str(stream.choice(list(SHAPES)))
    place = [0.0, 0.0, round(0.35 + 0.3 * k + 0.2 * float(stream.normal()), 3)]
    return {"name": f"cloth{k}", "mesh": mesh, **SHAPES[mesh], "position": place}


def _body(stream: np.random.Generator, k: int) -> dict[str, Any]:
    mesh = str(stream.choice(list(BODIES)))
    return {"name": f"body{k}", "mesh": mesh, **BODIES[mesh], "position": [0.8 * k, 0.0, -0.2]}


def _draw_key(stream: np.random.Generator, where: str, table: dict[str, Any]) -> None:
    """Set a key of a section in its table."""
    keys = sections()[where].keys
    names = [name for name in keys if name not in CHEAP.get(where, {"cells", "subdivisions", "edge"})]
    if names:
        name = str(stream.choice(names))
        table[name] = _value(stream, keys[name])


def _value(stream: np.random.Generator, known: SceneKey) -> Any:
    """A value of a key, kind or not."""
    if stream.random() < 0.1:
        return [True, "x", [], {}, -1, [[1.0, 2.0]], "", 10**15, "nothing.npy"][int(stream.integers(9))]
    parts = members(known.annotation)
    if words := choices(known.annotation):
        return str(stream.choice(words))
    if bool in parts:
        return bool(stream.random() < 0.5)
    if any(get_origin(part) is Sequence for part in parts) and not (float in parts or int in parts):
        return [_number(stream, known) for _ in range(known.key.length or 3)]
    if float in parts or int in parts:
        number = _number(stream, known)
        return number if float in parts else int(min(abs(number), 1e6)) if math.isfinite(number) else 1
    return str(stream.choice(["x", "cloth0", "body0", "left", "all"]))


def _number(stream: np.random.Generator, known: SceneKey) -> float:
    """Near the default, log-uniform over many decades, at an end of the range, or beyond it."""
    key, usual = known.key, known.default
    if isinstance(usual, int | float) and not isinstance(usual, bool) and usual and stream.random() < 0.5:
        return float(usual) * float(10 ** stream.normal())
    ends = [end for end in (key.least, key.most, key.above, key.below) if end is not None]
    if ends and stream.random() < 0.3:
        return float(stream.choice(ends))
    sign = -1 if stream.random() < 0.2 else 1
    decades = 300 if stream.random() < 0.1 else 4
    return sign * float(f"{10 ** stream.uniform(-decades, decades):.4g}")


def as_toml(scene: Mapping[str, Any]) -> str:
    """The tables as TOML."""
    lines: list[str] = []
    for name, table in scene.items():
        for one in table if isinstance(table, list) else [table]:
            if name == "effects":
                for effect, keys in one.items():
                    lines += [f"[effects.{effect}]", *(f"{key} = {_text(value)}" for key, value in keys.items())]
                continue
            lines.append(f"[[{name}]]" if isinstance(table, list) else f"[{name}]")
            lines += [f"{key} = {_text(value)}" for key, value in one.items()]
    return "\n".join(lines) + "\n"


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_text(inner)}' for key, inner in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(_text(each) for each in value)}]"
    return repr(value) if isinstance(value, float) else json.dumps(value)
