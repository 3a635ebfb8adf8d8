"""Quantities in words: lengths in a fitting unit, counts with their noun."""


def length(metres: float) -> str:
    """A length in m, mm or um."""
    if metres >= 1:
        return f"{metres:.3g} m"
    if metres >= 1e-3:
        return f"{1e3 * metres:.3g} mm"
    return f"{1e6 * metres:.3g} um"


def many(count: int, what: str) -> str:
    """A number of things, in the plural where it is not one."""
    return f"{count:,} {what}{'' if count == 1 else 's'}"
