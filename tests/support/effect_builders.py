"""Effects built from keywords, as a scene's table gives them: `gravity(world, acceleration=(0, 0, -1))`."""

from clothsim.keys.typed_effects import SUPPLIED
from clothsim.scene.effects import EFFECTS


def built(name, world, **keys):
    """The effect of a table of keys; `contacts` and `built` are what else a builder may take."""
    supplied = {key: keys.pop(key) for key in SUPPLIED if key in keys}
    return EFFECTS[name].build(world, EFFECTS[name].keys_class.parsed(f"effects.{name}", keys), supplied)


def _builder(name):
    def build(world, **keys):
        return built(name, world, **keys)

    build.__name__ = name
    return build


globals().update({name: _builder(name) for name in EFFECTS})
