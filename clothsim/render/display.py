"""Choice of the renderer. VTK is tested in another process, as it ends a process in which it cannot draw."""

import ctypes
import os
import subprocess
import sys
from functools import cache
from importlib.util import find_spec

from clothsim.base.errors import InputError

_PROBE = """
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
import vtkmodules.vtkRenderingOpenGL2
window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetSize(8, 8)
window.AddRenderer(vtkRenderer())
window.Render()
raise SystemExit(0 if window.SupportsOpenGL() else 1)
"""


def choose_renderer(renderer: str) -> tuple[str, str]:
    """Name of the renderer, "vtk" or "ray", and a line of text that names it.

    VTK is only tried where it is known to work, or asked for by name.
    """
    wanted = os.environ.get("CLOTHSIM_RENDERER", "auto") if renderer == "auto" else renderer
    if wanted not in ("auto", "vtk", "ray"):
        raise InputError(f'The renderer must be "auto", "vtk" or "ray", not {wanted!r}.')
    if wanted == "ray":
        return "ray", "Drawn by ray casting, as asked."
    missing = why_not_vtk()
    if not missing:
        return "vtk", "Drawn by VTK."
    if wanted == "vtk":
        raise InputError(f"VTK cannot draw here: {missing}.", 'Or use the renderer "ray".')
    return "ray", f"Drawn by ray casting, as {missing}."


@cache
def why_not_vtk() -> str:
    """Reason why VTK cannot draw here, with the missing package; empty where it can.

    VTK tries X, then EGL, then OSMesa, and ends in a segmentation fault where all fail. On Linux their libraries are
    searched first; where some are present, a second process draws a tiny picture (1-3 s), the only reliable test.
    The result is cached for the life of this process.
    """
    if find_spec("pyvista") is None or find_spec("vtkmodules") is None:
        return "pyvista is not installed; `pip install pyvista` would give the better picture"
    if sys.platform.startswith("linux"):
        remedy = "`apt install libegl1 libgl1-mesa-dri` (Debian, Ubuntu) would give the better picture"
        if not _any_library():
            return f"there is neither EGL, OSMesa nor a display; {remedy}"
        if not _probe():
            return f"VTK found no working EGL, OSMesa or display; {remedy}"
        return ""
    return "" if _probe() else "VTK found no working OpenGL; a graphics driver would give the better picture"


def _any_library() -> bool:
    """True where one of the libraries through which VTK reaches OpenGL can be loaded."""
    names = ["libEGL.so.1", "libOSMesa.so", "libOSMesa.so.8", "libOSMesa.so.6"]
    for name in [*names, *(["libGL.so.1"] if os.environ.get("DISPLAY") else [])]:
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


def _probe() -> bool:
    try:
        done = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0
