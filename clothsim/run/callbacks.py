"""Callbacks of a run, checked before its first step."""

from typing import Any

from clothsim.base.errors import InputError


def refuse_uncallable(**callbacks: Any) -> None:
    """InputError for a callback that is neither None nor callable.

    Parameters
    ----------
    **callbacks
        Each by the name of its argument.
    """
    for name, value in callbacks.items():
        if value is not None and not callable(value):
            raise InputError(f"{name} is {value!r:.80}, which cannot be called.", f"Give a function: {name}=print.")
