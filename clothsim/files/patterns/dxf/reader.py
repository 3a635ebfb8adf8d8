"""Sewing pattern of a DXF drawing and its sewing file.

The outline of a piece is divided into edges at corners and at notches.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.files.patterns.dxf.drawing import SEW, Drawing, Piece, read_drawing
from clothsim.files.patterns.dxf.outline import JOINED, Part, divided, loop_of, polygon, reflected, unfolded
from clothsim.files.patterns.dxf.sewing_file import PanelKeys, SewingFile, read_sewing_file
from clothsim.patterns.curves import Arc, Bezier, Curve, Polyline, Straight, along_chord
from clothsim.patterns.pattern import Panel, Pattern, PatternEdge
from clothsim.patterns.specification import USUAL_UNITS

NEAR = 2e-3
"""Distance of a notch from a corner or another notch at which it divides nothing [m]."""
STRAIGHT = 1e-7
"""Distance from its chord of a row of straight parts that is one straight edge [m]."""
STEPS = 60
"""Halvings of the interval in which the nearest point of a curve lies."""


def edges_of(
    loop: Sequence[Part], notches: Floats, curve_points: Floats, reach: float, corner: float
) -> tuple[Floats, tuple[PatternEdge, ...]]:
    """Corners (k, 2) [m] and edges of a loop.

    Parameters
    ----------
    loop : sequence of Part
        Closed, in order.
    notches : (k, 2) array
        Points at which an edge ends and the next one begins [m].
    curve_points : (k, 2) array
        Points that are no corners, however the loop turns there [m].
    reach : float
        Largest distance of a notch from the loop [m]: beyond, it belongs to another line.
    corner : float
        Turn of the outline at which an edge ends [rad].

    Returns
    -------
    vertices : (k, 2) array
        Corners [m], the first at or after the start of the loop.
    edges : tuple of PatternEdge
        At least two.
    """
    parts = list(loop)
    smooth = [np.linalg.norm(curve_points - part.start, axis=1).min(initial=np.inf) < JOINED for part in parts]
    ends = {k for k in range(len(parts)) if not smooth[k] and _turn(parts[k - 1], parts[k]) > corner}
    for notch in notches:
        parts, ends = _notched(parts, ends, notch, reach)
    if not ends:
        ends = {0}
    if len(ends) == 1:
        parts, ends = _divided_in_two(parts, next(iter(ends)))
    starts = sorted(ends)
    chains = [_between(parts, first, starts[(k + 1) % len(starts)]) for k, first in enumerate(starts)]
    edges = (PatternEdge(k, (k + 1) % len(chains), _curve(chain)) for k, chain in enumerate(chains))
    return np.array([chain[0].start for chain in chains]), tuple(edges)


def _turn(before: Part, after: Part) -> float:
    """Angle between two parts where they meet [rad]."""
    u, v = before.tangents[1], after.tangents[0]
    return float(np.arctan2(abs(u[0] * v[1] - u[1] * v[0]), u @ v))


def _notched(parts: list[Part], ends: set[int], notch: Floats, reach: float) -> tuple[list[Part], set[int]]:
    """The parts and the numbers of those that start an edge, with the outline divided at a notch."""
    found = [_nearest(part, notch) for part in parts]
    row = int(np.argmin([distance for _, distance in found]))
    t, distance = found[row]
    point = parts[row].curve.at(parts[row].start, parts[row].end, np.array([t]))[0]
    corners = np.array([parts[k].start for k in ends]).reshape(-1, 2)
    if distance > reach or np.linalg.norm(corners - point, axis=1).min(initial=np.inf) < NEAR:
        return parts, ends
    for k in (row, (row + 1) % len(parts)):
        if np.linalg.norm(parts[k].start - point) < STRAIGHT:
            return parts, ends | {k}
    pieces = _cut(parts[row], t)
    moved = {k + (k > row) for k in ends}
    return [*parts[:row], *pieces, *parts[row + 1 :]], moved | {row + 1}


def _nearest(part: Part, point: Floats) -> tuple[float, float]:
    """Parameter of the point of a part that is nearest to `point`, and its distance [m]."""
    t = np.linspace(0, 1, 65)
    at = lambda values: part.curve.at(part.start, part.end, values)  # noqa: E731
    best = int(np.argmin(np.linalg.norm(at(t) - point, axis=1)))
    low, high = t[max(best - 1, 0)], t[min(best + 1, 64)]
    for _ in range(STEPS):  # the distance has one minimum between both neighbours
        thirds = np.array([(2 * low + high) / 3, (low + 2 * high) / 3])
        first, second = np.linalg.norm(at(thirds) - point, axis=1)
        low, high = (low, thirds[1]) if first < second else (thirds[0], high)
    return float((low + high) / 2), float(np.linalg.norm(at(np.array([(low + high) / 2]))[0] - point))


def _cut(part: Part, t: float) -> tuple[Part, Part]:
    """A part before and after the parameter t of its curve."""
    start, end, curve = part.start, part.end, part.curve
    middle = curve.at(start, end, np.array([t]))[0]
    if isinstance(curve, Straight):
        return Part(start, middle, curve), Part(middle, end, curve)
    if isinstance(curve, Arc):
        sweep = abs(curve.circle(start, end)[2])
        halves = (Arc(curve.radius, share * sweep > np.pi, curve.right) for share in (t, 1 - t))
        return Part(start, middle, next(halves)), Part(middle, end, next(halves))
    if isinstance(curve, Bezier):
        first, second = divided(curve.points(start, end), t)
        return _bezier(first), _bezier(second)
    raise TypeError(f"A part of an outline is no {type(curve).__name__}.")


def _bezier(points: Floats) -> Part:
    """The curve of 3 or 4 control points (k, 2) [m]."""
    return Part(points[0], points[-1], Bezier(along_chord(points[1:-1], points[0], points[-1])))


def _divided_in_two(parts: list[Part], first: int) -> tuple[list[Part], set[int]]:
    """The parts from the only corner on, and the start of both edges: the other one lies at half of the length."""
    parts = [*parts[first:], *parts[:first]]
    lengths = np.cumsum([part.curve.length(part.start, part.end) for part in parts])
    row = int(np.searchsorted(lengths, lengths[-1] / 2))
    before = lengths[row - 1] if row else 0.0
    share = (lengths[-1] / 2 - before) / (lengths[row] - before)
    if share > 1 - 1e-6 or share < 1e-6:
        return parts, {0, row + (share > 0.5)}
    curve = parts[row].curve
    t = curve.parameters(parts[row].start, parts[row].end, np.array([share]))[0] if isinstance(curve, Bezier) else share
    return [*parts[:row], *_cut(parts[row], float(t)), *parts[row + 1 :]], {0, row + 1}


def _between(parts: Sequence[Part], first: int, last: int) -> list[Part]:
    """The parts from `first` up to `last`, cyclically."""
    return [*parts[first:last]] if last > first else [*parts[first:], *parts[:last]]


def _curve(chain: Sequence[Part]) -> Curve:
    """One curve for a row of parts: their own where there is one, straight where they are, else a polyline."""
    if len(chain) == 1:
        return chain[0].curve
    start, end = chain[0].start, chain[-1].end
    points = np.concatenate([*(part.samples[:-1] for part in chain), end[None]])[1:-1]
    inner_points = along_chord(points, start, end)
    inner = np.array(inner_points)
    chord = float(np.linalg.norm(end - start))
    forward = (np.diff(inner[:, 0], prepend=0, append=1) > 0).all()
    return Straight() if forward and np.abs(inner[:, 1]).max() * chord < STRAIGHT else Polyline(inner_points)


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
    of_size, size_notes = _choose_size(file.name, drawing, sewing.size)
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


def _choose_size(file: str, drawing: Drawing, given: str) -> tuple[dict[str, Piece], tuple[str, ...]]:
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
