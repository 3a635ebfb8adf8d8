"""Page of a run: the cloth to be turned, scrubbed and played, a field in colours, a picked vertex, the certificate."""

import io
import threading
from collections import OrderedDict
from dataclasses import dataclass, field
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from clothsim import Run, open_run
from clothsim.base.arrays import Floats, Ints
from clothsim.engine import Colouring
from clothsim.render import vertex_normals
from clothsim.viewer.served import Served
from clothsim.viewer.side_texts import certificate_text, legend_html, solver_text, speeds, state_text, vertex_text

if TYPE_CHECKING:
    import viser

TICK = 1 / 30
"""Time between two looks at the clock while it plays [s]."""
NEWS = 1.0
"""Time between two looks at the files of a run that is still going [s]."""
CACHED_BYTES = 256 << 20
"""Bound on the frames that are kept ready to be sent."""


@dataclass(repr=False)
class Page(Served):
    """Page of a run, served until `close`.

    Attributes
    ----------
    run : Run
        The run; read again while it is still going.
    server : viser.ViserServer
        Server of the page.
    colouring : Colouring
        What colours the cloth.
    frame : int
        Frame that is shown.
    picked : int or None
        Picked vertex.
    """

    run: Run
    server: "viser.ViserServer"
    colouring: Colouring
    frame: int = 0
    picked: int | None = None
    _ready: OrderedDict[tuple[str, int], bytes] = field(default_factory=OrderedDict)
    nodes: dict[str, Any] = field(default_factory=dict)
    controls: dict[str, Any] = field(default_factory=dict)
    _lock: threading.RLock = field(default_factory=threading.RLock)
    _closed: threading.Event = field(default_factory=threading.Event)

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
        """Let bodies be seen through; none is drawn where colours lie on them."""
        for name, node in self.nodes.items():
            if name.startswith("body/"):
                node.visible = opacity > 0 and not self.colouring.of_bodies
                node.opacity = None if opacity == 1 else opacity

    def pick(self, origin: Floats, direction: Floats) -> int | None:
        """Pick the vertex that a ray meets first; its number."""
        mesh = self.colouring.mesh(self.frame)
        vertex = picked_vertex(mesh.positions, mesh.triangles, origin, direction)
        with self._lock:
            self.picked = vertex
            self._show_picked()
        return vertex

    def refresh(self) -> bool:
        """Read the run again; True where it has more frames or has ended."""
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
        """The cloths of a frame as binary glTF; kept, as playing asks for it again."""
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
        places, times = self._history(self.picked), self.run.times
        fast = speeds(places, times)
        text.content = vertex_text(
            self.picked,
            mesh.positions[self.picked],
            float(fast[self.frame]),
            (self.colouring.name.replace("_", " "), self.colouring.value_at(mesh, self.picked)),
        )
        self.controls["history"].data = (np.asarray(times, float), fast)
        self.controls["history"].visible = len(times) > 1

    def _history(self, vertex: int) -> Floats:
        """Places of a vertex in all frames, (k, 3) [m]."""
        return np.array([self.colouring.positions(self.run, k)[vertex] for k in range(len(self.run))])

    def serve(self) -> None:
        """Play, and follow a run that is still going, until the page is closed."""
        looked = shown = monotonic()
        while not self._closed.wait(TICK):
            now = monotonic()
            if not self.run.summary and now - looked > NEWS:
                looked = now
                self.refresh()
            if self.controls["play"].value and len(self.run) > 1:
                pause = float(np.median(np.diff(self.run.times))) / self.controls["speed"].value
                if now - shown >= pause:
                    shown = now
                    self.controls["frame"].value = (self.frame + 1) % len(self.run)


def as_glb(positions: Floats, triangles: Ints, colours: Floats) -> bytes:
    """Binary glTF of a mesh (n, 3), (m, 3) with a colour (n, 3) in [0, 1] at each vertex, seen from both sides."""
    opaque = np.column_stack([np.round(255 * colours), np.full(len(colours), 255)]).astype(np.uint8)
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
    """Number of the vertex nearest to where a ray first meets the triangles; None where it meets none.

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
