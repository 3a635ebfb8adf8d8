"""Live preview of a model of drapes, and of a garment in motion: predicted, with the verdict of the exact test."""

import tempfile
import threading
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim import Scene, simulate
from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from clothsim.engine import MovingGarment, Predictor, checked_motion
from clothsim.viewer.page import add_background, add_body, look_at, up_direction
from clothsim.viewer.served import LOOPBACK, PORT, Gate, Served, require_viser, serve, state_text

if TYPE_CHECKING:
    import viser

CLEAR, CROSSING, DRAPED = (120, 160, 205), (215, 120, 100), (110, 170, 120)
"""Colours of a prediction without and with intersections, and of a drape that was simulated."""
STEPS = 50
"""Least number of steps of a slider, whose step is a power of ten."""


@dataclass(repr=False)
class Preview(Served):
    """Page of a model of drapes, served until `close`.

    Attributes
    ----------
    predictor : Predictor
    inputs : (p,) ndarray
        Values that are shown.
    shown : Prediction or None
    """

    predictor: Predictor
    inputs: Floats
    shown: Any = None

    def __repr__(self) -> str:
        return f"<Preview of {str(self.predictor.file)!r} at {self.url}>"

    def show(self, inputs: Any) -> Any:
        """Show the prediction for the values of the model's inputs, and return it (`Predictor.predicted`)."""
        began = perf_counter()
        with self._lock:
            made = self.predictor.predicted(inputs)
            self.inputs, self.shown = np.array(inputs, np.float64), made
            put_cloth(self.nodes, made.cloth, CLEAR if made.clean else CROSSING)
            for node, points in zip(self.nodes["bodies"], made.bodies, strict=True):
                node.vertices = points.astype(np.float32)
            seconds = perf_counter() - began
            verdict = made.verdict if made.clean else f"**{made.verdict}**"
            self.controls["verdict"].content = f"Prediction: {verdict}\n\n{1e3 * seconds:.0f} ms"
        return made

    def drape(self) -> str:
        """Simulate from the prediction that is shown, and return what it certifies.

        The end and its certificate are shown unless another prediction is by then.
        """
        button = self.controls["drape"]
        button.disabled = True
        with self._lock:
            asked, end = self.inputs, None
            self.controls["verdict"].content = "It drapes..."
        try:
            with tempfile.TemporaryDirectory(prefix="clothsim-preview-") as folder:
                run = simulate(self.predictor.scene_of(asked), Path(folder) / "run")
                end, text = np.concatenate(list(run[-1].positions.values())), state_text(run)
        except ClothsimError as error:
            text = f"**{error}**"
        finally:
            button.disabled = False
        with self._lock:
            if self.inputs is asked:  # a certificate beside another garment would be none of it
                self.controls["verdict"].content = f"Simulated: {text}"
                if end is not None:
                    put_cloth(self.nodes, end, DRAPED)
        return text


def put_cloth(nodes: dict[str, Any], cloth: Floats, colour: tuple[int, int, int]) -> None:
    """Move the nodes of `add_surfaces` to positions of all cloths (n, 3) [m], in a colour."""
    begin = 0
    for node in nodes["cloths"]:
        count = len(node.vertices)
        node.vertices = cloth[begin : begin + count].astype(np.float32)
        node.color = colour
        begin += count


def preview(
    scene: Scene, model: str | Path, port: int = PORT, host: str = LOOPBACK, trusted: Sequence[str] = ()
) -> Preview:
    """Serve the page of a model of drapes: its inputs as sliders, the predicted garment, and the exact verdict.

    Parameters
    ----------
    scene : Scene
        Of the farm that the model was learned from.
    model : path
        Of `clothsim learn`.
    port : int
        Port, or the next one that is free.
    host : str
        Address on which it is served; another than the loopback address opens it to the network.
    trusted : sequence of str
        Further names by which browsers reach it, such as "localhost:9000" of a tunnel.

    Returns
    -------
    Preview
        Its `url`; `close()` ends it.

    Raises
    ------
    InputError
        A model of another garment or body, or viser is not installed.
    """
    viser = require_viser()
    made = Predictor.of_model(scene, model)
    middle = 0.5 * (made.model.low + made.model.high)
    first = made.predicted(middle)
    gate = Gate(host, trusted)
    page = Preview(made, middle, server=serve(viser, gate, port), gate=gate)
    page.nodes |= add_surfaces(page.server, made.surfaces, first, scene.up)
    gui, space = page.server.gui, made.model
    gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
    page.controls["verdict"] = gui.add_markdown("")
    sliders = []
    for name, low, high in zip(space.inputs, space.low, space.high, strict=True):
        least, most, step = slider_range(float(low), float(high))
        value = float(np.clip(np.round(0.5 * (low + high) / step) * step, least, most))
        sliders.append(gui.add_slider(str(name), least, most, step, value))
    page.controls["sliders"] = sliders

    def moved(_: Any) -> None:
        page.show([each.value for each in sliders])

    def pressed(_: Any) -> None:
        page.drape()

    for slider in sliders:
        slider.on_update(moved)
    page.controls["drape"] = gui.add_button("Drape and certify")
    page.controls["drape"].on_click(pressed)
    page.show([each.value for each in page.controls["sliders"]])
    return page


def add_surfaces(server: "viser.ViserServer", surfaces: Any, first: Any, up: Any) -> dict[str, Any]:
    """Add the surfaces of a scene with the positions of a first prediction, and return their nodes by role."""
    add_background(server)
    everything = np.concatenate([first.cloth, *first.bodies])
    look_at(server, everything, up)
    nodes: dict[str, Any] = {"cloths": [], "bodies": []}
    for part in surfaces.cloths:
        low, high = int(part.triangles.min()), int(part.triangles.max()) + 1
        points, faces = everything[low:high].astype(np.float32), (part.triangles - low).astype(np.uint32)
        nodes["cloths"].append(
            server.scene.add_mesh_simple(f"/cloth/{part.name}", points, faces, color=CLEAR, side="double")
        )
    for part, points in zip(surfaces.bodies, first.bodies, strict=True):
        nodes["bodies"].append(add_body(server, part.name, points, part.triangles - int(part.triangles.min())))
    return nodes


def slider_range(low: float, high: float) -> tuple[float, float, float]:
    """First and last value of a slider within a box, both multiples of its step, and the step.

    >>> slider_range(1.600284, 1.798856)
    (1.601, 1.798, 0.001)
    """
    digits = -int(np.floor(np.log10(max(high - low, 1e-9) / STEPS)))
    step = 10.0**-digits
    first, last = (round(float(edge) * step, digits) for edge in (np.ceil(low / step), np.floor(high / step)))
    return (first, last, round(step, digits)) if first < last else (low, low + step, step)


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

    def check() -> None:
        try:
            for frame in coming:
                if page._closed.is_set():
                    return
                page.frames.append(frame)
                time.sleep(0.0)  # the page answers in between
        except ClothsimError as error:
            page.fault = str(error)

    for name, work in (("check", check), ("play", page.play)):
        threading.Thread(target=work, name=f"clothsim {name}", daemon=True).start()
    return page
