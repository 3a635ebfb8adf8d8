"""Data sets of drapes, as `clothsim farm pack DIR -o data.h5` writes them: indexable, without a network library.

A class with `__len__` and `__getitem__` is what the loaders of PyTorch, JAX and others take. Nothing of a simulator is
imported.
"""

import json
import operator
import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from clothsim.base.errors import InputError
from clothsim.base.inputs import is_number


class Drapes:
    """The usable drapes of a data set, in the order of the plan.

    Parameters
    ----------
    path : path
        The .h5 file. Each process opens it at its first access, so a data loader may fork.

    Attributes
    ----------
    rows : tuple of dict
        One row per drape: id, parameters, seconds, values of its certificate.
    inputs : tuple of str
        The varied keys that are numbers.
    card : str
        The data card in Markdown: licence, ranges, certificates, what was left out and why.
    licence : str

    Raises
    ------
    InputError
        If the file is not a data set of drapes.

    Examples
    --------
    A data set of three drapes of a tetrahedron's four vertices:

    >>> from tempfile import TemporaryDirectory
    >>> folder = TemporaryDirectory()
    >>> with h5py.File(f"{folder.name}/data.h5", "w") as file:
    ...     rows = [{"id": f"{k}", "parameters": {"cloth.density": 0.1 * k}, "meshes": {}} for k in range(3)]
    ...     file["manifest"], file["card"] = [json.dumps(row) for row in rows], "# Drapes"
    ...     file["garments/0/ids"], file["garments/0/positions"] = ["0", "1", "2"], np.zeros((3, 4, 3), "f4")
    ...     file.attrs["licence"] = "CC0-1.0"
    >>> data = Drapes(f"{folder.name}/data.h5")
    >>> len(data), data.inputs, data[2]["inputs"], data[2]["positions"].shape
    (3, ('cloth.density',), array([0.2], dtype=float32), (4, 3))
    >>> folder.cleanup()
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._opened: tuple[int, h5py.File] | None = None
        if not self.path.is_file():
            raise InputError(f"There is no file {self.path}.", "Write one: `clothsim farm pack DIR -o data.h5`.")
        try:
            file = self._file
            rows = [json.loads(line) for line in file["manifest"].asstr()]
            self.licence = str(file.attrs["licence"])
            self.card = str(file["card"].asstr()[()])
            places = {
                name: (group, row)
                for group, content in file["garments"].items()
                for row, name in enumerate(content["ids"].asstr())
            }
            self.rows: tuple[dict[str, Any], ...] = tuple(row for row in rows if row["id"] in places)
            self._places = [places[row["id"]] for row in self.rows]
        except (OSError, KeyError, ValueError, TypeError, AttributeError) as error:
            raise InputError(
                f"{self.path} is not a data set of drapes ({error}).", "Write one: `clothsim farm pack DIR -o data.h5`."
            ) from error

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """The varied keys with a number in every drape."""
        keys = self.rows[0]["parameters"] if self.rows else {}
        return tuple(key for key in keys if all(is_number(row["parameters"][key]) for row in self.rows))

    def __len__(self) -> int:
        """Number of drapes."""
        return len(self._places)

    def __getitem__(self, index: int) -> dict[str, Any]:
        """A drape.

        Returns
        -------
        dict
            "id"; "inputs" (k,) float32, the numbers of `inputs`; "parameters", all varied keys; "positions" (n, 3), or
            (frames, n, 3), float32 [m], all garments one after the other.
        """
        number = range(len(self))[operator.index(index)]
        group, row = self._places[number]
        parameters = self.rows[number]["parameters"]
        return {
            "id": self.rows[number]["id"],
            "inputs": np.array([parameters[key] for key in self.inputs], np.float32),
            "parameters": dict(parameters),
            "positions": np.asarray(self._file[f"garments/{group}/positions"][row]),
        }

    def garments(self, index: int) -> dict[str, Mapping[str, NDArray[Any]]]:
        """The garments of a drape as cut, by name: start, rest, triangles, material and uv."""
        return self._meshes(index, "cloth")

    def bodies(self, index: int) -> dict[str, Mapping[str, NDArray[Any]]]:
        """The bodies of a drape by name: start and triangles."""
        return self._meshes(index, "body")

    def _meshes(self, index: int, kind: str) -> dict[str, Mapping[str, NDArray[Any]]]:
        named = self.rows[range(len(self))[operator.index(index)]]["meshes"].get(kind, {})
        meshes = self._file["meshes"]
        return {name: {key: values[()] for key, values in meshes[digest].items()} for name, digest in named.items()}

    @property
    def _file(self) -> h5py.File:
        if self._opened is None or self._opened[0] != os.getpid():
            self._opened = os.getpid(), h5py.File(self.path, "r")
        return self._opened[1]

    def __getstate__(self) -> dict[str, Any]:
        """Without the open file, for a process that is spawned."""
        return {**self.__dict__, "_opened": None}
