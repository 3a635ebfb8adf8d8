"""A sequence of mesh files of one topology: the frames of an animation."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from glob import iglob
from itertools import islice
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.files.meshes.mesh_file import USD_ENDINGS, checked, read_polygons
from clothsim.files.meshes.mesh_part import MeshFile, Part, choose
from clothsim.files.meshes.polygons import Polygons, cut_polygons

MOST_FRAMES, MOST_BYTES = 20_000, 8 << 30
"""Largest number of frames, and largest memory of their positions [bytes]."""


def frame_files(directory: Path, pattern: str) -> list[Path]:
    """The files that match `pattern` ("kick/shell*.obj") in `directory`, in natural order: shell2 before shell10.

    InputError where there is none.
    """
    try:
        names = list(islice(iglob(pattern, root_dir=directory), MOST_FRAMES + 1))
    except (ValueError, re.error) as error:
        raise InputError(f"frames = {pattern!r} is no pattern of file names ({error}).") from error
    if len(names) > MOST_FRAMES:
        raise InputError(
            f"frames = {pattern!r} matches more than {MOST_FRAMES:,} files.", "Name the frames more closely."
        )
    if not names:
        raise InputError(
            f"No file matches frames = {pattern!r}.", f"It starts from {directory}; * stands for any characters."
        )
    return [directory / name for name in sorted(names, key=lambda name: (_natural(name), name))]


def read_frames(files: Sequence[Path], part: Part, rate: float = 25.0) -> tuple[MeshFile, Floats]:
    """Read the frames of an animation.

    Parameters
    ----------
    files : sequence of Path
        Meshes of the same vertices and faces.
    part : Part
        The part of each file, and its unit.
    rate : float
        Frames a second that are taken of one USD file, which has its own times.

    Returns
    -------
    mesh : MeshFile
        The first file; its quads are cut in all frames alike.
    positions : (k, n, 3) ndarray
        Vertices in each frame [m].

    Raises
    ------
    InputError
        A file has other vertices or faces than the first.
    """
    if len(files) == 1 and files[0].suffix.lower() in USD_ENDINGS:
        from clothsim.files.meshes.usd_reader import read_usd_frames

        states = [checked(files[0], each) for each in read_usd_frames(files[0], rate, MOST_FRAMES)]
        return _one_topology([files[0]] * len(states), iter(states), part)
    return _one_topology(files, (read_polygons(file) for file in files), part)


def _one_topology(files: Sequence[Path], states: Iterator[Polygons], part: Part) -> tuple[MeshFile, Floats]:
    """The mesh and the frames of polygons that have the faces of the first; files: where each comes from."""
    first = next(states)
    cut = cut_polygons(first)
    mesh = choose(files[0], first, cut, part)
    size = len(files) * mesh.positions.nbytes
    if size > MOST_BYTES:
        raise InputError(
            f"{len(files):,} frames of {len(mesh.positions):,} vertices take {size / 1e9:.2g} GB.",
            "Name fewer frames, or a part of the mesh.",
        )
    frames = [mesh.positions]
    for file, polygons in zip(files[1:], states, strict=True):
        _refuse_other_topology(file, polygons, files[0], first)
        moved = replace(first, positions=polygons.positions)
        frames.append(choose(file, moved, cut, part).positions)
    return mesh, np.stack(frames)


def _refuse_other_topology(file: Path, other: Polygons, first_file: Path, first: Polygons) -> None:
    remedy = "All frames of a body need the same vertices and faces in the same order."
    counts = (("vertices", len(other.positions), len(first.positions)), ("faces", len(other.starts), len(first.starts)))
    for what, has, expected in counts:
        if has != expected:
            less = 1 if what == "faces" else 0
            raise InputError(f"{file} has {has - less} {what}, {first_file.name} has {expected - less}.", remedy)
    sizes = np.flatnonzero(np.diff(other.starts) != np.diff(first.starts))
    if len(sizes):
        raise InputError(f"{file}: face {sizes[0]} has another number of corners than in {first_file.name}.", remedy)
    differ = np.flatnonzero(other.corners != first.corners)
    if len(differ):
        face = int(np.searchsorted(first.starts, differ[0], side="right")) - 1
        rows = slice(first.starts[face], first.starts[face + 1])
        raise InputError(
            f"{file}: face {face} is {other.corners[rows].tolist()}, in {first_file.name} "
            f"{first.corners[rows].tolist()}.",
            remedy,
        )


def _natural(name: str) -> list[tuple[int, str]]:
    """The sort key of a name: digits by their number, everything else as text."""
    return [(int(word), "") if word.isdecimal() else (-1, word) for word in re.split(r"([0-9]+)", name)]
