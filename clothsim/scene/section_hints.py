"""Remedies for keys that stand in the wrong section of a scene."""

from collections.abc import Sequence

from clothsim.scene.effects import EFFECTS
from clothsim.scene.keys import nearest
from clothsim.scene.schema import keys_of
from clothsim.scene.settings import RunSettings, Seed, Solver
from clothsim.scene.typed_effects import TYPED_EFFECTS
from clothsim.scene.value_checks import as_toml


def section_remedy(name: str, sections: Sequence[str]) -> str:
    """The section to which a name at the top of a scene belongs, or the nearest section."""
    if name in EFFECTS:
        return effect_remedy(name)
    for kind in (Solver, RunSettings, Seed):
        if name in keys_of(kind):
            return f"{name} belongs to [{kind.section}]."
    return nearest(name, sections) or f"Known: {', '.join(sections)}."


def effect_remedy(name: str) -> str:
    """The form in which a scene file names an effect, with its first key."""
    keys = (
        [key for key in keys_of(TYPED_EFFECTS[name]).values() if key.default not in ((), None)]
        if (name in TYPED_EFFECTS)
        else []
    )
    example = f", with {keys[0].name} = {as_toml(keys[0].default)} under it" if keys else ""
    return f"{name} is an effect: write [effects.{name}]{example}."
