"""Values and keywords that a user gave: their kind, how a message shows them, earlier names."""

import difflib
import functools
import inspect
import warnings
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ParamSpec, TypeVar

from clothsim.base.errors import ClothsimError, InputError, shortened

SYNONYMS = {
    **dict.fromkeys(("border", "edge", "edges"), "boundary"),
    **dict.fromkeys(("step", "timestep", "time_step", "delta_t", "h"), "dt"),
    "upper": "top",
    "lower": "bottom",
    "fps": "frames_per_second",
    "gravity": "acceleration",
    "g": "acceleration",
    "E": "youngs_modulus",
    "nu": "poisson_ratio",
    "--camera": "--view",
    "--resolution": "--size",
    "--fps": "--frames-per-second",
    "--on": "--to",
    "--to": "--on",
}
"""Words that mean a known name whose letters are not like theirs."""
LONGEST = 120
"""Letters of a value in a message."""


def did_you_mean(name: Any, known: Iterable[str], least: float = 0.5) -> str:
    """A question for the nearest known name; empty where none is at least that similar, from 0 to 1."""
    if SYNONYMS.get(str(name)) in (known := list(known)):
        return f"Did you mean {SYNONYMS[str(name)]!r}?"
    close = difflib.get_close_matches(str(name), list(known), n=1, cutoff=least)
    return f"Did you mean {close[0]!r}?" if close else ""


def nearest_or_known(where: str, key: str, known: list[str]) -> str:
    """The remedy for an unknown key: the nearest known one, else all."""
    return did_you_mean(key, known) or (f"Known: {', '.join(known)}." if known else f"{where} takes no keys.")


def refuse_unknown(
    where: str,
    given: Iterable[str],
    known: Iterable[str],
    remedy: Callable[[str, str, list[str]], str] = nearest_or_known,
) -> None:
    """InputError for the first key of `given` that is not `known`."""
    names = list(known)
    for key in given:
        if key not in names:
            raise InputError(f"{where} has no key {key!r}.", remedy(where, str(key), names))


def as_table(where: str, value: Any, remedy: str = "") -> Mapping[str, Any]:
    """`value` as a table of keys; InputError otherwise."""
    if not isinstance(value, Mapping):
        hint = remedy or f"Write its keys under [{where}]."
        raise InputError(f"{where} must be a table of keys, not {shown(value)}.", hint)
    return value


def is_number(value: Any) -> bool:
    """True for an int or a float; not for a truth value."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def shown(value: Any) -> str:
    """A value in a message: on one line and short, of an array its shape."""
    if getattr(value, "shape", ()):
        return f"an array of shape {value.shape}"
    return shortened(" ".join(repr(value).split()), LONGEST)


def called(where: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """What a function of the user returns. InputError with its name and its error where it raises one."""
    try:
        return function(*arguments)
    except ClothsimError:
        raise
    except Exception as error:
        raise raised(where, function, error) from error


def raised(where: str, function: Callable[..., Any], error: Exception) -> InputError:
    """The error for what a function of the user raised."""
    name = getattr(function, "__qualname__", type(function).__name__)
    return InputError(f"{where}: the function {name} raised {type(error).__name__}: {error}.", "Correct the function.")


def refuse_uncallable(**callbacks: Any) -> None:
    """InputError for a callback that is neither None nor callable.

    **callbacks: each by the name of its argument.
    """
    for name, value in callbacks.items():
        if value is not None and not callable(value):
            raise InputError(f"{name} is {value!r:.80}, which cannot be called.", f"Give a function: {name}=print.")


Given = ParamSpec("Given")
Result = TypeVar("Result")


def renamed(**now: str) -> Callable[[Callable[Given, Result]], Callable[Given, Result]]:
    """Decorator of a function whose keywords were renamed: `now` maps the earlier name to the present one.

    The earlier one still works, with a DeprecationWarning; InputError where both are given.
    """

    def decorate(function: Callable[Given, Result]) -> Callable[Given, Result]:
        @functools.wraps(function)
        def called(*args: Any, **keywords: Any) -> Result:
            for before in [name for name in now if name in keywords]:
                if now[before] in keywords:
                    raise InputError(f"{before} and {now[before]} are given.", f"{before} is now {now[before]}.")
                warnings.warn(f"{before} is now {now[before]}.", DeprecationWarning, stacklevel=2)
                keywords[now[before]] = keywords.pop(before)
            return function(*args, **keywords)

        return called

    return decorate


def with_remedies(
    hint: Callable[[str], str] = lambda name: "",
) -> Callable[[Callable[Given, Result]], Callable[Given, Result]]:
    """Decorator of a public function: arguments that it does not take, or lacks, are InputErrors with a remedy.

    hint: what to do about an unknown keyword that is not like a known one.

    Examples
    --------
    >>> @with_remedies()
    ... def half(number):
    ...     return number / 2
    >>> half(numbers=3)
    Traceback (most recent call last):
        ...
    clothsim.base.errors.InputError: half() got an unexpected keyword argument 'numbers'. Did you mean 'number'?
    """

    def decorate(function: Callable[Given, Result]) -> Callable[Given, Result]:
        signature = inspect.signature(function)
        usage = f"Call it as {function.__name__}({', '.join(name for name in signature.parameters if name != 'self')})."

        @functools.wraps(function)
        def called(*args: Given.args, **keywords: Given.kwargs) -> Result:
            try:
                signature.bind(*args, **keywords)
            except TypeError as error:
                unknown = next((name for name in keywords if name not in signature.parameters), "")
                remedy = did_you_mean(unknown, signature.parameters, 0.75) or hint(unknown) if unknown else ""
                reason = str(error).replace("missing a required argument:", "needs the argument")
                if unknown:  # comes first
                    reason = f"got an unexpected keyword argument {unknown!r}"
                elif not reason.startswith(("got", "needs")):
                    reason = f"got {reason}"
                raise InputError(f"{function.__name__}() {reason}.", remedy or usage) from error
            return function(*args, **keywords)

        return called

    return decorate
