"""Choice of the renderer. VTK is tested in another process, as it ends a process in which it cannot draw.

That takes half a second, so a success is noted in the cache of the user, for this installation and this display. The
note is away while VTK draws the first picture of a process: one that VTK ends leaves none, and the next tests again.
"""

import ctypes
import hashlib
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from clothsim.base.errors import InputError
from clothsim.base.kernel_cache.storage import user_cache

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


_GRAPHICS = ("/usr/share/glvnd/egl_vendor.d", "/dev/dri", "/usr/lib/x86_64-linux-gnu", "/usr/lib64")
"""Folders that change where a graphics driver is installed or removed."""


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
    if find_spec("vtkmodules") is None:
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
    """True where VTK has drawn in another process, now or before."""
    note = _note()
    if note is not None and note.is_file():
        return True
    try:
        done = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


@contextmanager
def vtk_attempt() -> Iterator[None]:
    """Draw by VTK: a success is noted, for the next processes."""
    note = None if _drawn else _note()
    with suppress(OSError):
        if note is not None:
            note.unlink(missing_ok=True)
    yield
    _drawn.add(os.getpid())
    with suppress(OSError):
        if note is not None:
            note.parent.mkdir(parents=True, exist_ok=True)
            note.touch()


_drawn: set[int] = set()
"""Processes in which VTK has drawn: this one, or none."""


def _note() -> Path | None:
    """The file that says that VTK draws here; None without a cache."""
    folder = user_cache()
    if folder is None or not sys.platform.startswith("linux"):
        return None
    known = [sys.executable, os.uname().nodename, _PROBE]
    known += [os.environ.get(name, "") for name in ("DISPLAY", "LD_LIBRARY_PATH", "VTK_DEFAULT_OPENGL_WINDOW")]
    vtk = find_spec("vtkmodules")
    for place in ("" if vtk is None else vtk.origin, *_GRAPHICS):
        with suppress(OSError):
            known.append(f"{place} {Path(place or '').stat().st_mtime_ns}")
    return folder / "clothsim" / f"vtk_draws_{hashlib.blake2b(' '.join(known).encode(), digest_size=8).hexdigest()}"
