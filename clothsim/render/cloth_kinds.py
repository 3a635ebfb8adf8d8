"""How kinds of cloth look: one row of KINDS for each, its weave as a tile of texels, and its material for Mitsuba.

A tile repeats each RIBS ribs. Its colours have the dye for their mean, also where a light weft shows between the warp.
Light that fibres scatter along the outline (Koenderink and Pont 2003, "The secret of velvety skin") is a lighter matt
layer, which hides the cloth the more the flatter the camera sees it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from clothsim.base.arrays import Floats

RIBS, TEXELS = 48, 768
"""Ribs and texels of a tile of the weave."""
SLUB = 3.0
"""Ribs after which the brightness of a thread changes: threads that were the same all along would be a plaid."""
CHECKS = 4
"""Pairs of bands along a tile of a cloth that is woven of two dyes."""
DARKEST = 0.35
"""Least brightness of the warp relative to the dye, whose mean with the light weft is the dye."""
FUZZ_POWER = 5.0
"""Exponent of 1 - cos of the angle to the camera: fuzz is seen along the outline."""
FUZZ_LIGHTER = 0.45
"""How far the colour of fuzz is from the dye to white."""


@dataclass(frozen=True)
class ClothKind:
    """How one kind of cloth is drawn.

    Parameters
    ----------
    weave : str
        Key of WEAVES.
    rib : float
        Width of a rib [m].
    pixels : float
        Least width of a rib in a picture [pixels].
    relief : float
        Height of a rib over its width, for the shading.
    shade : float
        How much darker the cloth is between two ribs.
    melange : float
        Standard deviation of the brightness of the threads.
    weft : float
        How far the colour of the weft is from the dye to white.
    fuzz : float
        Share of the fibres' scattered light at the outline.
    thread : (float, float, float), optional
        Linear RGB of stitches; None: the cloth's, darker.
    hem : bool
        True: its borders are folded over and sewn.
    fibres : mapping
        Numbers of Mitsuba's principled material beside its colour.
    """

    weave: str
    rib: float = 1.6e-3
    pixels: float = 2.4
    relief: float = 0.0
    shade: float = 0.0
    melange: float = 0.0
    weft: float = 0.0
    fuzz: float = 0.0
    thread: tuple[float, float, float] | None = None
    hem: bool = True
    fibres: Mapping[str, float] = field(default_factory=dict)


_MATT = {"roughness": 0.9, "specular": 0.12, "sheen": 0.7, "sheen_tint": 0.5}
_DENSE = {**_MATT, "specular": 0.0}
_SILK = {"roughness": 0.46, "specular": 0.35, "anisotropic": 0.5}
_METAL = {"roughness": 0.22, "metallic": 0.8, "specular": 0.7, "clearcoat": 1.0, "clearcoat_gloss": 0.95}
_PAPER = {"roughness": 0.55, "specular": 0.2}
OCHRE = (0.55, 0.27, 0.06)
KINDS = {
    "plain": ClothKind("plain", relief=0.15, shade=0.15, melange=0.025, fuzz=0.6, fibres=_MATT),
    "twill": ClothKind("twill", relief=0.22, shade=0.25, melange=0.025, fuzz=0.6, fibres=_MATT),
    "denim": ClothKind("denim", rib=2.0e-3, pixels=3.2, relief=0.3, shade=0.25, melange=0.05, weft=0.22, fuzz=0.5,
                  thread=OCHRE, fibres=_MATT),
    "jersey": ClothKind("jersey", rib=1.4e-3, pixels=3.2, relief=0.25, shade=0.3, fuzz=0.9, fibres=_MATT),
    "rib": ClothKind("jersey", rib=4.0e-3, pixels=5.0, relief=0.4, shade=0.45, fuzz=0.9, fibres=_MATT),
    "satin": ClothKind("twill", relief=0.06, shade=0.1, melange=0.015, fuzz=0.3, fibres=_SILK),
    "foil": ClothKind("smooth", hem=False, fibres=_METAL),
    "felt": ClothKind("felt", relief=0.25, shade=0.2, fuzz=0.9, hem=False, fibres=_DENSE),
    "board": ClothKind("smooth", hem=False, fibres=_PAPER),
}  # fmt: skip
"""Kinds of cloth by name; the first is the default."""

KIND_OF = {
    "cotton": "plain", "wool": "twill", "wool_lycra": "twill", "polyester": "plain", "denim": "denim",
    "interlock": "jersey", "rib_knit": "rib", "ponte_roma": "jersey", "swimwear": "satin", "jet_set": "satin",
    "blanket": "felt", "tablecloth": "plain", "trousers": "twill", "light_weave": "plain", "medium_weave": "plain",
    "heavy_weave": "twill",
}  # fmt: skip
"""The kind of each named fabric."""
FILM, BOARD, LIGHT, HEAVY = 6e-5, 4e-4, 0.1, 0.3
"""Of a fabric without a name: thickness below which it is a foil [m], bending stiffness above which it is a board
[N m], and weights below which it is a satin and above which it is a felt [kg/m2]."""


def kind_of(name: str, density: float, thickness: float, bending_stiffness: float) -> str:
    """The key of KINDS of a fabric; an unknown name: by its numbers [kg/m2, m, N m].

    >>> kind_of("denim", 0.324, 6.2e-4, 2.66e-5), kind_of("", 0.04, 3e-5, 6e-6)
    ('denim', 'foil')
    """
    if name in KIND_OF:
        return KIND_OF[name]
    if thickness < FILM:
        return "foil"
    if bending_stiffness > BOARD:
        return "board"
    return "satin" if density < LIGHT else "felt" if density > HEAVY else "plain"


def _grid() -> tuple[Floats, Floats]:
    """Position along both sides of a tile in ribs, (TEXELS, TEXELS) each."""
    along = np.arange(TEXELS) * (RIBS / TEXELS)
    u, v = np.meshgrid(along, along)
    return u, v


def _plain() -> tuple[Floats, Floats]:
    u, v = _grid()
    height = np.sqrt(np.abs(np.cos(np.pi * u) * np.cos(np.pi * v)))
    return height, np.zeros_like(height)


def _twill() -> tuple[Floats, Floats]:
    u, v = _grid()
    height = (0.5 + 0.5 * np.cos(2.0 * np.pi * (u + v))) * (0.85 + 0.15 * np.cos(2.0 * np.pi * (u - v)))
    return height, np.zeros_like(height)


def _denim() -> tuple[Floats, Floats]:
    """Three warp threads lie over one of the weft, which shows in the grooves of the ribs."""
    height, _ = _twill()
    return height, np.clip((0.3 - height) / 0.2, 0.0, 1.0)


def _jersey() -> tuple[Floats, Floats]:
    """Wales of loops, each a V."""
    u, v = _grid()
    off = np.abs(2.0 * (u % 1.0) - 1.0)
    height = (1.0 - off**2) * (0.85 + 0.15 * np.cos(2.0 * np.pi * (v + 0.6 * off)))
    return height, np.zeros_like(height)


def _smooth() -> tuple[Floats, Floats]:
    return np.ones((TEXELS, TEXELS)), np.zeros((TEXELS, TEXELS))


def _felt() -> tuple[Floats, Floats]:
    """Matted fibres without a direction."""
    height = np.random.default_rng(7).normal(size=(TEXELS, TEXELS))
    for axis in (0, 1):
        height = gaussian_filter1d(height, 0.35 * TEXELS / RIBS, axis=axis, mode="wrap")
    return np.clip(0.5 + 0.25 * height / height.std(), 0.0, 1.0), np.zeros_like(height)


WEAVES: dict[str, Callable[[], tuple[Floats, Floats]]] = {
    "plain": _plain,
    "twill": _twill,
    "denim": _denim,
    "jersey": _jersey,
    "smooth": _smooth,
    "felt": _felt,
}
"""Height of a tile, and the share of the weft in its colour, in 0..1, (TEXELS, TEXELS) each, of each weave."""


def threads_of(kind: ClothKind) -> tuple[Floats, Floats, Floats]:
    """A tile of a cloth: its height in 0..1, the brightness of its threads about 1, the share of the weft."""
    height, weft = WEAVES[kind.weave]()
    random = np.random.default_rng(11)
    warp, across = gaussian_filter1d(random.normal(size=(2, 2 * RIBS, TEXELS)), SLUB * TEXELS / RIBS, mode="wrap")
    at = np.arange(TEXELS) * 2 * RIBS // TEXELS
    threads = 1.0 + kind.melange * (warp[at].T + across[at]) / warp.std()
    threads *= 1.0 - kind.shade * (1.0 - height)
    return height, np.clip(threads / threads.mean(), 0.3, 1.5), weft


def tile_of(kind: ClothKind, dyes: Floats) -> tuple[Floats, Floats]:
    """The height (TEXELS, TEXELS) and the linear RGB (TEXELS, TEXELS, 3) of a tile; dyes: of its two threads, (2, 3).

    The mean of the colours is that of the dyes.
    """
    height, threads, weft = threads_of(kind)
    band = np.arange(TEXELS) * 2 * CHECKS // TEXELS % 2
    dyed = 0.5 * (dyes[band][None, :] + dyes[band][:, None])
    share = float(weft.mean())
    if share > 0.0:
        lighter = kind.weft * (1.0 - dyed)
        most = (1.0 - DARKEST) * dyed * (1.0 - share) / share
        dyed = dyed + np.minimum(lighter, most) * (weft[..., None] - share) / (1.0 - share)
    tile = threads[..., None] * dyed
    tile *= dyes.mean(axis=0) / np.maximum(tile.mean(axis=(0, 1)), 1e-9)  # the weft lies in the darker grooves
    return height, np.clip(tile, 0.0, 1.0)


def fuzz_of(kind: ClothKind, facing: Floats) -> Floats:
    """Share of the fibres' light in what the camera sees; facing: |cos| of its angle with the normals."""
    return kind.fuzz * (1.0 - np.clip(np.abs(facing), 0.0, 1.0)) ** FUZZ_POWER


