import ctypes
import subprocess
import sys

import pytest

from clothsim.base.errors import InputError
from clothsim.render import display
from clothsim.render.display import choose_renderer

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the libraries looked for are Linux's")


@pytest.fixture(autouse=True)
def _fresh_answer(monkeypatch):
    monkeypatch.delenv("CLOTHSIM_RENDERER", raising=False)
    answer = display.why_not_vtk
    answer.cache_clear()
    yield
    answer.cache_clear()


@linux
def test_no_graphics_library_means_ray_casting_and_names_the_package(monkeypatch):
    def missing(name):
        raise OSError(name)

    monkeypatch.setattr(ctypes, "CDLL", missing)
    monkeypatch.setattr(display, "_probe", lambda: pytest.fail("VTK must not be tried"))
    renderer, note = choose_renderer("auto")
    assert renderer == "ray"
    assert "libegl1" in note
    assert "\n" not in note
    with pytest.raises(InputError, match="libegl1"):
        choose_renderer("vtk")


@pytest.mark.parametrize("death", ["import os; os.kill(os.getpid(), 11)", "raise SystemExit(1)"])
def test_a_probe_that_dies_means_ray_casting(monkeypatch, death):
    monkeypatch.setattr(display, "_PROBE", death)
    monkeypatch.setattr(display, "_any_library", lambda: True)
    renderer, note = choose_renderer("auto")
    assert renderer == "ray"
    assert "no working" in note


def test_a_probe_that_lives_means_vtk(monkeypatch):
    monkeypatch.setattr(display, "_PROBE", "pass")
    monkeypatch.setattr(display, "_any_library", lambda: True)
    assert choose_renderer("auto")[0] == "vtk"


@linux
def test_a_success_is_noted_and_a_process_that_vtk_ends_leaves_no_note(monkeypatch, tmp_path):
    monkeypatch.setattr(display, "user_cache", lambda: tmp_path / "cache")
    monkeypatch.setattr(display, "_drawn", set())
    note = display._note()
    assert note.parent == tmp_path / "cache" / "clothsim"
    with display.vtk_attempt():
        assert not note.is_file()
    assert note.is_file()
    monkeypatch.setattr(subprocess, "run", lambda *words, **options: pytest.fail("it is known"))
    assert display._probe()
    monkeypatch.setattr(display, "_drawn", set())
    with pytest.raises(KeyboardInterrupt), display.vtk_attempt():  # as where the process ends
        raise KeyboardInterrupt
    assert not note.is_file()


def test_the_environment_decides_where_the_call_does_not(monkeypatch):
    monkeypatch.setattr(display, "why_not_vtk", lambda: "")
    monkeypatch.setenv("CLOTHSIM_RENDERER", "ray")
    assert choose_renderer("auto")[0] == "ray"
    assert choose_renderer("vtk")[0] == "vtk"
    monkeypatch.setenv("CLOTHSIM_RENDERER", "povray")
    with pytest.raises(InputError, match="povray"):
        choose_renderer("auto")


def test_nothing_heavy_is_loaded_before_something_is_drawn():
    code = (
        "import sys, clothsim.render.movie;"
        "print([m for m in ('pyvista', 'vtkmodules', 'trimesh', 'embreex', 'imageio') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
