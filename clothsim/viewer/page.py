"""Page of a run: the cloth to be turned, scrubbed and played, a field in colours, a picked vertex, the certificate."""

import io
import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import trimesh

from clothsim import Run, open_run
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.triangles import vertex_normals
from clothsim.engine import Colouring
from clothsim.viewer.served import (
    LOOPBACK,
    PORT,
    Gate,
    Served,
    certificate_text,
    legend_html,
    require_viser,
    serve,
    solver_text,
    speeds,
    state_text,
    vertex_text,
)

TICK = 1 / 30
"""Time between two looks at the clock while it plays [s]."""
POLL = 1.0
"""Time between two looks at the files of a run that is still going [s]."""
CACHED_BYTES = 256 << 20
"""Bound on the cached frames."""


@dataclass(repr=False)
class Page(Served):
    """Page of a run, served until `close`.

    Attributes
    ----------
    run : Run
        The run; read again while it is still going.
    colouring : Colouring
        Quantity that colours the cloth.
    frame : int
        Frame that is shown.
    picked : int or None
        Picked vertex.
    """

    run: Run
    colouring: Colouring
    frame: int = 0
    picked: int | None = None
    _ready: OrderedDict[tuple[str, int], bytes] = field(default_factory=OrderedDict)

    def __repr__(self) -> str:
        return f"<Page of {str(self.run.directory)!r} at {self.url}>"

    def show(self, frame: int) -> None:
        """Show a frame: cloths, bodies and texts."""
        with self._lock:
            self.frame = int(np.clip(frame, 0, len(self.run) - 1))
            self.nodes["cloth"].glb_data = self.glb(self.frame)
            moving = {each.name for each in self.run.trajectory.surfaces if each.moving}
            for name, points, _ in self.run.bodies(self.frame):
                if name in moving:
                    self.nodes[f"body/{name}"].vertices = points.astype(np.float32)
            time = float(self.run.times[self.frame])
            self.controls["solver"].content = f"**{time:.4g} s**\n\n{solver_text(self.run.record(), time)}"
            self._show_picked()

    def colour_by(self, name: str) -> None:
        """Colour the cloth by another quantity."""
        with self._lock:
            self.colouring = Colouring.of_run(self.run, name)
            self.controls["legend"].content = legend_html(self.colouring)
            self.picked = None
            self.fade(self.controls["opacity"].value)
            self.show(self.frame)

    def fade(self, opacity: float) -> None:
        """Draw the bodies transparent; they are hidden if the colours lie on them."""
        for name, node in self.nodes.items():
            if name.startswith("body/"):
                node.visible = opacity > 0 and not self.colouring.of_bodies
                node.opacity = None if opacity == 1 else opacity

    def pick(self, origin: Floats, direction: Floats) -> int | None:
        """Pick the vertex nearest to the first hit of a ray; return its number."""
        mesh = self.colouring.mesh(self.frame)
        vertex = picked_vertex(mesh.positions, mesh.triangles, origin, direction)
        with self._lock:
            self.picked = vertex
            self._show_picked()
        return vertex

    def refresh(self) -> bool:
        """Read the run again; True if it has more frames or has ended."""
        with self._lock:
            again = open_run(self.run.directory)
            if len(again) == len(self.run) and again.summary == self.run.summary:
                return False
            at_end = self.frame == len(self.run) - 1
            self.run = again
            self.colouring = Colouring.of_run(again, self.colouring.name)
            self._ready.clear()
            slider = self.controls["frame"]
            slider.max = max(1, len(again) - 1)
            self.controls["state"].content = state_text(again)
            self.controls["certificate"].content = certificate_text(again)
            if at_end:
                slider.value = len(again) - 1
            self.show(len(again) - 1 if at_end else self.frame)
            return True

    def glb(self, frame: int) -> bytes:
        """The cloths of a frame as binary glTF; cached, because playback repeats frames."""
        key = (self.colouring.name, frame)
        if key not in self._ready:
            mesh = self.colouring.mesh(frame)
            self._ready[key] = as_glb(mesh.positions, mesh.triangles, mesh.colours)
            while len(self._ready) > 1 and sum(map(len, self._ready.values())) > CACHED_BYTES:
                self._ready.popitem(last=False)
        return self._ready[key]

    def _show_picked(self) -> None:
        text, marker = self.controls["vertex"], self.nodes["marker"]
        marker.visible = self.picked is not None
        if self.picked is None:
            text.content = "Click on the cloth: a vertex and its history."
            return
        mesh = self.colouring.mesh(self.frame)
        marker.position = mesh.positions[self.picked]
        times = self.run.times
        history = np.array([self.colouring.positions(self.run, k)[self.picked] for k in range(len(self.run))])
        fast = speeds(history, times)
        text.content = vertex_text(
            self.picked,
            mesh.positions[self.picked],
            float(fast[self.frame]),
            (self.colouring.name.replace("_", " "), self.colouring.value_at(mesh, self.picked)),
        )
        self.controls["history"].data = (np.asarray(times, float), fast)
        self.controls["history"].visible = len(times) > 1

    def serve(self) -> None:
        """Play, and follow a run that is still going, until the page is closed."""
        looked = shown = monotonic()
        while not self._closed.wait(TICK):
            now = monotonic()
            if not self.run.summary and now - looked > POLL:
                looked = now
                self.refresh()
            if self.controls["play"].value and len(self.run) > 1:
                pause = float(np.median(np.diff(self.run.times))) / self.controls["speed"].value
                if now - shown >= pause:
                    shown = now
                    self.controls["frame"].value = (self.frame + 1) % len(self.run)


