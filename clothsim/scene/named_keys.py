"""Keys of a scene's tables that name files."""

from collections.abc import Iterator
from typing import Any

from clothsim.keys.generator_keys import GENERATOR_KEYS

ENDING = ".npy"


def names_array(value: Any) -> bool:
    """True for the name of a file of numbers."""
    return isinstance(value, str) and value.endswith(ENDING)


def named_arrays(where: str, table: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], str]]:
    """Each key of nested tables that names a file of numbers: what has it, its table, the key."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from named_arrays(f"{where}_{key}", value)
        elif names_array(value):
            yield f"{where}_{key}", table, key


def named_keys(data: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], str]]:
    """Each key of a scene that names files: a name for its owner, its table, the key."""
    for section in ("cloth", "body", "rigid"):
        tables = data.get(section, [])
        for k, table in enumerate([tables] if isinstance(tables, dict) else tables):
            if isinstance(table.get("mesh"), str) and table["mesh"] not in GENERATOR_KEYS:  # else in the text
                yield f"{section}{k}", table, "mesh"
            if "model" in table and table["model"] != "mannequin":
                yield f"{section}{k}", table, "model"
            if "model" in table:
                yield from _named_clip(f"{section}{k}_motion", table)
            if "frames" in table:
                yield f"{section}{k}", table, "frames"
    for name, keys in data["effects"].items():
        yield from named_arrays(f"effect_{name}", keys)
    if data["seed"].get("file"):
        yield "seed", data["seed"], "file"


def _named_clip(owner: str, table: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], str]]:
    """The file of the motion of a body model."""
    from clothsim.files.characters.gait import is_packaged

    motion = table.get("motion")
    keyed = (motion, "clip") if isinstance(motion, dict) else (table, "motion")
    if motion and not (keyed[0][keyed[1]] == "own" or is_packaged(keyed[0][keyed[1]])):
        yield owner, *keyed
