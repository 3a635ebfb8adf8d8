"""Transfer of garments between bodies: arrays in, arrays out.

`transfer_garment` moves a garment from one body to another by deformation transfer (Sumner and Popovic 2004) with the
body as the source; bodies of different topology are matched by `correspond_bodies`, with markers given or from
`derive_markers`. `deformation_transfer` does the same with any pairs of triangles, `refine_garment` moves vertices out
of a body (Guan et al. 2012), `read_body_model` and `BodyModel` pose a skinned body, `kernel_average` carries its
skinning to points off it, and `PosedBody` poses and unposes a garment with it. Positions are (n, 3) in metres,
triangles (m, 3). The package imports nothing of clothsim; its names are loaded when they are used.
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING as _TYPE_CHECKING

if _TYPE_CHECKING:
    from transfer.align import Similarity, by_boxes, by_points
    from transfer.body_file import body_model as make_body_model
    from transfer.body_file import read_body_model
    from transfer.body_model import BodyModel
    from transfer.canonical import PosedBody, Unposed, posed_body, unposed_in_field
    from transfer.correspond import Correspondence
    from transfer.correspond import correspond as correspond_bodies
    from transfer.deform import DeformationTransfer, deformation_transfer
    from transfer.diffuse import closest_average, kernel_average, sampled_average
    from transfer.errors import TransferError
    from transfer.follow import FollowedSource, followed_source
    from transfer.garment import garment_transfer, transfer_garment
    from transfer.landmarks import derive_markers
    from transfer.refine import Refined
    from transfer.refine import refine as refine_garment
    from transfer.signed_distance import BodySurface, body_surface

_HOMES = {
    "BodyModel": "transfer.body_model",
    "BodySurface": "transfer.signed_distance",
    "Correspondence": "transfer.correspond",
    "DeformationTransfer": "transfer.deform",
    "FollowedSource": "transfer.follow",
    "PosedBody": "transfer.canonical",
    "Refined": "transfer.refine",
    "Similarity": "transfer.align",
    "TransferError": "transfer.errors",
    "Unposed": "transfer.canonical",
    "body_surface": "transfer.signed_distance",
    "by_boxes": "transfer.align",
    "by_points": "transfer.align",
    "closest_average": "transfer.diffuse",
    "correspond_bodies": "transfer.correspond:correspond",
    "deformation_transfer": "transfer.deform",
    "derive_markers": "transfer.landmarks",
    "followed_source": "transfer.follow",
    "garment_transfer": "transfer.garment",
    "kernel_average": "transfer.diffuse",
    "make_body_model": "transfer.body_file:body_model",
    "posed_body": "transfer.canonical",
    "read_body_model": "transfer.body_file",
    "refine_garment": "transfer.refine:refine",
    "sampled_average": "transfer.diffuse",
    "transfer_garment": "transfer.garment",
    "unposed_in_field": "transfer.canonical",
}
"""The module of each public name, and its name there where that is also the name of a module."""

__all__ = [
    "BodyModel",
    "BodySurface",
    "Correspondence",
    "DeformationTransfer",
    "FollowedSource",
    "PosedBody",
    "Refined",
    "Similarity",
    "TransferError",
    "Unposed",
    "body_surface",
    "by_boxes",
    "by_points",
    "closest_average",
    "correspond_bodies",
    "deformation_transfer",
    "derive_markers",
    "followed_source",
    "garment_transfer",
    "kernel_average",
    "make_body_model",
    "posed_body",
    "read_body_model",
    "refine_garment",
    "sampled_average",
    "transfer_garment",
    "unposed_in_field",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'transfer' has no attribute {name!r}")
    module, _, other = _HOMES[name].partition(":")
    return getattr(_import_module(module), other or name)


def __dir__() -> list[str]:
    return list(__all__)
