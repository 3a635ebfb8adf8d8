"""Table of mesh generators: the names that a scene's `mesh` may have, and the functions behind them.

A generator returns positions (n, 3) [m], centred on the origin, and triangles (m, 3), all wound alike: flat meshes lie
in z = 0 and face +z, the others face outward. The mannequin stands on z = 0, and its garments are where it wears them.
The keywords of a generator are the keys of the scene file; InputError names a bad one.
"""

import importlib
from collections.abc import Callable, Iterator, Mapping
from typing import TypeAlias

from clothsim.base.arrays import Floats, Ints

Generator: TypeAlias = Callable[..., tuple[Floats, Ints]]

_HERE = "clothsim.mesh.generators"
_MODULES = {
    "rectangle": "shapes",
    "disk": "shapes",
    "tube": "shapes",
    "pillow": "shapes",
    "sphere": "shapes",
    "slab": "shapes",
    "capsule": "shapes",
    "cone": "shapes",
    "ring": "shapes",
    "mannequin": "mannequin.generator",
    "shirt": "garments",
    "skirt": "garments",
    "trousers": "garments",
}
"""Module, below `clothsim.mesh.generators`, of the function of each name."""


class _Generators(Mapping[str, Generator]):
    """Generators by name. A module is imported when one of its generators is looked up, not before."""

    def __getitem__(self, name: str) -> Generator:
        return getattr(importlib.import_module(f"{_HERE}.{_MODULES[name]}"), name)

    def __contains__(self, name: object) -> bool:
        return name in _MODULES  # the inherited test would look the generator up

    def __iter__(self) -> Iterator[str]:
        return iter(_MODULES)

    def __len__(self) -> int:
        return len(_MODULES)


GENERATORS: Mapping[str, Generator] = _Generators()
"""All generators by the name that a scene gives."""
