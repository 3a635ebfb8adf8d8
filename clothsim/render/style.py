"""Styles of a picture: fields on the cloth, print on white paper, woven fabric."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Style:
    """What a picture adds to its surfaces and leaves out behind them.

    Parameters
    ----------
    colour : str
        Colour of the cloth where none is asked for, as of `picture.draw`.
    paper : bool
        White behind everything; else a light gradient with a soft shadow on the floor.
    body_opacity : float
        1: bodies hide what is behind them.
    outlines : bool
        Ink along borders, silhouettes and folds.
    woven : bool
        Ribs of a twill, fixed to the material, and the sheen of fibres seen at a grazing angle.
    """

    colour: str = "stretch"
    paper: bool = False
    body_opacity: float = 1.0
    outlines: bool = False
    woven: bool = False

    @property
    def needs_geometry(self) -> bool:
        """True where pixels must know which surface they show."""
        return self.outlines or self.woven


STYLES = {
    "fields": Style(),
    "print": Style(paper=True, body_opacity=0.5, outlines=True),
    "fabric": Style(colour="plain", woven=True),
}
"""Styles by name; the first is the default."""
