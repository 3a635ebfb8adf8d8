"""Parts of the page of a run: the scene with its first camera, and the controls beside it."""

from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.render import BODY_GREY
from clothsim.viewer.page import Page
from clothsim.viewer.side_texts import certificate_text, legend_html, state_text

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
    grey = tuple(round(255 * shade) for shade in BODY_GREY)
    return server.scene.add_mesh_simple(
        f"/body/{name}", points.astype(np.float32), triangles.astype(np.uint32), color=grey, side="double"
    )


def look_at(server: Any, points: Floats, up: Any) -> float:
    """Let the first camera see all `points (n, 3)` from the front and above; their extent [m].

    up: a direction, or any text for +z.
    """
    direction = np.array([0.0, 0.0, 1.0]) if isinstance(up, str) else np.array(up) / np.linalg.norm(up)
    server.scene.set_up_direction(tuple(direction))
    low, high = points.min(axis=0), points.max(axis=0)
    size = float(np.linalg.norm(high - low))
    across = np.cross(direction, [0.0, 1.0, 0.0] if abs(direction[1]) < 0.9 else [1.0, 0.0, 0.0])
    away = np.cross(across, direction)
    server.initial_camera.look_at = (low + high) / 2
    server.initial_camera.position = (low + high) / 2 + size * (0.42 * across - 0.95 * away + 0.42 * direction)
    server.initial_camera.up = direction
    return size


def add_controls(page: Page, names: list[str]) -> None:
    """Time, colour, bodies and texts."""
    gui, run, controls = page.server.gui, page.run, page.controls
    gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
    controls["state"] = gui.add_markdown(state_text(run))
    controls["frame"] = gui.add_slider("Frame", 0, max(1, len(run) - 1), 1, 0)
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