def material(mi: Any, kind: ClothKind, dyes: Floats | None, pixel: float) -> dict[str, Any]:
    """The material of a cloth for Mitsuba, `mi`; of a mesh with the attributes `vertex_fuzz`, and `vertex_colour`.

    dyes: (2, 3) linear RGB of its threads; None: in the colours of the mesh, without fuzz; pixel: its width on the
    cloth [m].
    """
    rib = max(kind.rib, kind.pixels * pixel)
    place = {"raw": True, "to_uv": mi.ScalarTransform4f().scale([1.0 / (RIBS * rib), 1.0 / (RIBS * rib), 1.0])}
    height, tile = tile_of(kind, np.ones((2, 3)) if dyes is None else dyes)
    base: dict[str, Any] = {"type": "mesh_attribute", "name": "vertex_colour"}
    if dyes is not None:
        base = {"type": "bitmap", "bitmap": mi.Bitmap(tile.astype(np.float32)), **place}
    cloth: dict[str, Any] = {"type": "principled", "base_color": base, **kind.fibres}
    if np.ptp(height) > 0.0:
        bump = {"type": "bitmap", "bitmap": mi.Bitmap(height[..., None].astype(np.float32)), **place}
        cloth = {"type": "bumpmap", "scale": kind.relief * rib, "texture": bump, "cloth": cloth}
    if kind.fuzz > 0.0 and dyes is not None:
        mean = dyes.mean(axis=0)
        lighter = {"type": "rgb", "value": list(mean + FUZZ_LIGHTER * (1.0 - mean))}
        weight = {"type": "mesh_attribute", "name": "vertex_fuzz"}
        fuzz = {"type": "diffuse", "reflectance": lighter}
        cloth = {"type": "blendbsdf", "weight": weight, "cloth": cloth, "fuzz": fuzz}
    return {"type": "twosided", "bsdf": cloth}
