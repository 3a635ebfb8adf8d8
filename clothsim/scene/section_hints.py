"""Remedies for keys that stand in the wrong section of a scene."""

from collections.abc import Sequence

from clothsim.scene.effects import EFFECTS
from clothsim.scene.generator_keys import GENERATOR_KEYS
from clothsim.scene.keys import nearest
from clothsim.scene.mesh_keys import BodyTable, ClothTable, FilePart
from clothsim.scene.rigid_keys import RigidTable
from clothsim.scene.schema import keys_of
from clothsim.scene.settings import Contact, RunSettings, Seed, Solver
from clothsim.scene.typed_effects import TYPED_EFFECTS
from clothsim.scene.value_checks import as_toml

MOST = 3
"""Sections that a remedy lists."""


def section_remedy(name: str, sections: Sequence[str]) -> str:
    """The section to which a name at the top of a scene belongs, or the nearest section."""
    return home_of(name) or nearest(name, sections) or f"Known: {', '.join(sections)}."


def home_of(name: str) -> str:
    """Remedy that names the sections that have a key of this name; empty where none has."""
    if name in EFFECTS:
        return effect_remedy(name)
    settings = [f"[{kind.section}]" for kind in (Solver, RunSettings, Seed, Contact) if name in keys_of(kind)]
    meshes = [f"[{kind.section}]" for kind in (ClothTable, BodyTable, RigidTable) if name in keys_of(kind)]
    files = ["a mesh file"] if name in keys_of(FilePart) else []
    generators = [f"mesh = {mesh!r}" for mesh, kind in GENERATOR_KEYS.items() if name in keys_of(kind)]
    effects = [f"[effects.{effect}]" for effect, kind in TYPED_EFFECTS.items() if name in keys_of(kind)]
    homes = [*settings, *meshes, *files, *generators, *effects]
    if not homes:
        return ""
    listed = ", ".join(homes[:MOST]).replace("'", '"')
    return f"{name} is a key of {listed}{' and others' if len(homes) > MOST else ''}."


def effect_remedy(name: str) -> str:
    """The form in which a scene file names an effect, with its first key."""
    keys = (
        [key for key in keys_of(TYPED_EFFECTS[name]).values() if key.default not in ((), None)]
        if (name in TYPED_EFFECTS)
        else []
    )
    example = f", with {keys[0].name} = {as_toml(keys[0].default)} under it" if keys else ""
    return f"{name} is an effect: write [effects.{name}]{example}."
