"""Path-traced pictures of a photographer's studio: soft lights, a backdrop, woven cloth with rims, hems and stitches.

Needs Mitsuba 3 (Jakob et al. 2022), `pip install 'clothsim[look]'`. Its scalar variant is taken: the vectorised ones
need a library of LLVM, and some of those end the process. The light that leaves a surface is divided by its colour,
smoothed where depth and normal agree by an edge-avoiding a-trous filter (Dammertz et al. 2010), and multiplied again.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.linalg import unit
from clothsim.base.triangles import area_vectors
from clothsim.render.camera import Viewpoint
from clothsim.render.colour_scale import Scale
from clothsim.render.surface_look import THREAD, Surface, cloth_shell, creased_normals, vertex_values

PALETTE = np.array(
    [[0.055, 0.125, 0.245], [0.55, 0.24, 0.075], [0.115, 0.20, 0.125], [0.40, 0.055, 0.075], [0.62, 0.55, 0.43]]
)
"""Linear RGB of cloths without a field or dyes: indigo, ochre, bottle green, madder, ecru."""
BACKDROP = np.array([0.78, 0.78, 0.79])
RIBS, TEXELS, RIB_PIXELS = 48, 768, 2.4
"""Ribs and texels of a tile of the weave, and the least width of a rib in a picture [pixels]."""
RIB, RELIEF = 1.6e-3, 0.25
"""Width of a rib [m], and how much darker the cloth is between two."""
MELANGE, SLUB = 0.025, 3.0
"""Variation of the brightness of the threads, which changes along a thread after so many ribs: threads that were the
same all along would be seen as a plaid."""
DEPTH = 5
"""Bounces of light."""
PATHS = 6
"""Paths of a pixel for each of the picture's samples squared."""
FINER = 2
"""Pixels that are traced and smoothed for one of the picture, each way: outlines are as smooth as the surfaces."""
CHECKS = 4
"""Pairs of bands along a tile of a cloth that is woven of two dyes."""