def as_glb(positions: Floats, triangles: Ints, colours: Floats) -> bytes:
    """Binary glTF of a mesh (n, 3), (m, 3), seen from both sides; colours (n, 3) of its vertices: sRGB in [0, 1]."""
    linear = np.asarray(colours) ** 2.2  # glTF 2.0, section 3.7.2.1: COLOR_0 is linear
    opaque = np.column_stack([np.round(255 * linear), np.full(len(colours), 255)]).astype(np.uint8)
    made = trimesh.Trimesh(
        positions,
        triangles,
        vertex_normals=vertex_normals(positions, triangles),
        vertex_colors=opaque,
        process=False,
    )
    data = io.BytesIO()
    made.export(data, file_type="glb", include_normals=True)
    return data.getvalue()


def picked_vertex(positions: Floats, triangles: Ints, origin: Floats, direction: Floats) -> int | None:
    """Number of the vertex nearest to where a ray first meets the triangles; None if it meets none.

    Moller and Trumbore 1997, from both sides.

    Examples
    --------
    >>> import numpy as np
    >>> square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    >>> picked_vertex(square, np.array([[0, 1, 2], [0, 2, 3]]), np.array([0.9, 0.2, 1]), np.array([0, 0, -1.0]))
    1
    """
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    first, second = b - a, c - a
    across = np.cross(direction, second)
    volume = np.einsum("ij,ij->i", first, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        from_a = origin - a
        u = np.einsum("ij,ij->i", from_a, across) / volume
        other = np.cross(from_a, first)
        v = other @ direction / volume
        distance = np.einsum("ij,ij->i", second, other) / volume
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
    if not met.any():
        return None
    row = int(np.argmin(np.where(met, distance, np.inf)))
    point = origin + distance[row] * direction
    corners = triangles[row]
    return int(corners[np.argmin(np.linalg.norm(positions[corners] - point, axis=1))])


BACKGROUND = np.linspace([186, 194, 206], [243, 244, 247], 256).round().astype(np.uint8)
"""Colours from top to bottom (256, 3): unstretched cloth, which is nearly white, stands out."""


def add_scene(page: Page) -> None:
    """Cloth, bodies, marker, light and the first camera."""
    server, run = page.server, page.run
    add_background(server)
    mesh = page.colouring.mesh(0)
    cloth = server.scene.add_glb("/cloth", page.glb(0))

    def pick(event: Any) -> None:
        page.pick(np.array(event.ray_origin), np.array(event.ray_direction))

    cloth.on_click(pick)
    page.nodes["cloth"] = cloth
    last = page.colouring.mesh(len(run) - 1).positions
    everything = np.concatenate([mesh.positions, last])
    for name, points, triangles in run.bodies(0):
        page.nodes[f"body/{name}"] = add_body(server, name, points, triangles)
    size = look_at(server, everything, run.up)
    page.nodes["marker"] = server.scene.add_icosphere(
        "/marker", radius=0.008 * size, color=(220, 30, 30), visible=False
    )


def add_background(server: Any) -> None:
    """The background of all pages."""
    server.scene.set_background_image(np.repeat(BACKGROUND[:, None], 4, axis=1), format="png")


def add_body(server: Any, name: str, points: Floats, triangles: Ints) -> Any:
    """The node of a body."""
    return server.scene.add_mesh_simple(
        f"/body/{name}", points.astype(np.float32), triangles.astype(np.uint32), color=BODY, side="double"
    )


BODY = (146, 137, 128)
"""Colour of bodies: darker than the cloth and than the background."""
PANEL_WIDTH, NARROW = 416.0, 640.0
"""The panel's part of a window [px], at the right; in a narrower window than this it covers the lower half."""
WINDOW = 1200.0, 800.0
"""Width and height of a usual window [px]."""
FILLED = 0.8
"""Part of what the panel leaves free that the points fill in the first view."""


def first_view(points: Floats, up: Floats, fov: float, width: float, height: float) -> tuple[Floats, Floats]:
    """Position of a camera and the point that it looks at, both (3,) [m].

    From the front and above, all points are seen beside the panel.

    Parameters
    ----------
    points : (n, 3) array
        What is seen [m].
    up : (3,) array
        Unit vector.
    fov : float
        Vertical angle of view [rad].
    width, height : float
        Of the window [px]; one without an area, as in a page that is not shown yet, is taken as WINDOW.
    """
    width, height = (width, height) if width > 0.0 and height > 0.0 else WINDOW
    across = np.cross(up, [0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [1.0, 0.0, 0.0])
    backward = 0.42 * across - 0.95 * np.cross(across, up) + 0.42 * up
    backward /= np.linalg.norm(backward)
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(backward, right), backward])
    seen = points @ axes.T
    focal = height / 2 / np.tan(fov / 2)
    free = np.array([width, height / 2] if width < NARROW else [width - PANEL_WIDTH, height])
    centre = (free - [width, height]) / [2.0, -2.0]  # the free part begins at the left and at the top
    # A point (x, y, z) is seen at (x - eye_x) / (eye_z - z): between slopes low and high where
    # eye_x + low eye_z <= x + low z and x + high z <= eye_x + high eye_z.
    low, high = (centre - FILLED * free / 2) / focal, (centre + FILLED * free / 2) / focal
    depths = seen[:, 2:]
    first, last = np.min(seen[:, :2] + low * depths, axis=0), np.max(seen[:, :2] + high * depths, axis=0)
    distance = np.max((last - first) / (high - low))
    eye = np.array([*(first - low * distance + last - high * distance) / 2, distance])
    middle = distance - depths.mean()
    return eye @ axes, (eye - [0.0, 0.0, middle]) @ axes


