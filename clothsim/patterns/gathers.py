"""Gathers: seams whose sides differ in length, and the strain that their cells take.

Both sides of a seam have equally many samples, so that the cells beside it cannot fold between two stitches: they are
strained, one side shorter and the other longer, and the cloth beyond them folds freely. For a ratio g of the lengths
and rows of cells of one stiffness the least energy is at 2 g / (1 + g) for the shorter and 2 / (1 + g) for the longer
side; the strained strip is one row high, whatever the size is.
"""

from clothsim.patterns.pattern import Pattern

LEAST = 1.25
"""Ratio of the lengths of both sides from which on a seam is a gather."""
STRIP = 0.005
"""Height of the strained strip that is no wider than a seam's own stitching [m]."""
ROW = 0.866
"""Height of a row of cells, as a multiple of the spacing."""
NAMED = 4


def gather_ratios(pattern: Pattern) -> dict[str, float]:
    """Ratio of the longer to the shorter side of each seam that is a gather, by name, the largest first."""
    found = {}
    for stitch in pattern.stitches:
        first, second = (pattern.panels[side.panel].edge_length(side.edge) for side in stitch.sides)
        ratio = max(first, second) / min(first, second)
        if ratio >= LEAST:
            a, b = stitch.sides
            found[f"{a.panel}.{a.edge} to {b.panel}.{b.edge}"] = ratio
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def gather_notes(pattern: Pattern, spacing: float) -> tuple[str, ...]:
    """A note with the gathers of a pattern, the strain beside them and the spacing [m] that confines it to 5 mm."""
    found = gather_ratios(pattern)
    height, needed = ROW * spacing, STRIP / ROW
    if not found or height <= STRIP:
        return ()
    named = ", ".join(f"{name} ({ratio:.2g} : 1)" for name, ratio in list(found.items())[:NAMED])
    named += f" and {len(found) - NAMED} more" if len(found) > NAMED else ""
    most = max(found.values())
    return (
        f"gathered: {named}; the row of cells beside such a seam, {1e3 * height:.2g} mm high, is strained to about"
        f" {2 / (1 + most):.2f} and {2 * most / (1 + most):.2f}; --size {1e3 * needed:.2g}mm makes it"
        f" {1e3 * STRIP:.2g} mm",
    )
