"""Oracle: the frames of a run read with h5py and tested triangle against triangle in NumPy; no code of the package."""

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tests.hostile.case import RUN, Case

TOUCH = 1e-9
"""Crossings within this fraction of an edge of its ends are touching, not intersecting."""


def last_frame(file: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions (n, 3), triangles (m, 3) and the number of the surface of each triangle, of the last frame."""
    points, triangles, owner, count = [], [], [], 0
    with h5py.File(file) as content:
        root = content["VTKHDF"]
        last = int(root["Steps"].attrs["NSteps"]) - 1
        for k in range(len([name for name in root if name.startswith("surface")])):
            block = root[f"surface{k}"]
            size = int(block["NumberOfPoints"][0])
            begin = int(block["Steps/PointOffsets"][last])
            points.append(block["Points"][begin : begin + size])
            faces = block["Polygons/Connectivity"][:].reshape(-1, 3)
            triangles.append(faces + count)
            owner.append(np.full(len(faces), k))
            count += size
    return np.concatenate(points).astype(np.float64), np.concatenate(triangles), np.concatenate(owner)


def crossing_pairs(points: np.ndarray, triangles: np.ndarray, owner: np.ndarray, bodies: set[int]) -> int:
    """Pairs of triangles that share no vertex and of which an edge of one passes through the other.

    Body against body is not asked for. All pairs whose boxes overlap are tested, edge by edge (Moeller and Trumbore
    1997), in double precision.
    """
    corners = points[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    moving = ~np.isin(owner, list(bodies))
    found: set[tuple[int, int]] = set()
    for i in np.flatnonzero(moving):
        near = ((low <= high[i]) & (high >= low[i])).all(axis=1)
        near[: i + 1] &= ~moving[: i + 1]  # each pair once
        near &= ~(triangles[:, :, None] == triangles[i]).any(axis=(1, 2))
        for j in np.flatnonzero(near):
            if _crosses(corners[i], corners[j]) or _crosses(corners[j], corners[i]):
                found.add((int(i), int(j)))
    return len(found)


def _crosses(edges_of: np.ndarray, triangle: np.ndarray) -> bool:
    """True where an edge of the first triangle passes through the second one."""
    start = edges_of
    along = np.roll(edges_of, -1, axis=0) - start
    first, second = triangle[1] - triangle[0], triangle[2] - triangle[0]
    across = np.cross(along, second)
    determinant = across @ first
    with np.errstate(divide="ignore", invalid="ignore"):
        to_start = start - triangle[0]
        u = np.einsum("ij,ij->i", across, to_start) / determinant
        q = np.cross(to_start, first)
        v = np.einsum("ij,ij->i", along, q) / determinant
        t = (q @ second) / determinant
        inside = (u > TOUCH) & (v > TOUCH) & (u + v < 1 - TOUCH) & (t > TOUCH) & (t < 1 - TOUCH)
    return bool(inside.any())  # nan and inf, of an edge along the plane, are not inside


def fault_of_run(directory: Path) -> str:
    """What a run says of its last frame against what the oracle sees: a sentence, or empty."""
    points, triangles, owner = last_frame(directory / "trajectory.vtkhdf")
    if not np.isfinite(points).all():
        return "a vertex of the last frame is not finite"
    summary: dict[str, Any] = json.loads((directory / "summary.json").read_text())
    with h5py.File(directory / "trajectory.vtkhdf") as content:
        roles = [content[f"VTKHDF/surface{k}"].attrs["Role"] for k in range(int(owner.max()) + 1)]
    bodies = {k for k, role in enumerate(roles) if role in ("body", b"body")}
    pairs = crossing_pairs(points, triangles, owner, bodies)
    free = (summary.get("certificate") or {}).get("intersection_free")
    if pairs and free:
        return f"certified free of intersections, and {pairs} pairs of triangles intersect"
    return ""


def run_is_right(directory: str = "out") -> Any:
    """A check of a case that left its run in `directory`."""
    return lambda folder, text: fault_of_run(folder / directory)


def run_of(scene: str, name: str, wanted: str, says: str = "", small: bool = False) -> Case:
    """The case of a scene file that is run, its frames tested where it completes."""
    return Case(name, RUN, wanted, {"a.toml": scene}, says, check=run_is_right(), small=small)