def up_direction(up: Any) -> Floats:
    """Unit vector (3,) of a direction; of any text +z."""
    return np.array([0.0, 0.0, 1.0]) if isinstance(up, str) else np.array(up) / np.linalg.norm(up)


def look_at(server: Any, points: Floats, up: Any) -> float:
    """Let each window begin with all `points (n, 3)` in view; their extent [m].

    up: a direction, or any text for +z.
    """
    direction = up_direction(up)
    server.scene.set_up_direction(tuple(direction))

    def frame(client: Any) -> None:
        own = client.camera
        position, target = first_view(points, direction, own.fov, own.image_width, own.image_height)
        own.up_direction, own.position, own.look_at = direction, position, target

    server.on_client_connect(frame)
    return float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))


def add_controls(page: Page, names: list[str]) -> None:
    """Time, colour, bodies and texts."""
    gui, run, controls = page.server.gui, page.run, page.controls
    gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
    controls["state"] = gui.add_markdown(state_text(run))
    controls["frame"] = gui.add_slider("Frame", 0, max(1, len(run) - 1), 1, len(run) - 1)
    controls["play"] = gui.add_checkbox("Play", False)
    controls["speed"] = gui.add_slider("Speed", 0.05, 2.0, 0.05, 1.0)
    controls["colour"] = gui.add_dropdown("Colour", names, initial_value=page.colouring.name)
    controls["legend"] = gui.add_html(legend_html(page.colouring))
    controls["opacity"] = gui.add_slider("Opacity of bodies", 0.0, 1.0, 0.05, 1.0)
    tabs = gui.add_tab_group()
    with tabs.add_tab("Solver"):
        controls["solver"] = gui.add_markdown("")
    with tabs.add_tab("Vertex"):
        controls["vertex"] = gui.add_markdown("")
        controls["history"] = gui.add_uplot(
            (np.zeros(1), np.zeros(1)),
            ({}, {"label": "speed [m/s]", "stroke": "#2561a8", "width": 2}),
            title="Speed over time [s]",
            scales={"x": {"time": False}},
            aspect=1.6,
            visible=False,
        )
    with tabs.add_tab("Certificate"):
        controls["certificate"] = gui.add_markdown(certificate_text(run))
    controls["frame"].on_update(lambda _: page.show(controls["frame"].value))
    controls["colour"].on_update(lambda _: page.colour_by(controls["colour"].value))
    controls["opacity"].on_update(lambda _: page.fade(controls["opacity"].value))


