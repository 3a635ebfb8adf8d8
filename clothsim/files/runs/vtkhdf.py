"""VTKHDF layout of a trajectory: an HDF5 file that ParaView and pyvista open as a MultiBlockDataSet.

    VTKHDF/surface0, surface1, ...   PolyData: Points of all frames one below the other, triangles once
    VTKHDF/surface<k>/Steps          NSteps, and the offset in Points of each frame (always 0 where nothing moves)
    VTKHDF/Assembly/<name>           links that give the blocks their names and their order
    VTKHDF/Steps                     NSteps, the times [s], and the tables that are the same for all surfaces

Source: docs.vtk.org, "VTKHDF format specification", version 2.2. VTK 9.5 to 9.7 (ParaView 6) read every frame of it.
VTK 9.7 needs VTKHDF/Steps, which the specification does not require, or it shows the first frame only. In a
PartitionedDataSetCollection that group would show as an empty block. VTK before 9.5 reads no such file.

`Values` has exactly NSteps entries, as VTK copies all of it; all other tables may be longer.

A surface's block also holds CellData/<name> and PointData/<name>: arrays of all frames one below the other, a row per
triangle or vertex. Tensors are flattened row by row; the attribute `components` of the dataset is their shape.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import h5py
import numpy as np
from numpy.typing import ArrayLike

from clothsim.base.arrays import Ints
from clothsim.mesh.world import SurfaceRows

_TABLE_ROWS = 256
_INDEX_BYTES = 6_144
"""Bound on what a dataset adds to its index, and a table of four columns to itself, at a time."""
_GROUPS = {"triangle": "CellData", "vertex": "PointData"}


@dataclass(frozen=True)
class FrameArray:
    """Numbers that every frame holds on the surfaces of a role, a row per triangle or vertex.

    components: shape of a row, () for a scalar.
    """

    name: str
    location: Literal["triangle", "vertex"]
    components: tuple[int, ...] = ()
    role: Literal["cloth", "body"] = "cloth"

    @property
    def dataset(self) -> str:
        """Path of the values in a block."""
        return f"{_GROUPS[self.location]}/{self.name}"

    @property
    def offsets(self) -> str:
        """Path in a block of the table with the first row of each frame."""
        return f"Steps/{_GROUPS[self.location]}Offsets/{self.name}"

    def row_count(self, surface: SurfaceRows) -> int:
        """Number of its rows on a surface."""
        return surface.n_vertices if self.location == "vertex" else len(surface.triangles)


STRETCHES = FrameArray("principal_stretches", "triangle", (2,))


def lay_out(file: h5py.File, surfaces: Sequence[SurfaceRows], arrays: Sequence[FrameArray]) -> None:
    """Write the parts that are the same in every frame into the empty `file`."""
    root = file.create_group("VTKHDF", track_order=True)
    _mark(root, "MultiBlockDataSet")
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = 0
    steps.create_dataset("Values", (0,), "f8", maxshape=(None,), chunks=(_TABLE_ROWS,))
    _create_table(steps, "PartOffsets")
    _create_table(steps, "NumberOfParts", fill=1)
    _create_table(steps, "CellOffsets", columns=(4,))
    assembly = root.create_group("Assembly", track_order=True)
    for k, surface in enumerate(surfaces):
        _create_block(root.create_group(f"surface{k}"), surface, steps, arrays_for(surface, arrays))
        assembly[_link_name(surface.name, list(assembly))] = h5py.SoftLink(f"/VTKHDF/surface{k}")


def set_frame_count(file: h5py.File, frames: int, last_time: float | None) -> None:
    """Set the number of frames that readers see; last_time [s]: of the last one where it is new."""
    steps = file["VTKHDF/Steps"]
    steps["Values"].resize(frames, axis=0)
    if last_time is not None:
        steps["Values"][frames - 1] = last_time
    for block in (file["VTKHDF"], *blocks(file)):
        block["Steps"].attrs.modify("NSteps", frames)


def write_frame(block: h5py.Group, name: str, frame: int, values: ArrayLike) -> None:
    """Append the rows of one frame."""
    rows, dataset = np.asarray(values), block[name]
    first = frame * len(rows)
    dataset.resize(first + len(rows), axis=0)
    dataset[first:] = rows


def grow_tables(file: h5py.File, frame: int) -> None:
    """Extend the tables of Steps to `frame` and the next few hundred, whose entries are all known."""
    rows = frame // _TABLE_ROWS * _TABLE_ROWS + _TABLE_ROWS
    shared = file["VTKHDF/Steps"]
    if len(shared["PartOffsets"]) >= rows:
        return
    for name in ("PartOffsets", "NumberOfParts", "CellOffsets"):
        shared[name].resize(rows, axis=0)
    for block in blocks(file):
        if block.attrs["Moving"]:
            _write_offsets(block["Steps/PointOffsets"], rows, block["NumberOfPoints"][0])
        for array in arrays_of(block):
            _write_offsets(block[array.offsets], rows, rows_of(block, array))


def frame_size_bound(surfaces: Sequence[SurfaceRows], arrays: Sequence[FrameArray]) -> int:
    """Upper bound on the bytes that a frame adds, uncompressed, with the pieces of index and tables that it may add."""
    size = _INDEX_BYTES * (3 + len(surfaces) * (3 + 2 * len(arrays)))
    for surface in surfaces:
        size += 24 * surface.n_vertices
        for array in arrays_for(surface, arrays):
            size += 4 * array.row_count(surface) * int(np.prod(array.components))
    return size + size // 100  # gzip adds up to that to what it cannot compress


def layout_size_bound(surfaces: Sequence[SurfaceRows], arrays: Sequence[FrameArray]) -> int:
    """Upper bound on the bytes of `lay_out`."""
    blocks_size = _INDEX_BYTES * (3 + len(surfaces) * (10 + 2 * len(arrays)))
    return blocks_size + sum(40 * len(surface.triangles) for surface in surfaces)


def truncate(file: h5py.File, frames: int) -> None:
    """Drop the frames from number `frames` on, and the data of an incomplete one."""
    set_frame_count(file, frames, None)
    file.flush()
    for block in blocks(file):
        n = int(block["NumberOfPoints"][0])
        block["Points"].resize(n * (frames if block.attrs["Moving"] else min(frames, 1)), axis=0)
        for array in arrays_of(block):
            block[array.dataset].resize(frames * rows_of(block, array), axis=0)
    file.flush()


def blocks(file: h5py.File) -> Iterator[h5py.Group]:
    """The group of each surface, in order."""
    root = file["VTKHDF"]
    return (root[f"surface{k}"] for k in range(len(root["Assembly"])))


def arrays_for(surface: SurfaceRows, arrays: Sequence[FrameArray]) -> list[FrameArray]:
    """The arrays of a surface's role."""
    return [array for array in arrays if array.role == surface.role]


