"""Pictures of a fit and of a dressed garment, and the movie of its sewing."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from clothsim import Run
from clothsim.base.arrays import Floats, Ints
from clothsim.base.triangles import distinct_edges, vertex_normals
from clothsim.engine import Fabric
from clothsim.garments.dress.corrections import touching_seams
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.inputs import BodyMesh
from clothsim.render import WIDTHS, Surface, picture_setup, rendered, write_movie

if TYPE_CHECKING:
    from clothsim.garments.dressed import Dress
    from clothsim.garments.fitted import Fit
    from clothsim.garments.outfit import Outfit

FRONT = (0.35, 0.15, 1.0)
"""View direction: to the right of a person that faces the camera, slightly above; along x, up, and the third axis."""


def draw_fit(done: "Fit", file: Path) -> str:
    """Write a PNG of the garment on its body, transferred, and fitted; returns the renderer's note.

    All panels have one camera, moved with the body, so that bodies and garments are drawn in one size.
    """
    plain = np.zeros((0, 2))
    first = done.stages[0]
    # a quarter turn about x where one stands along y and the other along z, else none
    turn = Rotation.from_rotvec(np.cross(done.source.up, done.target.up) * np.pi / 2).as_matrix()
    source = replace(done.source, positions=done.source.positions @ turn.T)
    panels = [(f"before, on {done.source.name}", first.positions @ turn.T, source, plain)]
    seed = next((stage for stage in done.stages if stage.name == ("size" if done.size.factors else "transfer")), None)
    if seed is not None:
        panels.append((f"transferred to {done.target.name}", seed.positions, done.target, plain))
    ending = {
        "completed": "fitted and draped",
        "distorted": "draped, distorted",
        "refined": "refined, not simulated",
        "failed": f"failed; the best: {done.answer.name}",
    }
    strain = done.cost.stretches  # against the garment as given
    if done.run is not None and done.status in ("completed", "distorted"):
        strain = np.asarray(done.run.stretches(-1), np.float64)  # as graded: a larger garment is not strained
    panels.append((ending[done.status], done.positions, done.target, strain))
    title, _, target, _ = panels[-1]
    right, up, front = FRONT
    surfaces = [
        [
            Surface(done.garment.name, points, done.garment.triangles, "cloth", stretches),
            Surface(wearer.name, wearer.positions, wearer.triangles, "body", plain),
        ]
        for _, points, wearer, stretches in panels
    ]
    setup = picture_setup(
        [surfaces[-1]],
        size=SIZE,
        colour="stretch",
        up=target.up,
        view=(right, up, front) if target.up[1] else (right, -front, up),
        title=title,
        renderer="auto",
        smooth=done.status in ("completed", "distorted"),  # in others triangles may cross, and are drawn as they are
        focus=np.concatenate([points + _displacement_to(wearer, target) for _, points, wearer, _ in panels]
                             + [wearer.positions + _displacement_to(wearer, target) for _, _, wearer, _ in panels]),
    )  # fmt: skip
    pictures = []
    for (name, _, wearer, _), drawn in zip(panels[:-1], surfaces[:-1], strict=True):
        camera = replace(setup.camera, position=setup.camera.position - _displacement_to(wearer, target))
        pictures.append(rendered(replace(setup, camera=camera, scale=None, title=name, smooth=False), drawn))
    Image.fromarray(np.hstack([*pictures, rendered(setup, surfaces[-1])])).save(file, format="PNG")
    return setup.note


def _displacement_to(wearer: BodyMesh, target: BodyMesh) -> Floats:
    """Displacement from one body's middle to the other's, (3,) [m]."""
    own, other = (np.array([each.positions.min(axis=0), each.positions.max(axis=0)]) for each in (wearer, target))
    return np.asarray(other.mean(axis=0) - own.mean(axis=0), np.float64)


LINE = 0.003
"""Width of the line of a seam [m]."""
POINT = 1e-6
"""Length of the second stroke of a cross, which only says in which plane the first one lies [m]."""


def garment_surface(
    state: SewingState, positions: Floats, stretches: Floats | None = None, fabrics: Mapping[str, Fabric] | None = None
) -> Surface:
    """Cloth at positions (k, 3) [m] with its sewn edges; stretches (m, 2) colour it, None: plain by fabric of panel."""
    plain = np.zeros((0, 2)) if stretches is None else stretches
    spacing = LINE / WIDTHS[0]
    return Surface(
        "garment",
        positions,
        state.triangles,
        "cloth",
        plain,
        strokes=seam_strokes(state, positions),
        spacing=spacing,
        fabrics=numbers_of_fabrics(state, fabrics or {}),
    )


def numbers_of_fabrics(state: SewingState, fabrics: Mapping[str, Fabric]) -> Ints:
    """Number of the fabric of each triangle, (m,), the one of most panels first; fabrics: of each panel."""
    order = [name for name, _ in Counter(fabric.name for fabric in fabrics.values()).most_common()]
    numbers = np.zeros(len(state.triangles), np.int64)
    for panel, fabric in fabrics.items():
        numbers[state.mesh.faces[panel]] = order.index(fabric.name)
    return numbers


def body_surface_look(body: BodyMesh) -> Surface:
    """The body."""
    return Surface(body.name, body.positions, body.triangles, "body", np.zeros((0, 2)))


def seam_strokes(state: SewingState, positions: Floats) -> Floats:
    """Sides of all sewn edges as strokes along them, (k, 2, 2, 3) [m]."""
    lines = [state.number[state.mesh.edges[side]] for seam in state.mesh.seams for side in seam.stitch.sides]
    pairs = np.concatenate([np.zeros((0, 2), np.int64), *(np.column_stack([rows[:-1], rows[1:]]) for rows in lines)])
    pairs = distinct_edges(pairs)[0]
    ends = positions[pairs]
    normal = vertex_normals(positions, state.triangles)[pairs].sum(axis=1)
    across = np.cross(normal, ends[:, 1] - ends[:, 0])
    across *= POINT / np.maximum(np.linalg.norm(across, axis=1), np.finfo(float).tiny)[:, None]
    middle = ends.mean(axis=1)
    return np.stack([ends, np.stack([middle - across, middle + across], axis=1)], axis=1)


SIZE = (640, 960)
DRESS_PICTURES = PLACED, WORN, STRETCH = "placed.png", "worn.png", "stretch.png"
VIEWS = (("front", (0.3, 0.12, 1.0)), ("back", (0.3, 0.12, -1.0)))
"""View directions along x, up, and the direction that the body faces."""
MOVING = "worn, not at rest"
"""Title of a garment that still moves at the end of its drape."""
ABOVE = 0.25
"""Height of the body above and below the garment in a picture of its stretch, as a fraction of the garment's."""