def render(
    surfaces: Sequence[Surface],
    scale: Scale | None,
    camera: Viewpoint,
    size: tuple[int, int],
    up: Floats,
    samples: int = 2,
    dyes: Floats | None = None,
) -> Floats:
    """The picture (height, width, 3), sRGB in [0, 1].

    Parameters
    ----------
    surfaces : sequence of Surface
        Cloths and bodies, smooth already.
    scale : Scale or None
        Colours of the cloths by their values; None: those of PALETTE.
    camera, size, up
        As of a `PictureSetup`.
    samples : int
        Samples of a pixel in each direction.
    dyes : (k, 2, 3) array, optional
        sRGB of the two threads of each cloth, the first one's again after the last; None: those of PALETTE.

    Raises
    ------
    InputError
        Without Mitsuba.
    """
    mi = _mitsuba()
    threads = np.stack([PALETTE, PALETTE], axis=1) if dyes is None else np.asarray(dyes) ** 2.2
    everything = np.concatenate([each.positions for each in surfaces])
    extent = float(np.ptp(everything, axis=0).max())
    pixel = 2.0 * camera.tangents[1] / size[1] * float((camera.position - everything.mean(axis=0)) @ camera.axes[2])
    shapes: list[Any] = []
    n_cloths = 0
    for surface in surfaces:
        if surface.role == "body":
            normals = creased_normals(surface.positions, surface.triangles)
            shapes.append(_mesh(mi, surface.positions[surface.triangles], normals, _LACQUER))
        else:
            shapes += _cloth(mi, surface, threads[n_cloths % len(threads)], scale, pixel)
            n_cloths += 1
    aovs = "colour:albedo,normal:sh_normal,depth:depth"
    scene = {
        "type": "scene",
        "integrator": {"type": "aov", "aovs": aovs, "traced": {"type": "path", "max_depth": DEPTH}},
        "sensor": _sensor(mi, camera, (FINER * size[0], FINER * size[1]), extent),
        **{f"surface_{k}": shape for k, shape in enumerate(shapes)},
        **_stage(mi, everything, camera, up, extent),
    }
    paths = max(PATHS * samples**2 // FINER**2, 1)
    traced = np.array(mi.render(mi.load_dict(scene), spp=paths), np.float32)
    light, colour, normal, depth = traced[..., :3], traced[..., 3:6], traced[..., 6:9], traced[..., 9]
    fine = _developed(_denoised(light, colour, normal, depth, extent))
    return np.asarray(fine.reshape(size[1], FINER, size[0], FINER, 3).mean(axis=(1, 3)))


def _mitsuba() -> Any:
    """The module `mitsuba` in its scalar variant. InputError where it is not installed."""
    try:
        import mitsuba
    except ImportError as error:
        raise InputError(
            'The style "studio" needs Mitsuba.', "pip install 'clothsim[look]', or use the style \"fabric\"."
        ) from error
    mitsuba.set_variant("scalar_rgb")
    return mitsuba


def _mesh(
    mi: Any, corners: Floats, normals: Floats, material: dict[str, Any], uv: Floats | None = None, colour: Any = None
) -> Any:
    """A mesh of triangles with corners of their own, (k, 3, 3) each."""
    properties = mi.Properties()
    properties["mesh_bsdf"] = mi.load_dict(material)
    count = 3 * len(corners)
    has = {"has_vertex_normals": True, "has_vertex_texcoords": uv is not None}
    mesh = mi.Mesh("", count, len(corners), props=properties, **has)
    if colour is not None:
        mesh.add_attribute("vertex_colour", 3, np.ascontiguousarray(colour, np.float32).ravel())
    data = mi.traverse(mesh)
    data["vertex_positions"] = np.ascontiguousarray(corners, np.float32).ravel()
    data["vertex_normals"] = np.ascontiguousarray(normals, np.float32).ravel()
    data["faces"] = np.arange(count, dtype=np.uint32)
    if uv is not None:
        data["vertex_texcoords"] = np.ascontiguousarray(uv, np.float32).ravel()
    data.update()
    return mesh


def _cloth(mi: Any, surface: Surface, dyes: Floats, scale: Scale | None, pixel: float) -> list[Any]:
    """The meshes of a cloth and, where their threads are as wide as a pixel, of its stitches.

    dyes: (2, 3) linear RGB of its threads; pixel: its width on the cloth [m].
    """
    rib = max(RIB, RIB_PIXELS * pixel)
    shell, stitches = cloth_shell(surface)
    values = vertex_values(surface)
    if scale is not None and len(values):
        painted = (scale.colours(values)[shell.source] ** 2.2).reshape(-1, 3)
        made = [_mesh(mi, shell.corners, shell.normals, _woven(mi, None, rib), shell.uv, painted)]
    else:
        made = [_mesh(mi, shell.corners, shell.normals, _woven(mi, dyes, rib), shell.uv)]
    if len(stitches) and pixel < 2.0 * THREAD:
        facing = unit(area_vectors(stitches))
        normals = np.broadcast_to(facing[:, None], stitches.shape)
        made.append(_mesh(mi, stitches, normals, _diffuse(0.6 * dyes.mean(axis=0) + 0.01)))
    return made


def _diffuse(colour: Floats) -> dict[str, Any]:
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(colour)}}}


_LACQUER = {
    "type": "twosided",
    "bsdf": {
        "type": "principled",
        "base_color": {"type": "rgb", "value": [0.66, 0.61, 0.55]},
        "roughness": 0.42,
        "specular": 0.45,
    },
}
"""Satin lacquer of a shop's mannequin."""


def _woven(mi: Any, dyes: Floats | None, rib: float) -> dict[str, Any]:
    """Matt threads in a twill, with the sheen of fibres seen at a grazing angle; None: in the colours of the mesh."""
    height, threads = _twill()
    place = {"raw": True, "to_uv": mi.ScalarTransform4f().scale([1.0 / (RIBS * rib), 1.0 / (RIBS * rib), 1.0])}
    base: dict[str, Any] = {"type": "mesh_attribute", "name": "vertex_colour"}
    if dyes is not None:
        band = np.arange(TEXELS) * 2 * CHECKS // TEXELS % 2
        both = 0.5 * (dyes[band][None, :] + dyes[band][:, None])
        tile = np.clip(threads[..., None] * both, 0.0, 1.0).astype(np.float32)
        base = {"type": "bitmap", "bitmap": mi.Bitmap(tile), **place}
    fibres = {"roughness": 0.9, "specular": 0.12, "sheen": 0.7, "sheen_tint": 0.5}
    bump = {"type": "bitmap", "bitmap": mi.Bitmap(height[..., None].astype(np.float32)), **place}
    cloth = {"type": "principled", "base_color": base, **fibres}
    return {"type": "twosided", "bsdf": {"type": "bumpmap", "scale": 0.16 * rib, "texture": bump, "cloth": cloth}}


