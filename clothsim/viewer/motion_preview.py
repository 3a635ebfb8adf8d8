"""Preview of a garment in motion: the figure moves in its predicted garment, each frame with its verdict."""

import threading
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from clothsim import Scene
from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from clothsim.engine import MovingGarment, checked_motion
from clothsim.viewer.gate import Gate
from clothsim.viewer.page import up_direction
from clothsim.viewer.preview import CLEAR, DRAPED, add_surfaces, put_cloth
from clothsim.viewer.served import LOOPBACK, PORT, Served, require_viser, serve

REPAIRED = (205, 170, 90)
"""Colour of a frame that was repaired."""
COLOURS = {"certified": CLEAR, "repaired": REPAIRED, "simulated": DRAPED}


@dataclass(repr=False)
class MotionPreview(Served):
    """Page of a garment in motion, served until `close`.

    Attributes
    ----------
    rate : float
        Frames a second of the motion [1/s].
    up : (3,) array
        Unit vector; across it the view follows the figure.
    frames : list of CheckedFrame
        Those that are checked so far; all others follow in their order.
    fault : str
        Why no more follow; empty where all are checked.
    """

    rate: float
    up: Floats
    frames: list[Any] = field(default_factory=list)
    fault: str = ""

    def __repr__(self) -> str:
        return f"<MotionPreview of {len(self.frames)} frames at {self.url}>"

    def show(self, number: int) -> Any:
        """Show a frame with its verdict, and return it: the last that is checked, where it is a later one."""
        with self._lock:
            frame = self.frames[min(number, len(self.frames) - 1)]
            way = frame.cloth.mean(axis=0) - self.frames[0].cloth.mean(axis=0)
            way -= (way @ self.up) * self.up
            put_cloth(self.nodes, frame.cloth - way, COLOURS[frame.verdict])
            for node, points in zip(self.nodes["bodies"], frame.bodies, strict=True):
                node.vertices = (points - way).astype("float32")
            self.controls["verdict"].content = frame_verdict_text(frame)
            self.controls["counts"].content = self.counts_text()
        return frame

    def counts_text(self) -> str:
        """How many frames have each verdict."""
        counts = Counter(frame.verdict for frame in self.frames)
        text = ", ".join(f"{counts[verdict]} {verdict}" for verdict in COLOURS)
        return f"{len(self.frames)} frames checked: {text}." + (f" **{self.fault}**" if self.fault else "")

    def play(self) -> None:
        """Go from frame to frame at the rate of the motion, where Play is ticked, until the page is closed."""
        while not self._closed.wait(1.0 / self.rate):
            if self.controls["play"].value:
                number = (self.controls["frame"].value + 1) % max(1, len(self.frames))
                self.controls["frame"].value = number
                self.show(number)


def frame_verdict_text(frame: Any) -> str:
    """The verdict on a frame, what was predicted, and its price."""
    spent = ", ".join(f"{name} {1e3 * seconds:.0f} ms" for name, seconds in frame.seconds.items())
    found = frame.predicted.verdict if frame.predicted.clean else f"**{frame.predicted.verdict}**"
    return f"{frame.time:.2f} s: **{frame.verdict}**\n\nprediction: {found}\n\n{spent} of processor time"


def preview_motion(
    scene: Scene, model: str | Path, port: int = PORT, host: str = LOOPBACK, trusted: Sequence[str] = ()
) -> MotionPreview:
    """Serve the page of a garment in motion; frames are checked while the page is shown.

    Parameters
    ----------
    scene : Scene
        With the cloth and the body model of the farm; its motion is any other.
    model : path
        Of `clothsim learn --motion`.
    port, host, trusted
        As of `preview`.

    Raises
    ------
    InputError
        A model of another garment or body, or viser is not installed.
    """
    viser = require_viser()
    garment = MovingGarment.of_scene(scene)
    made = garment.model_in(Path(model))
    coming = checked_motion(garment, made)
    first = next(coming)
    gate = Gate(host, trusted)
    up = up_direction(scene.up)
    page = MotionPreview(made.rate, up, [first], server=serve(viser, gate, port), gate=gate)
    page.nodes |= add_surfaces(page.server, garment.surfaces, first, up)
    gui = page.server.gui
    gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
    page.controls["verdict"] = gui.add_markdown("")
    page.controls["frame"] = gui.add_slider("Frame", 0, round(scene.run_settings.duration * made.rate), 1, 0)
    page.controls["play"] = gui.add_checkbox("Play", True)
    page.controls["counts"] = gui.add_markdown("")
    page.controls["frame"].on_update(lambda _: page.show(page.controls["frame"].value))
    page.show(0)
    for name, work in (("check", lambda: _check(page, coming)), ("play", page.play)):
        threading.Thread(target=work, name=f"clothsim {name}", daemon=True).start()
    return page


def _check(page: MotionPreview, coming: Any) -> None:
    """Add the frames that are still to come to a page."""
    try:
        for frame in coming:
            if page._closed.is_set():
                return
            page.frames.append(frame)
            time.sleep(0.0)  # the page answers in between
    except ClothsimError as error:
        page.fault = str(error)
