"""Reference of the keys of a scene: every section with type, default, unit, range and meaning of its keys."""

import inspect
from collections.abc import Iterator
from dataclasses import dataclass

from clothsim.keys.effect_tables import Crease, Gust, Motion, PinGroup, Seam, SeamLine, Spring, Vortex
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
    TieKeys,
)
from clothsim.keys.schema import SceneKey, keys_of, type_in_words
from clothsim.keys.settings import Contact, RunSettings, Seed, Solver
from clothsim.keys.typed_effects import TYPED_EFFECTS
from clothsim.keys.value_checks import as_toml
from clothsim.scene.effects import EFFECTS

NESTED: dict[str, tuple[tuple[str, type], ...]] = {
    "pins": (("effects.pins.group", PinGroup),),
    "springs": (("effects.springs.spring", Spring),),
    "seams": (("effects.seams.seam", Seam), ("effects.seams.seam.from, .to", SeamLine)),
    "rest_angle": (("effects.rest_angle.crease", Crease),),
    "air": (('effects.air.wind, kind = "gust"', Gust), ('effects.air.wind, kind = "vortex"', Vortex)),
}
"""The nested tables of effects."""

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
    """The reference page: a table of the keys for each section.

    Returns
    -------
    str
        Markdown.
    """
    parts = ["# Scene reference", "Every key that a scene takes; `clothsim keys SECTION` prints the same."]
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
    yield _of("cloth", ClothTable, "A cloth; several are [[cloth]].")
    yield _of("body", BodyTable, "A body that cloth collides with; several are [[body]].")
    yield _of("body, animated", FramesTable)
    yield _of("body of a model", ModelTable)
    yield _of("body.motion of a model", ClipKeys)
    yield _of("body.motion", Motion)
    yield _of("rigid", RigidTable)
    yield _of("rigid.joint", JointKeys)
    yield _of("rigid.tie", TieKeys)
    yield _of("cloth or body of a file", FilePart)
    yield _of("cloth of a sewing pattern", PatternFile)
    for name, kind in GENERATOR_KEYS.items():
        yield _of(f'mesh = "{name}"', kind)
    for name, effect in EFFECTS.items():
        own = "" if name in TYPED_EFFECTS else f"{effect.summary[:1].upper()}{effect.summary[1:]}."
        yield _of(f"effects.{name}", effect.keys_class, own)
        for nested, kind in NESTED.get(name, ()):
            yield _of(nested, kind)
    for kind in (Solver, Contact, RunSettings, Seed):
        yield _of(kind.section, kind)


def _of(name: str, kind: type, summary: str = "") -> Section:
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
