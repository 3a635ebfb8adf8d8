"""Rules for usable drapes: what is measured of a drape, and the bounds that a recipe states for it in [usable]."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from clothsim.base.errors import InputError
from clothsim.base.inputs import is_number, refuse_unknown, shown


@dataclass(frozen=True)
class Rule:
    """A bound on a measured number.

    Attributes
    ----------
    of : str
        Name of what is measured.
    least : bool
        True where the bound is the least allowed value, False where it is the largest.
    unit : str
    meaning : str
        What is measured, for a sentence.
    """

    of: str
    least: bool
    unit: str
    meaning: str


RULES = {
    "stretch_min": Rule("stretch_min", True, "", "the least principal stretch of any step"),
    "stretch_max": Rule("stretch_max", False, "", "the largest principal stretch of any step"),
    "drop_max": Rule("drop", False, "m", "what the centre of a garment fell from its start"),
    "floor_max": Rule("floor", False, "m", "the distance (RMS) to the same drape from a second start"),
}
"""By the key of [usable]. A garment that fell off was worn no more: `drop`; the floor is the error of a label."""


def checked_rules(given: Mapping[str, Any], until: str) -> dict[str, Any]:
    """The rules of a recipe: `at_rest`, true where the drapes run until rest, and bounds. InputError for another key.

    Examples
    --------
    >>> checked_rules({"stretch_max": 1.2}, "rest")
    {'at_rest': True, 'stretch_max': 1.2}
    """
    refuse_unknown("usable", given, ("at_rest", *RULES))
    at_rest = given.get("at_rest", until == "rest")
    if not isinstance(at_rest, bool):
        raise InputError(f"usable.at_rest is {shown(at_rest)}.", "Give true or false.")
    bounds = {key: value for key, value in given.items() if key != "at_rest"}
    for key, value in bounds.items():
        if not is_number(value) or not 0 < value < math.inf:
            raise InputError(f"usable.{key} is {shown(value)}.", "Give a positive number.")
    return {"at_rest": at_rest, **{key: float(value) for key, value in bounds.items()}}


def broken_rule(rules: Mapping[str, Any], at_rest: bool, measured: Mapping[str, float | None]) -> tuple[str, str]:
    """The first rule that a drape breaks and a sentence on it; both empty where it meets all.

    measured: by the name of what is measured; None where it is not known, which breaks the rule.

    Examples
    --------
    >>> broken_rule({"at_rest": False, "stretch_max": 1.2}, False, {"stretch_max": 1.31})
    ('stretch_max', 'The largest principal stretch of any step is 1.31; stretch_max = 1.2.')
    """
    if rules.get("at_rest") and not at_rest:
        return "not at rest", ""
    for key, rule in RULES.items():
        if key not in rules:
            continue
        value, bound = measured.get(rule.of), rules[key]
        if value is None or (value < bound if rule.least else value > bound):
            known = "not known" if value is None else f"{value:.4g} {rule.unit}".strip()
            return key, f"{rule.meaning[0].upper()}{rule.meaning[1:]} is {known}; {key} = {bound:g}."
    return "", ""
