"""Page of a run: colours, binary glTF, picking, texts, and the served page."""

import io
import json
import subprocess
import sys
import urllib.request

import numpy as np
import pytest
import trimesh

import clothsim
from clothsim.base.errors import InputError
from clothsim.run.frames import PLAIN, STRETCH, Colouring
from clothsim.run.results import open_run
from clothsim.viewer import page as view_module
from clothsim.viewer.page import PANEL_WIDTH, WINDOW, as_glb, first_view, picked_vertex
from clothsim.viewer.served import Gate, legend_html, solver_text, speeds


def status_of(url: str) -> int:
    """HTTP status of a page on this machine, past any proxy."""
    with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(url, timeout=20) as answer:
        return answer.status


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A small sheet that falls onto a ball, with the pressure on the ball."""
    scene = clothsim.Scene(
        cloth={"mesh": "rectangle", "size": [0.4, 0.4], "cells": [6, 6], "position": [0, 0, 0.155]},
        body={"name": "ball", "mesh": "sphere", "radius": 0.15},
        effects={"inertia": {}, "membrane": {}, "gravity": {}, "body_contact": {}},
        solver={"dt": 0.02},
        run={"duration": 0.1, "frames_per_second": 50, "fields": ["body_pressure"]},
    )
    return clothsim.simulate(scene, tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def page(run):
    pytest.importorskip("viser")
    served = clothsim.view(run, port=18_765)
    yield served
    served.close()


def test_names_are_those_that_can_be_drawn(run):
    names = Colouring.names(run)
    assert {PLAIN, STRETCH, "stress", "compression", "body_pressure"} <= set(names)
    assert "contact_pressure" not in names  # the run did not write it
    for name in names:
        mesh = Colouring.of_run(run, name).mesh(1)
        assert mesh.colours.shape == mesh.positions.shape
        assert 0 <= mesh.colours.min() <= mesh.colours.max() <= 1


@pytest.mark.parametrize("name", [PLAIN, STRETCH, "stress", "body_pressure"])
def test_the_mesh_has_the_positions_of_the_frame(run, name):
    shown = Colouring.of_run(run, name)
    mesh = shown.mesh(2)
    assert np.array_equal(mesh.positions, shown.positions(run, 2))
    body = sum(len(triangles) for _, _, triangles in run.bodies(0))
    assert len(mesh.triangles) == (body if name == "body_pressure" else len(run.triangles))


def test_the_value_at_a_vertex_is_a_stretch_not_its_logarithm(run):
    shown = Colouring.of_run(run, STRETCH)
    mesh = shown.mesh(0)
    assert shown.value_at(mesh, 0) == "1"
    assert Colouring.of_run(run, "stress").value_at(mesh, 0).endswith("N/m")
    plain = Colouring.of_run(run, PLAIN)
    assert plain.value_at(plain.mesh(0), 0) == "-"


def test_one_range_for_all_frames(run):
    shown = Colouring.of_run(run, "stress")
    largest = max(float(shown.mesh(k).values.max()) for k in range(len(run)))
    assert shown.scale.high > 0.3 * largest
    first, last = shown.mesh(0), shown.mesh(len(run) - 1)
    assert np.ptp(first.colours, axis=0).max() < np.ptp(last.colours, axis=0).max()


def test_binary_gltf_is_read_by_a_reader_that_is_not_ours(run):
    mesh = Colouring.of_run(run, STRETCH).mesh(-1)
    data = io.BytesIO(as_glb(mesh.positions, mesh.triangles, mesh.colours))
    read = trimesh.load(data, file_type="glb", process=False, force="mesh")
    assert np.allclose(read.vertices, mesh.positions, atol=1e-6)
    assert np.array_equal(read.faces, mesh.triangles)
    assert np.abs(read.visual.vertex_colors[:, :3] / 255 - mesh.colours**2.2).max() < 1 / 255  # linear


def test_the_picked_vertex_is_the_nearest_that_the_ray_meets_first(run):
    mesh = Colouring.of_run(run, PLAIN).mesh(-1)
    above = mesh.positions + np.array([0.003, 0.002, 1.0])
    for k in range(0, len(above), 5):
        found = picked_vertex(mesh.positions, mesh.triangles, above[k], np.array([0, 0, -1.0]))
        if found is not None:
            across = np.linalg.norm(mesh.positions[:, :2] - above[k, :2], axis=1)
            assert across[found] <= 0.08
    assert picked_vertex(mesh.positions, mesh.triangles, np.array([5.0, 5, 1]), np.array([0, 0, -1.0])) is None


def test_of_two_sheets_the_nearer_one_is_picked():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    both = np.concatenate([square, square + np.array([0, 0, 1.0])])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    for side, corner in ((2.0, 5), (-1.0, 1)):
        direction = np.array([0, 0, -np.sign(side)])
        assert picked_vertex(both, triangles, np.array([0.9, 0.2, side]), direction) == corner


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0)])
@pytest.mark.parametrize(("width", "height"), [(390, 800), (1200, 800), (700, 1000)])
def test_the_first_view_has_all_points_beside_the_panel(width, height, up):
    points, fov = np.random.default_rng(3).normal(size=(200, 3)) * [2.0, 0.3, 1.0] + [0.0, 5.0, 1.0], 1.3
    position, target = first_view(points, np.array(up), fov, width, height)
    ahead = (target - position) / np.linalg.norm(target - position)
    right = np.cross(ahead, up)
    right /= np.linalg.norm(right)
    down, seen = np.cross(ahead, right), points - position
    pixels = (
        np.array([width, height]) / 2
        + height / 2 / np.tan(fov / 2) * np.stack([seen @ right, seen @ down], axis=1) / (seen @ ahead)[:, None]
    )
    free = np.array([width, height / 2] if width < 640 else [width - PANEL_WIDTH, height])
    assert np.all(seen @ ahead > 0.0)
    assert np.all(pixels > 0.0999 * free)
    assert np.all(pixels < 0.9001 * free)
    assert np.isclose(np.max(np.ptp(pixels, axis=0) / free), 0.8)


@pytest.mark.parametrize(("width", "height"), [(0, 0), (0, 800), (390, 0)])
def test_a_window_without_an_area_has_the_first_view_of_a_usual_one(width, height):
    """A page in a tab that is not shown yet reports 0 px."""
    points, up = np.random.default_rng(3).normal(size=(20, 3)), np.array([0.0, 0.0, 1.0])
    found = np.stack(first_view(points, up, 1.3, width, height))
    assert np.isfinite(found).all()
    assert np.array_equal(found, np.stack(first_view(points, up, 1.3, *WINDOW)))


def test_texts(run):
    assert speeds(np.array([[0, 0, 0], [0, 0, 0.2]]), np.array([0.0, 0.1])).tolist() == [0.0, 2.0]
    assert "1 of 5" in solver_text(run.record(), 0.03)
    assert legend_html(Colouring.of_run(run, PLAIN)) == ""
    assert legend_html(Colouring.of_run(run, "stress")).count("#") == 17


def test_the_page_is_served_and_follows_its_controls(page, run):
    assert status_of(page.url) == 200
    page.show(3)
    mesh = page.colouring.mesh(3)
    assert page.frame == 3
    assert page.nodes["cloth"].glb_data == as_glb(mesh.positions, mesh.triangles, mesh.colours)
    top = int(np.argmax(mesh.positions[:, 2]))
    assert page.pick(mesh.positions[top] + np.array([1e-4, 1e-4, 1.0]), np.array([0, 0, -1.0])) == top
    assert page.nodes["marker"].visible
    assert np.allclose(page.nodes["marker"].position, mesh.positions[top])
    page.colour_by("body_pressure")
    assert not page.nodes["body/ball"].visible
    page.colour_by(STRETCH)
    assert page.nodes["body/ball"].visible
    page.show(10**6)
    assert page.frame == len(run) - 1


def test_a_run_that_is_going_on_is_read_again(page, run):
    assert not page.refresh()
    page.run = open_run(run.directory)
    page.run.summary.clear()  # as before its end
    assert page.refresh()
    assert page.run.summary == run.summary


@pytest.mark.parametrize("colour", ["weight", "contact_pressure"])
def test_what_the_run_does_not_have_is_refused(run, colour):
    pytest.importorskip("viser")
    with pytest.raises(InputError):
        clothsim.view(run, port=18_767, colour=colour)


@pytest.mark.parametrize(
    ("host", "port"), [("127.0.0.1", 0), ("127.0.0.1", 70_000), ("192.0.2.1", 8080), ("a..b", 8080)]
)
def test_an_address_that_cannot_be_served_is_refused(run, host, port):
    with pytest.raises(InputError, match="port" if host == "127.0.0.1" else host):
        view_module.serve(None, Gate(host), port)


def test_without_viser_the_remedy_is_named(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(InputError) as caught:
        view_module.view(run)
    assert "clothsim[view]" in str(caught.value)


def test_the_command_serves_until_it_is_ended(run):
    pytest.importorskip("viser")
    command = [sys.executable, "-m", "clothsim", "view", str(run.directory), "--json", "--port", "18769"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as served:
        url = json.loads(served.stdout.readline())["url"]
        assert status_of(url) == 200
        served.terminate()
        served.wait(20)
