"""Earlier names of keyword arguments."""

import functools
import warnings
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from clothsim.base.errors import InputError

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
