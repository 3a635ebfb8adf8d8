"""Keys of an effect that a user registers: the class that its builder names, or one made of its keywords."""

import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, make_dataclass
from typing import Annotated, Any, Self

from clothsim.keys.frozen import content_of, frozen
from clothsim.keys.schema import Key
from clothsim.keys.typed_effects import EffectKeys

SUPPLIED = ("contacts", "built")
"""Keywords of builders that no scene gives: the names of the contacts that are on, and the energies built so far, by
name."""


@dataclass(frozen=True, kw_only=True)
class KeywordKeys(EffectKeys):
    """The keywords of a builder: their names are checked, their values are for the builder to check."""

    def __post_init__(self) -> None:
        """Take every value as it is."""

    @classmethod
    def of_known_keys(cls, where: str, keys: Mapping[str, Any]) -> Self:
        """The section of a table whose keys it has."""
        return cls(**{f"{name}_": frozen(value) for name, value in keys.items()})


def signature_of(builder: Callable[..., Any]) -> inspect.Signature:
    """The signature of a builder, with annotations that are texts evaluated where they can be."""
    try:
        return inspect.signature(builder, eval_str=True)
    except NameError:  # a name for type checkers alone
        return inspect.signature(builder)


def takes_keys(builder: Callable[..., Any]) -> bool:
    """True for builder(world, keys), False for builder(world, *, key=default)."""
    return len(_positional(builder)) > 1


def keys_of_builder(builder: Callable[..., Any], name: str = "") -> type[EffectKeys]:
    """The class of the keys of an effect `name`; by default it has the name of the builder."""
    if takes_keys(builder):
        return _positional(builder)[1].annotation
    meanings = _parameters(inspect.getdoc(builder) or "")
    declared = []
    for key, parameter in signature_of(builder).parameters.items():
        if parameter.kind is parameter.KEYWORD_ONLY and key not in SUPPLIED:
            kind = Any if parameter.annotation is parameter.empty else parameter.annotation
            annotation = Annotated[kind, Key(*meanings.get(key, ("", "-")))]  # type: ignore[valid-type]
            declared.append((f"{key}_", annotation, *_default(parameter)))  # no field hides a method of the section
    name = name or getattr(builder, "__name__", "own")
    namespace = {"section": f"effects.{name}"}
    return make_dataclass(name, declared, bases=(KeywordKeys,), namespace=namespace, frozen=True, kw_only=True)


def is_builder(builder: Any) -> bool:
    """True for a callable of a world, or of a world and its keys, whose keywords all have defaults."""
    try:
        positional, parameters = _positional(builder), signature_of(builder).parameters.values()
    except (TypeError, ValueError):  # nothing that can be called, or a class of C without a signature
        return False
    required = [p for p in parameters if p.kind is p.KEYWORD_ONLY and p.default is p.empty and p.name not in SUPPLIED]
    keys = [p.annotation for p in positional[1:]]
    typed = all(isinstance(each, type) and issubclass(each, EffectKeys) for each in keys)
    return bool(positional) and len(keys) <= 1 and typed and not required


def _positional(builder: Callable[..., Any]) -> list[inspect.Parameter]:
    parameters = signature_of(builder).parameters.values()
    return [p for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]


def _default(parameter: inspect.Parameter) -> tuple[Any, ...]:
    """The default of a keyword as that of a field, which hashes."""
    if parameter.default is parameter.empty:
        return ()
    value = frozen(parameter.default)
    return (field(default=value if type(value).__hash__ is not None else content_of(value)),)


def _parameters(docstring: str) -> dict[str, tuple[str, str]]:
    """Meaning and unit of each parameter of a numpydoc docstring: "rate : float [1/s]" and the indented lines below."""
    entries = {}
    for name, kind, below in re.findall(r"^(\w+) : (.*)((?:\n[ \t]+.+)*)", docstring, re.M):
        text = " ".join((below or kind).split())
        unit = re.search(r"\[([^\]]+)\]", f"{kind} {text}")
        entries[name] = (text.split(". ")[0].rstrip("."), unit[1] if unit else "-")
    return entries