def draw_dress(done: "Dress") -> list[Path]:
    """Write placed.png and worn.png, in plain colour with the seams, and stretch.png; returns their paths."""
    title = {"completed": "worn", "sewn": MOVING if done.draped else "sewn, not draped"}.get(done.status, done.status)
    placed = garment_surface(done.placed, done.placed.positions, fabrics=done.fabrics)
    worn = garment_surface(done.state, done.state.positions, fabrics=done.fabrics)
    stretched = garment_surface(done.state, done.state.positions, done.state.stretches())
    return [
        _pair(done.directory / PLACED, "as placed", [placed], done.body),
        _pair(done.directory / WORN, title, [worn], done.body),
        _pair(done.directory / STRETCH, f"{title}, stretch", [stretched], done.body),
    ]


def draw_outfit(done: "Outfit") -> Path:
    """Write worn.png of all garments, each in a colour of its own; returns its path."""
    states = {each.directory.name: each.state for each in done.sewn}
    plain, spacing, garments = np.zeros((0, 2)), LINE / WIDTHS[0], []
    for each in done.worn:
        at, state = each.positions, states.get(each.name)
        strokes = np.zeros((0, 2, 2, 3)) if state is None else seam_strokes(state, at)
        garments.append(Surface(each.name, at, each.triangles, "cloth", plain, strokes=strokes, spacing=spacing))
    title = {"completed": "worn", "sewn": MOVING}.get(done.status, done.status)
    return _pair(done.directory / WORN, title, garments, done.body)


def _pair(file: Path, title: str, garments: Sequence[Surface], body: BodyMesh) -> Path:
    """Write front and back side by side: the whole figure, or the garment's stretch."""
    whole = not len(garments[0].principal_stretches)
    surfaces = [*garments, body_surface_look(body)]
    panels = []
    for side, view in VIEWS:
        setup = picture_setup(
            [surfaces],
            size=SIZE,
            colour="plain" if whole else "stretch",
            up=body.up,
            view=view_of(view, body),
            title=f"{title}, {side}",
            renderer="auto",
            focus=_focus(np.concatenate([each.positions for each in garments]), body, whole),
        )
        panels.append(rendered(setup, surfaces))
    Image.fromarray(np.hstack(panels)).save(file, format="PNG")
    return file


def view_of(view: tuple[float, float, float], body: BodyMesh) -> Floats:
    """Direction (3,) from a body to the camera, given along its left, up and front."""
    left, up, front = view
    forward = body.front
    return np.asarray(left * np.cross(body.up, forward) + up * body.up + front * forward, np.float64)


def _focus(positions: Floats, body: BodyMesh, whole: bool) -> Floats:
    """Points that the picture shows: the garment and the body, from head to feet or beside the garment."""
    if whole:
        return np.concatenate([positions, body.positions])
    levels, own = body.positions @ body.up, positions @ body.up
    room = ABOVE * float(np.ptp(own))
    near = (levels > own.min() - room) & (levels < own.max() + room)
    return np.concatenate([positions, body.positions[near]])


MOVIE_VIEW = (0.55, 0.2, 1.0)
"""View direction along the body's left, up and front."""
MOVIE_SIZE = (540, 720)
RATE = 10.0
"""Frames a second: as fast as it was."""


def draw_sewing(done: "Dress", target: Path, progress: Callable[[int, int], None] = lambda done, total: None) -> str:
    """Write an .mp4, .webp or .gif of the closing and the drape; returns the line that names the renderer.

    InputError for another ending; MissingPackageError for an .mp4 without the extra `movies`.
    """
    return write_movie(
        target,
        frames_of(done),
        frames_per_second=RATE,
        size=MOVIE_SIZE,
        colour="plain",
        up=done.body.up,
        view=view_of(MOVIE_VIEW, done.body),
        progress=progress,
    )


def frames_of(done: "Dress") -> list[list[Surface]]:
    """Garment and body of each frame: as placed, of each round of closing, of the drape."""
    body = body_surface_look(done.body)
    in_pieces = done.placed.weld(touching_seams(done.placed))
    frames = [[garment_surface(done.placed, done.placed.positions, fabrics=done.fabrics), body]]
    for run in done.closing:
        frames += [[garment, body] for garment in _frames(in_pieces, run, done.fabrics)]
    if done.run is not None:
        frames += [[garment, body] for garment in _frames(done.state, done.run, done.fabrics)]
    return frames


def _frames(state: SewingState, run: Run, fabrics: Mapping[str, Fabric]) -> list[Surface]:
    return [garment_surface(state, run.positions(number), fabrics=fabrics) for number in range(len(run))]