def _twill() -> tuple[Floats, Floats]:
    """A tile of a 2/1 twill: its height in 0..1, and the brightness of its threads about 1, (TEXELS, TEXELS) each."""
    u, v = np.meshgrid(np.arange(TEXELS) / TEXELS, np.arange(TEXELS) / TEXELS)
    phase = 2.0 * np.pi * RIBS * (u + v)
    height = (0.5 + 0.5 * np.cos(phase)) * (0.85 + 0.15 * np.cos(2.0 * np.pi * RIBS * (u - v)))
    random = np.random.default_rng(11)
    warp, weft = gaussian_filter1d(random.normal(size=(2, 2 * RIBS, TEXELS)), SLUB * TEXELS / RIBS, mode="wrap")
    at = np.arange(TEXELS) * 2 * RIBS // TEXELS
    threads = 1.0 + MELANGE * (warp[at].T + weft[at]) / warp.std()
    threads *= 1.0 - RELIEF * (1.0 - height)
    return height, np.clip(threads / threads.mean(), 0.3, 1.5)


def _stage(mi: Any, everything: Floats, camera: Viewpoint, up: Floats, extent: float) -> dict[str, Any]:
    """Floor that curves into a wall behind the scene, a large soft light, a weak one against it, and a sky."""
    right, _, back = camera.axes
    upright = up / np.linalg.norm(up)
    level = back - (back @ upright) * upright
    level = right if np.linalg.norm(level) < 1e-3 else level / np.linalg.norm(level)
    side = np.cross(upright, level)
    centre = 0.5 * (everything.min(axis=0) + everything.max(axis=0))
    floor = centre - (centre @ upright - (everything @ upright).min() + 1e-4 * extent) * upright
    radius, depth = 1.2 * extent, 1.8 * extent
    turns = np.linspace(0.0, 0.5 * np.pi, 24)
    ahead = np.concatenate([[8.0 * extent], -depth - radius * np.sin(turns), [-depth - radius]])
    height = np.concatenate([[0.0], radius * (1.0 - np.cos(turns)), [12.0 * extent]])
    profile = floor + ahead[:, None] * level + height[:, None] * upright
    left, far = profile - 14.0 * extent * side, profile + 14.0 * extent * side
    facing = unit(np.cross(side, np.gradient(profile, axis=0)))
    facing *= np.sign(facing @ (upright + level))[:, None]

    def strip(near: Floats, away: Floats) -> Floats:
        first = np.stack([near[:-1], away[:-1], near[1:]], axis=1)
        return np.concatenate([first, np.stack([away[:-1], away[1:], near[1:]], axis=1)])

    def panel(towards: Floats, distance: float, half: float, radiance: list[float]) -> dict[str, Any]:
        origin = centre + distance * extent * unit(towards)
        turned = mi.ScalarTransform4f().look_at(
            origin=list(origin), target=list(centre), up=list(upright + 0.01 * side)
        )
        emitter = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
        return {
            "type": "rectangle",
            "to_world": turned @ mi.ScalarTransform4f().scale(half * extent),
            "emitter": emitter,
        }

    return {
        "backdrop": _mesh(mi, strip(left, far), strip(facing, facing), _diffuse(BACKDROP)),
        "key": panel(-1.05 * right + 0.85 * upright + 0.25 * level, 2.6, 0.7, [20.0, 19.3, 18.2]),
        "fill": panel(1.0 * right + 0.35 * upright + 0.7 * level, 3.2, 1.0, [0.75, 0.8, 0.9]),
        "rim": panel(0.75 * right + 0.9 * upright - 0.75 * level, 2.4, 0.5, [5.0, 5.0, 5.2]),
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 0.20}},
    }


