"""Sewing pattern of a DXF drawing and its sewing file."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.files.patterns.dxf.drawing import SEW, Drawing, Piece, read_drawing
from clothsim.files.patterns.dxf.edges import edges_of
from clothsim.files.patterns.dxf.outline import Part, loop_of, polygon, reflected, unfolded
from clothsim.files.patterns.dxf.sewing_file import PanelKeys, SewingFile, read_sewing_file
from clothsim.patterns.pattern import Panel, Pattern
from clothsim.patterns.specification import USUAL_UNITS

ON_OUTLINE, ON_CUT_LINE = 2e-3, 3e-2
"""Largest distance of a notch from the outline, and from a sew line inside the cut line that it lies on [m]."""
LEVEL = np.radians(1.0)
"""Angle below the horizontal of a thread line that counts as horizontal [rad]."""


def read_dxf_pattern(path: str | Path, seams: str | Path | None = None, sewn: bool = True) -> Pattern:
    """Read a DXF drawing of AAMA or ASTM as a sewing pattern.

    Parameters
    ----------
    path : str or Path
        The drawing: a block for each piece, its outline on layer 14 (sew line) or 1.
    seams : str or Path, optional
        TOML file with seams and placement; None: the file NAME.toml beside NAME.dxf.
    sewn : bool
        False: seams and placement may be absent, as where a pattern is looked at.

    Returns
    -------
    Pattern
        In metres and radians. Edges end at corners and notches, and count from 0, counter-clockwise.

    Raises
    ------
    MissingPackageError
        ezdxf is not installed.
    InputError
        An open outline, a missing piece, panel, edge, seam or placement, by name.
    """
    file = Path(path)
    sewing_path = file.with_suffix(".toml") if seams is None else Path(seams)
    given = seams is not None or sewing_path.is_file()
    sewing = read_sewing_file(sewing_path) if given else SewingFile()
    drawing = read_drawing(file, sewing.units, sewing.layer)
    of_size, size_notes = _of_size(file.name, drawing, sewing.size)
    notes = (*drawing.notes, *size_notes)
    used = {keys.piece for keys in sewing.panels.values()}
    others = [name for name in of_size if name not in used]
    left_out = others if sewn and used else []
    tables = {**sewing.panels, **{name: PanelKeys(name, notches=sewing.notches) for name in others}}
    panels = {name: _panel(name, keys, of_size, sewing) for name, keys in tables.items() if name not in left_out}
    if sewn:
        _refuse_unsewn(file, sewing_path, given, sewing, panels)
    if left_out:
        notes += (f"pieces without a table [panels.NAME] are left out: {', '.join(left_out)}",)
    source = {"properties": {"units_in_meter": USUAL_UNITS}}
    try:
        return Pattern(panels, sewing.seams, notes, source)
    except InputError as error:
        raise InputError(f"{sewing_path.name}: {error.sentence}", error.remedy) from error


def _of_size(file: str, drawing: Drawing, given: str) -> tuple[dict[str, Piece], tuple[str, ...]]:
    """Pieces of one size by name, and a note with the sizes that are left out.

    The size is the one that is given, else the sample size; of a drawing that names none, that of the inserted blocks.
    """
    pieces, sizes = drawing.pieces, sorted({piece.size for piece in drawing.pieces if piece.size})
    if given and given not in sizes:
        raise InputError(f"{file} has no pieces of size {given!r}.", f"Sizes: {', '.join(sizes) or 'none is named'}.")
    size = given or (drawing.sample_size if drawing.sample_size in sizes else "")
    if size:
        pieces = tuple(piece for piece in pieces if piece.size in (size, ""))
    elif any(piece.inserted for piece in pieces):
        pieces = tuple(piece for piece in pieces if piece.inserted)
    found: dict[str, Piece] = {}
    for piece in pieces:
        if piece.name in found:
            both = f"{found[piece.name].size or 'unnamed'} and {piece.size or 'unnamed'}"
            raise InputError(
                f"{file} has the piece {piece.name} twice, of sizes {both}.",
                f'Choose a size in the file of --seams: size = "{sizes[0]}".' if len(sizes) > 1 else "Rename one.",
            )
        found[piece.name] = piece
    left = [each for each in sizes if each not in {piece.size for piece in found.values()}]
    read = ", ".join(sorted({piece.size for piece in found.values()} - {""}))
    return found, ((f"size {read}; left out: {', '.join(left)}",) if left else ())


def _panel(name: str, keys: PanelKeys, pieces: dict[str, Piece], sewing: SewingFile) -> Panel:
    if keys.piece not in pieces:
        raise InputError(f"Panel {name}: there is no piece {keys.piece!r}.", f"Pieces: {', '.join(pieces)}.")
    piece = pieces[keys.piece]
    half = loop_of(piece.name, piece.layer, piece.parts)
    loop = unfolded(half, piece.mirror)
    notches, curve_points = piece.notches if keys.notches else np.zeros((0, 2)), piece.curve_points
    if loop is not half and piece.mirror is not None:
        notches, curve_points = (
            np.concatenate([points, reflected(points, piece.mirror)]) for points in (notches, curve_points)
        )
    reach = ON_CUT_LINE if piece.layer == SEW else ON_OUTLINE
    vertices, edges = edges_of(loop, notches, curve_points, reach, sewing.corner)
    turn = keys.turn + _upright(piece.grain)
    cosine, sine = np.cos(turn), np.sin(turn)
    matrix = np.array([[cosine, sine], [-sine, cosine]])  # rows are points
    border = polygon(loop) @ matrix
    middle = (border.min(axis=0) + border.max(axis=0)) / 2
    flat = Panel(name, vertices @ matrix - middle, edges, np.zeros(3), keys.rotation, keys.label)
    panel = mirrored(flat) if keys.mirrored else flat
    return panel if keys.position is None else replace(panel, translation=keys.position)


def mirrored(panel: Panel) -> Panel:
    """The reflection of a panel in x; its edges keep their numbers."""
    axis = np.array([[0.0, 0.0], [0.0, 1.0]])
    ends = [(panel.vertices[edge.start], panel.vertices[edge.end]) for edge in panel.edges]
    drawn = (Part(*both, edge.curve) for both, edge in zip(ends, panel.edges, strict=True))
    edges = tuple(replace(edge, curve=part.mirrored(axis).curve) for edge, part in zip(panel.edges, drawn, strict=True))
    return replace(panel, vertices=panel.vertices * [-1, 1], edges=edges)


def _upright(grain: Floats | None) -> float:
    """Turn that makes a thread line upright [rad], by a quarter turn at most; a horizontal one counter-clockwise."""
    if grain is None or not np.ptp(grain, axis=0).any():
        return 0.0
    along = grain[1] - grain[0]
    angle = float(np.arctan2(along[1], along[0])) % np.pi
    return np.pi / 2 - (angle - np.pi if angle > np.pi - LEVEL else angle)


def _refuse_unsewn(file: Path, sewing_path: Path, given: bool, sewing: SewingFile, panels: dict[str, Panel]) -> None:
    """InputError for a drawing without seams, or with panels that lie nowhere."""
    look = f"`clothsim check {file.name} -o edges.svg` draws the edges with their numbers."
    if not given:
        raise InputError(f"{file.name} names no seams, and there is no {sewing_path}.", f"Write them to it: {look}")
    if not sewing.seams and len(panels) > 1:
        raise InputError(f"{sewing_path.name} has no [[seam]].", look)
    lost = [name for name in panels if name not in sewing.panels or sewing.panels[name].position is None]
    if lost and len(panels) > 1:
        raise InputError(
            f"{sewing_path.name} places no panel {', '.join(lost)}.",
            f"Give each its place in metres, y upward from the floor: [panels.{lost[0]}] position = [0, 1.2, 0.2].",
        )
