"""Remedies for keys that stand in the wrong section of a scene."""

import difflib
from collections.abc import Sequence

from clothsim.base.inputs import did_you_mean
from clothsim.keys.generator_keys import GENERATOR_KEYS
from clothsim.keys.key_table import KeyTable
from clothsim.keys.mesh_keys import BodyTable, ClothTable, FilePart, RigidTable, RodTable
from clothsim.keys.schema import keys_of
from clothsim.keys.settings import Contact, RunSettings, Seed, Solver
from clothsim.keys.typed_effects import TYPED_EFFECTS
from clothsim.keys.value_checks import as_toml

MOST = 3
"""Sections that a remedy lists."""
ELSEWHERE = {
    **dict.fromkeys(
        ("color", "colour", "texture"), "A picture has colours: `clothsim render DIR -o FILE --colour navy`."
    ),
    **dict.fromkeys(("steps", "n_steps"), "The steps follow from run.duration and solver.dt."),
    **dict.fromkeys(
        ("device", "gpu", "backend"), "Everything runs on the CPU: solver.threads is the number of its threads."
    ),
}
"""What to do about names that no section has."""


def section_remedy(name: str, sections: Sequence[str]) -> str:
    """The section to which a name at the top of a scene belongs, or the nearest section."""
    known = f"Known: {', '.join(sections)}."
    return (
        home_of(name)
        or did_you_mean(name, sections, 0.75)
        or nearest_path(name)
        or did_you_mean(name, sections)
        or known
    )


def nearest_path(name: str) -> str:
    """A question for the path of the key whose name is much like this one; empty where there is none.

    Examples
    --------
    >>> nearest_path("densty"), nearest_path("nothing")
    ("Did you mean 'cloth.density'?", '')
    """
    kinds: tuple[type[KeyTable], ...] = (Solver, RunSettings, ClothTable, BodyTable, *TYPED_EFFECTS.values())
    known = list(dict.fromkeys(key for kind in kinds for key in keys_of(kind)))
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.75)
    return f"Did you mean {paths_of(close[0])[0]!r}?" if close else ""


def home_of(name: str) -> str:
    """Remedy that names the sections that have a key of this name, or what to do without one; else empty."""
    if name in TYPED_EFFECTS:
        return effect_remedy(name)
    if name in ELSEWHERE:
        return ELSEWHERE[name]
    settings = [f"[{kind.section}]" for kind in (Solver, RunSettings, Seed, Contact) if name in keys_of(kind)]
    meshes = [f"[{kind.section}]" for kind in (ClothTable, BodyTable, RigidTable, RodTable) if name in keys_of(kind)]
    files = ["a mesh file"] if name in keys_of(FilePart) else []
    generators = [f"mesh = {mesh!r}" for mesh, kind in GENERATOR_KEYS.items() if name in keys_of(kind)]
    effects = [f"[effects.{effect}]" for effect, kind in TYPED_EFFECTS.items() if name in keys_of(kind)]
    homes = [*settings, *meshes, *files, *generators, *effects]
    if not homes:
        return ""
    listed = ", ".join(homes[:MOST]).replace("'", '"')
    return f"{name} is a key of {listed}{' and others' if len(homes) > MOST else ''}."


def paths_of(name: str) -> list[str]:
    """Paths, such as "cloth.fabric", of the keys of this name."""
    kinds: tuple[type[KeyTable], ...] = (
        Solver, RunSettings, Seed, Contact, ClothTable, BodyTable, RigidTable, RodTable
    )  # fmt: skip
    found = [f"{kind.section}.{name}" for kind in kinds if name in keys_of(kind)]
    found += [
        f"{mesh}.{name}" for mesh in ("cloth", "body") for kind in GENERATOR_KEYS.values() if name in keys_of(kind)
    ]
    found += [f"effects.{effect}.{name}" for effect, kind in TYPED_EFFECTS.items() if name in keys_of(kind)]
    return list(dict.fromkeys(found))


def effect_remedy(name: str) -> str:
    """The form in which a scene file names an effect, with its first key."""
    declared = keys_of(TYPED_EFFECTS[name]).values() if name in TYPED_EFFECTS else ()
    keys = [key for key in declared if key.default not in ((), None)]
    example = f", with {keys[0].name} = {as_toml(keys[0].default)} under it" if keys else ""
    return f"{name} is an effect: write [effects.{name}]{example}."
