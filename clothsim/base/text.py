"""Text of reports: tables with aligned columns, lengths in a fitting unit, counts with their noun."""

from collections.abc import Sequence


def text_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Format a table, columns two spaces apart: text to the left, numbers (and blanks) to the right.

    >>> print(text_table(["name", "ms"], [["solve", "12"], ["assembly", "3"]]))
    name      ms
    ------------
    solve     12
    assembly   3
    """
    columns = list(zip(header, *rows, strict=True))
    widths = [max(len(cell) for cell in column) for column in columns]
    right = [any(cell for cell in column[1:]) and all(_number(cell) for cell in column[1:]) for column in columns]
    lines = [
        "  ".join(
            cell.rjust(width) if numeric else cell.ljust(width)
            for cell, width, numeric in zip(row, widths, right, strict=True)
        ).rstrip()
        for row in (header, *rows)
    ]
    return "\n".join([lines[0], "-" * max(len(line) for line in lines), *lines[1:]])


def _number(cell: str) -> bool:
    """True for a number, with thousands separated or with a percent sign, and for an empty cell."""
    text = cell.replace(",", "").rstrip("% ").strip()
    return not text or text == "-" or text.replace(".", "", 1).replace("e-", "", 1).replace("-", "", 1).isdigit()


def length_text(metres: float) -> str:
    """A length in m, mm or um."""
    if metres >= 0.9995:  # what would be 1e+03 in the smaller unit
        return f"{metres:.3g} m"
    if metres >= 0.9995e-3:
        return f"{1e3 * metres:.3g} mm"
    return f"{1e6 * metres:.3g} um"


def percent(fraction: float, sign: str = "") -> str:
    """A fraction in percent with two digits, in whole percent from 100 on; sign: "+" writes it of positive ones too.

    >>> percent(0.00223), percent(1.0), percent(0.031, "+")
    ('0.22 %', '100 %', '+3.1 %')
    """
    value = 100 * fraction
    return f"{value:{sign}.2g} %" if abs(value) < 99.5 else f"{value:{sign}.0f} %"


def many(count: int, what: str) -> str:
    """A number of things, in the plural where it is not one."""
    return f"{count:,} {what}{'' if count == 1 else 's'}"


def printable(text: str) -> str:
    r"""`text` with its control characters spelled out: names from a file would steer a terminal.

    >>> printable("front\x1b[2J\nback")
    'front\\x1b[2J\nback'
    """
    return (
        text
        if text.isprintable()
        else "\n".join("".join(c if c.isprintable() else ascii(c)[1:-1] for c in line) for line in text.split("\n"))
    )