def _sensor(mi: Any, camera: Viewpoint, size: tuple[int, int], extent: float) -> dict[str, Any]:
    _, picture_up, back = camera.axes
    looking = mi.ScalarTransform4f().look_at(
        origin=list(camera.position), target=list(camera.position - back), up=list(picture_up)
    )
    film = {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    return {
        "type": "perspective",
        "fov": float(2.0 * np.degrees(np.arctan(camera.tangents[1]))),
        "fov_axis": "y",
        "near_clip": 1e-3 * extent,
        "far_clip": 200.0 * extent,
        "to_world": looking,
        "film": {**film, "component_format": "float32"},
        "sampler": {"type": "independent"},
    }


ROUNDS = 5
"""Passes of the filter; each reaches twice as far as the one before."""
_KERNEL = (1.0, 4.0, 6.0, 4.0, 1.0)


def _denoised(light: Any, colour: Any, normal: Any, depth: Any, extent: float) -> Any:
    """Light (h, w, 3) smoothed where the surface does not change, and along outlines."""
    height, width = depth.shape
    base = np.maximum(colour, 0.02)
    seen = light / base
    lit = (seen.max(axis=2, keepdims=True) > UNLIT).astype(np.float32)
    slopes = [_lesser_slope(depth, axis) for axis in (0, 1)]
    for level in range(ROUNDS):
        step = 2**level
        total, weight = np.zeros_like(seen), np.zeros((height, width, 1), np.float32)
        brightness = seen.mean(axis=2)
        tolerance = np.inf if level < FINER else 0.5 ** (level - FINER + 1)
        reach = 2 * step
        around = ((reach, reach), (reach, reach), (0, 0))
        padded = [np.pad(each, around, mode="edge") for each in (seen, normal, depth[..., None], lit)]
        for i in range(5):
            for j in range(5):
                rows, columns = slice(i * step, i * step + height), slice(j * step, j * step + width)
                other, facing, far, counts = (each[rows, columns] for each in padded)
                alike = np.clip((facing * normal).sum(axis=2), 0.0, 1.0) ** 64
                plane = depth + step * ((i - 2) * slopes[0] + (j - 2) * slopes[1])
                near = np.exp(-np.abs(far[..., 0] - plane) / (0.004 * extent * step))
                close = np.exp(-np.abs(other.mean(axis=2) - brightness) / (tolerance * np.maximum(brightness, 0.05)))
                w = (_KERNEL[i] * _KERNEL[j] * alike * near * close)[..., None] * counts
                total += w * other
                weight += w
        seen = np.where(weight > 1e-6, total / np.maximum(weight, 1e-6), seen)
    trusted = np.where(np.linalg.norm(normal, axis=2, keepdims=True) >= WHOLE, 1.0, _OUT_OF_REACH)
    trusted = (trusted * np.where(lit > 0.0, 1.0, _OUT_OF_REACH)).astype(np.float32)
    features = np.concatenate([normal, 3.0 * colour], axis=2)
    mended = trusted[..., 0] < 1.0
    seen[mended] = _beside_outlines(seen, features, trusted)[mended]
    return seen * base


def _lesser_slope(depth: Any, axis: int) -> Any:
    """Difference of the depth (h, w) to the next or from the last pixel, the smaller one: none across an outline."""
    ahead = np.diff(depth, axis=axis, append=np.take(depth, [-1], axis=axis))
    behind = np.roll(ahead, 1, axis=axis)
    return np.where(np.abs(ahead) < np.abs(behind), ahead, behind)


WHOLE, CLOSE = 0.985, 0.03
"""Length of the mean normal below which a pixel shows two surfaces, and the variance of what looks the same there."""
UNLIT = 0.03
"""Light, relative to the colour, of a pixel that a smooth normal turns away from the camera: it does not count."""
_OUT_OF_REACH = 1e-6
"""Weight of neighbours that show two surfaces themselves, and of those without light."""


def _beside_outlines(seen: Any, features: Any, trusted: Any) -> Any:
    """Light (h, w, 3) of the neighbours that show one surface, those of the nearest normal and colour before others.

    features: (h, w, 6) mean normal and colour; trusted: (h, w, 1) weights of the pixels.
    """
    height, width, _ = features.shape
    total, weight = np.zeros_like(seen), np.zeros((height, width, 1), np.float32)
    around = ((2, 2), (2, 2), (0, 0))
    padded, light, weights = (np.pad(each, around, mode="edge") for each in (features, seen, trusted))
    for i in range(5):
        for j in range(5):
            rows, columns = slice(i, i + height), slice(j, j + width)
            apart = ((padded[rows, columns] - features) ** 2).sum(axis=2, keepdims=True)
            w = weights[rows, columns] / (CLOSE + apart) ** 2
            total += w * light[rows, columns]
            weight += w
    return total / weight


def _developed(light: Any) -> Floats:
    """SRGB in [0, 1] of linear light, its brightest part compressed."""
    linear = np.maximum(light, 0.0)
    linear = np.where(linear < 0.7, linear, 0.7 + 0.3 * (1.0 - np.exp(-(linear - 0.7) / 0.3)))
    return np.clip(np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055), 0.0, 1.0)