def arrays_of(block: h5py.Group) -> list[FrameArray]:
    """The arrays of a block beside its positions."""
    listed = []
    for location in ("triangle", "vertex"):
        for name, dataset in block.get(_GROUPS[location], {}).items():
            components = dataset.attrs.get("components", dataset.shape[1:])
            listed.append(FrameArray(name, location, tuple(int(n) for n in components), block.attrs["Role"]))
    return listed


def rows_of(block: h5py.Group, array: FrameArray) -> int:
    """Number of rows that an array has in a frame."""
    return int(block["NumberOfPoints" if array.location == "vertex" else "Polygons/NumberOfCells"][0])


def _create_block(block: h5py.Group, surface: SurfaceRows, shared: h5py.Group, arrays: Sequence[FrameArray]) -> None:
    triangles = surface.own_triangles
    _mark(block, "PolyData")
    block.attrs.update({"Name": surface.name, "Role": surface.role, "Moving": int(surface.moving)})
    if surface.rigid:
        block.attrs["Rigid"] = 1
    if len(surface.edges):
        block.attrs["Radius"] = surface.radius
    block["NumberOfPoints"] = np.array([surface.n_vertices])
    _create_frames(block, "Points", surface.n_vertices, (3,), "f8")
    _create_cells(block.create_group("Polygons"), triangles)
    _create_cells(block.create_group("Vertices"), triangles[:0])
    block["Strips"] = block["Vertices"]
    if len(surface.edges):
        _create_cells(block.create_group("Lines"), surface.edges - surface.rows.start)
    else:
        block["Lines"] = block["Vertices"]
    steps = block.create_group("Steps")
    steps.attrs["NSteps"] = 0
    for name in ("Values", "PartOffsets", "NumberOfParts", "CellOffsets"):
        steps[name] = shared[name]
    steps["ConnectivityIdOffsets"] = shared["CellOffsets"]
    if surface.moving:
        _create_table(steps, "PointOffsets")
    else:
        steps["PointOffsets"] = shared["PartOffsets"]
    for array in arrays:
        columns = (int(np.prod(array.components)),) if array.components else ()
        _create_frames(block, array.dataset, rows_of(block, array), columns, "f4")
        if len(array.components) > 1:
            block[array.dataset].attrs["components"] = np.array(array.components)
        _create_table(block, array.offsets)


def _create_frames(block: h5py.Group, name: str, rows: int, columns: tuple[int, ...], kind: str) -> None:
    chunks = (max(rows, 1), *columns)
    pack = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
    block.create_dataset(name, (0, *columns), kind, maxshape=(None, *columns), chunks=chunks, **pack)


def _create_table(steps: h5py.Group, name: str, columns: tuple[int, ...] = (), fill: int = 0) -> None:
    chunks = (_TABLE_ROWS, *columns)
    steps.create_dataset(name, (0, *columns), "i8", maxshape=(None, *columns), chunks=chunks, fillvalue=fill)


def _create_cells(group: h5py.Group, cells: Ints) -> None:
    group["NumberOfCells"] = np.array([len(cells)])
    group["NumberOfConnectivityIds"] = np.array([cells.size])
    group["Offsets"] = cells.shape[1] * np.arange(len(cells) + 1)
    group["Connectivity"] = cells.ravel()


def _write_offsets(table: h5py.Dataset, rows: int, size: int) -> None:
    table.resize(rows, axis=0)
    table[:] = size * np.arange(rows)


def _mark(group: h5py.Group, kind: str) -> None:
    group.attrs["Version"] = np.array([2, 2])
    group.attrs.create("Type", np.bytes_(kind))


def _link_name(name: str, taken: Sequence[str]) -> str:
    """`name` without the characters of HDF5 paths, different from those `taken`."""
    plain = name.replace("/", "_").replace("\0", "_").strip(".") or "surface"
    return plain if plain not in taken else _link_name(f"{plain}_", taken)
