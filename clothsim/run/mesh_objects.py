"""Frames of a run as objects of other packages: trimesh and PyVista."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from clothsim.base.errors import InputError, MissingPackageError
from clothsim.render.surface_look import Surface
from clothsim.run.pictures import frame_surfaces

if TYPE_CHECKING:
    import pyvista
    import trimesh

    from clothsim.run.results import Run


def to_trimesh(run: "Run", frame: int = -1) -> "trimesh.Scene":
    """A frame of a run as a scene of trimesh: a geometry for each cloth and body, by its name, in metres.

    Parameters
    ----------
    run : Run
    frame : int
        Negative frames count from the end.

    Returns
    -------
    trimesh.Scene
        Vertices and triangles are those of the run, in its order.

    Raises
    ------
    InputError
        For a missing frame, or for something other than a run.
    MissingPackageError
        Without trimesh.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.Scene({"mesh": "rectangle", "cells": [2, 2]}, effects=[clothsim.Inertia()])
    >>> clothsim.to_trimesh(clothsim.simulate(scene)).geometry["cloth"].vertices.shape
    (9, 3)
    """
    trimesh = _package("trimesh")
    made = trimesh.Scene()
    for each in _surfaces(run, frame):
        mesh = trimesh.Trimesh(each.positions, each.triangles, process=False)
        made.add_geometry(mesh, node_name=each.name, geom_name=each.name)
    return made


def to_pyvista(run: "Run", frame: int = -1) -> "pyvista.MultiBlock":
    """A frame of a run as blocks of PyVista: one for each cloth and body, by its name, in metres.

    Parameters
    ----------
    run : Run
    frame : int
        Negative frames count from the end.

    Returns
    -------
    pyvista.MultiBlock
        Blocks of PolyData; those of cloths have the principal stretches (m, 2) of their triangles as cell data.

    Raises
    ------
    InputError
        For a missing frame, or for something other than a run.
    MissingPackageError
        Without PyVista.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.Scene({"mesh": "rectangle", "cells": [2, 2]}, effects=[clothsim.Inertia()])
    >>> clothsim.to_pyvista(clothsim.simulate(scene))["cloth"]["principal_stretches"].shape
    (8, 2)
    """
    pyvista = _package("pyvista")
    made = pyvista.MultiBlock()
    for each in _surfaces(run, frame):
        block = pyvista.PolyData.from_regular_faces(each.positions, each.triangles)
        if len(each.principal_stretches):
            block.cell_data["principal_stretches"] = each.principal_stretches
        made[each.name] = block
    return made


def _surfaces(run: "Run", frame: int) -> list[Surface]:
    """The cloths and bodies of a frame. InputError for what is not a run, such as the name of its directory."""
    if not hasattr(run, "trajectory"):
        raise InputError(f"This takes a run, not {run!r:.80}.", "Open one: clothsim.open_run(DIRECTORY).")
    return frame_surfaces(run.trajectory, frame)


def _package(name: str) -> Any:
    """A package that is loaded where it is used alone. MissingPackageError if it is not installed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingPackageError(f"This needs the package {name}.", f"pip install {name}") from error
