"""Transfer of garments between bodies: arrays in, arrays out.

`transfer_garment` moves a garment from one body to another by deformation transfer (Sumner and Popovic 2004) with the
body as the source; `correspond_bodies` matches bodies of different topology, with given markers or those of
`derive_markers`. `deformation_transfer` does the same with any pairs of triangles. `refine_garment` moves vertices out
of a body (Guan et al. 2012). `read_body_model` and `BodyModel` pose a skinned body, `kernel_average` extends its
skinning to points off the body, and `PosedBody` poses and unposes a garment with it. Positions are (n, 3) in metres,
triangles (m, 3). The package imports nothing from clothsim, and loads its names on first use.
"""

import ast as _ast
from importlib import import_module as _import_module
from pathlib import Path as _Path
from typing import TYPE_CHECKING as _TYPE_CHECKING
from warnings import warn as _warn

if _TYPE_CHECKING:
    from transfer.body_model import BodyModel, PosedBody, posed_body, read_body_model
    from transfer.body_model import body_model as make_body_model
    from transfer.body_parts import derive_markers
    from transfer.canonical import (
        Unposed,
        closest_average,
        kernel_average,
        sampled_average,
        unposed_in_field,
    )
    from transfer.correspond import Correspondence, Similarity, by_boxes, by_points
    from transfer.correspond import correspond as correspond_bodies
    from transfer.deform import DeformationTransfer, SourceFrames, deformation_transfer, source_frames
    from transfer.errors import TransferError
    from transfer.garment import garment_transfer, transfer_garment
    from transfer.refine import Refined
    from transfer.refine import refine as refine_garment
    from transfer.signed_distance import BodySurface, body_surface

_HOMES = {
    alias.asname or alias.name: (node.module, alias.name)
    for node in _ast.walk(_ast.parse(_Path(__file__).read_text(encoding="utf-8")))
    if isinstance(node, _ast.ImportFrom) and node.module and node.module.startswith("transfer.")
    for alias in node.names
}
"""The module of each public name, and its name there: the imports above, which type checkers read."""

__all__ = list(_HOMES)


def __getattr__(name: str) -> object:
    if name == "followed_source":
        _warn("transfer.followed_source is now source_frames.", DeprecationWarning, stacklevel=2)
        name = "source_frames"
    if name not in _HOMES:
        raise AttributeError(f"module 'transfer' has no attribute {name!r}")
    module, original = _HOMES[name]
    return getattr(_import_module(module), original)


def __dir__() -> list[str]:
    return sorted(_HOMES)