def view(
    run: Run | str | Path,
    port: int = PORT,
    host: str = LOOPBACK,
    colour: str | None = None,
    trusted: Sequence[str] = (),
) -> Page:
    """Serve a page to turn, scrub and play a run, also one in progress, to colour it by a field and to pick a vertex.

    Parameters
    ----------
    run : Run, str or Path
        The run, or its directory.
    port : int
        First port to try; the next free one is used.
    host : str
        Address on which the page is served; an address other than the loopback opens it to the network.
    colour : str, optional
        Quantity that colours the cloth; by default the stretch, if the run stored it.
    trusted : sequence of str
        Further names by which browsers may reach the page, such as "localhost:9000" for a tunnel.

    Returns
    -------
    Page
        Its `url` has a token, with which anyone can read the run. `close()` ends it. A notebook shows it in its cell.

    Raises
    ------
    InputError
        No run there, no frame yet, an unknown quantity, a bad address, or viser is not installed.

    Examples
    --------
    >>> import clothsim
    >>> page = clothsim.view("drape", port=8080)  # doctest: +SKIP
    >>> page.url  # doctest: +SKIP
    'http://127.0.0.1:8080/5xvN5ZBCpRkTh4iBvLqP6g/'
    """
    viser = require_viser()
    run = run if isinstance(run, Run) else open_run(run)
    if not len(run):
        raise InputError(f"{run.directory} has no frame yet.", "Wait until the run has written one.")
    names = Colouring.names(run)
    first = colour or ("stretch" if "stretch" in names else "plain")
    if first not in names:
        raise InputError(f"This run has no {first!r} to show.", f"It has {', '.join(names)}.")
    gate = Gate(host, trusted)
    page = Page(run, Colouring.of_run(run, first), server=serve(viser, gate, port), gate=gate)
    add_scene(page)
    add_controls(page, names)
    page.show(len(run) - 1)
    threading.Thread(target=page.serve, name="clothsim page", daemon=True).start()
    return page
