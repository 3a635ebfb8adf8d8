"""Path-traced pictures of a photographer's studio: soft lights, a backdrop, woven cloth with rims, hems and stitches.

Needs Mitsuba 3 (Jakob et al. 2022), `pip install 'clothsim[look]'`. Its scalar variant is taken: the vectorised one,
about twice as fast, needs a library of LLVM, and some of those end the process; it is taken where DRJIT_LIBLLVM_PATH
names the library. The noise of the few paths of a pixel is removed by Open Image Denoise (Afra 2019), a network that
also sees the colour and the normal of what a pixel shows.
"""

import os
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.linalg import unit
from clothsim.base.srgb import linear_rgb, srgb
from clothsim.base.triangles import area_vectors
from clothsim.render.camera import Viewpoint
from clothsim.render.cloth_kinds import KINDS, fuzz_of, material
from clothsim.render.colour_scale import Scale
from clothsim.render.surface_look import THREAD, Surface, cloth_shell, creased_normals, rounded, vertex_values

PALETTE = np.array(
    [[0.055, 0.125, 0.245], [0.55, 0.24, 0.075], [0.115, 0.20, 0.125], [0.40, 0.055, 0.075], [0.62, 0.55, 0.43]]
)
"""Linear RGB of cloths without a field or dyes: indigo, ochre, bottle green, madder, ecru."""
BACKDROP = np.array([0.76, 0.755, 0.745])
DEPTH = 5
"""Bounces of light."""
PATHS = 3
"""Paths of a pixel for each of the picture's samples squared."""
STITCHED, LINE = 0.6, 0.75
"""Brightness of stitches relative to the cloth's, and of the line that they are from afar."""


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
    threads = np.stack([PALETTE, PALETTE], axis=1) if dyes is None else linear_rgb(np.asarray(dyes))
    everything = np.concatenate([each.positions for each in surfaces])
    extent = float(np.ptp(everything, axis=0).max())
    pixel = 2.0 * camera.tangents[1] / size[1] * float((camera.position - everything.mean(axis=0)) @ camera.axes[2])
    shapes: list[Any] = []
    n_cloths = 0
    for surface in surfaces:
        if surface.role == "body":
            body = rounded(surface, [each for each in surfaces if each.role == "cloth"])
            corners = body.positions[body.triangles]
            normals = _facing(corners, creased_normals(body.positions, body.triangles), camera)
            shapes.append(_mesh(mi, corners, normals, _LACQUER))
        else:
            shapes += _cloth(mi, surface, threads[n_cloths % len(threads)], scale, pixel, camera)
            n_cloths += 1
    aovs = "colour:albedo,normal:sh_normal"
    _, picture_up, back = camera.axes
    looking = mi.ScalarTransform4f().look_at(
        origin=list(camera.position), target=list(camera.position - back), up=list(picture_up)
    )
    film = {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    scene = {
        "type": "scene",
        "integrator": {"type": "aov", "aovs": aovs, "traced": {"type": "path", "max_depth": DEPTH}},
        "sensor": {
            "type": "perspective",
            "fov": float(2.0 * np.degrees(np.arctan(camera.tangents[1]))),
            "fov_axis": "y",
            "near_clip": 1e-3 * extent,
            "far_clip": 200.0 * extent,
            "to_world": looking,
            "film": {**film, "component_format": "float32"},
            "sampler": {"type": "independent"},
        },
        **{f"surface_{k}": shape for k, shape in enumerate(shapes)},
        **_stage(mi, everything, camera, up, extent),
    }
    traced = np.array(mi.render(mi.load_dict(scene), spp=PATHS * samples**2), np.float32)
    parts = [np.ascontiguousarray(traced[..., first : first + 3]) for first in (0, 3, 6)]
    return _developed(import_module("mitsuba_oidn").denoise(*parts, hdr=True))


def _mitsuba() -> Any:
    """The module `mitsuba` in the variant to be used. InputError where it or its denoiser is not installed."""
    try:
        mitsuba, _ = import_module("mitsuba"), import_module("mitsuba_oidn")
    except ImportError as error:
        raise InputError(
            'The style "studio" needs Mitsuba and its denoiser.',
            "pip install 'clothsim[look]', or use the style \"fabric\".",
        ) from error
    library = os.environ.get("DRJIT_LIBLLVM_PATH")
    try:
        mitsuba.set_variant("llvm_ad_rgb" if library else "scalar_rgb")
    except ImportError as error:
        raise InputError(
            f"Mitsuba cannot load DRJIT_LIBLLVM_PATH, {library!r}.", "Give the path of libLLVM.so, or unset it."
        ) from error
    return mitsuba


def _mesh(
    mi: Any,
    corners: Floats,
    normals: Floats,
    drawn_as: dict[str, Any],
    uv: Floats | None = None,
    attributes: Mapping[str, Floats] | None = None,
) -> Any:
    """A mesh of triangles with corners of their own, (k, 3, 3) each.

    drawn_as: its material; attributes: numbers at its corners, by name.
    """
    properties = mi.Properties()
    properties["mesh_bsdf"] = mi.load_dict(drawn_as)
    count = 3 * len(corners)
    has = {"has_vertex_normals": True, "has_vertex_texcoords": uv is not None}
    mesh = mi.Mesh("", count, len(corners), props=properties, **has)
    for name, values in (attributes or {}).items():
        mesh.add_attribute(name, values.size // count, np.ascontiguousarray(values, np.float32).ravel())
    data = mi.traverse(mesh)
    data["vertex_positions"] = np.ascontiguousarray(corners, np.float32).ravel()
    data["vertex_normals"] = np.ascontiguousarray(normals, np.float32).ravel()
    data["faces"] = np.arange(count, dtype=np.uint32)
    if uv is not None:
        data["vertex_texcoords"] = np.ascontiguousarray(uv, np.float32).ravel()
    data.update()
    return mesh


GRAZING = 0.06
"""Least cosine between the ray to the camera and a normal of a triangle that is seen: one beyond 90 degrees, as smooth
normals are beside a fold, would be a black slit."""


def _facing(corners: Floats, normals: Floats, camera: Viewpoint) -> Floats:
    """Normals (k, 3, 3) of triangles, turned to the camera where it sees the triangle and not its normal."""
    towards = unit(camera.position - corners)
    seen = np.einsum("ij,ij->i", area_vectors(corners), towards.mean(axis=1)) > 0.0
    short = np.maximum(GRAZING - np.einsum("ijk,ijk->ij", normals, towards), 0.0) * seen[:, None]
    return unit(normals + short[..., None] * towards)


def _cloth(mi: Any, surface: Surface, dyes: Floats, scale: Scale | None, pixel: float, camera: Viewpoint) -> list[Any]:
    """The meshes of a cloth and of its stitches.

    dyes: (2, 3) linear RGB of its threads; pixel: its width on the cloth [m].
    """
    kind = KINDS[surface.kind]
    shell, stitches = cloth_shell(surface, pixel, kind.hem)
    normals = _facing(shell.corners, shell.normals, camera)
    values = vertex_values(surface)
    if scale is not None and len(values):
        colour = linear_rgb(scale.colours(values)[shell.source]).reshape(-1, 3)
        made = [_mesh(mi, shell.corners, normals, material(mi, kind, None, pixel), shell.uv, {"vertex_colour": colour})]
    else:
        towards = unit(camera.position - shell.corners)
        fuzz = fuzz_of(kind, np.einsum("ijk,ijk->ij", shell.normals, towards))
        made = [_mesh(mi, shell.corners, normals, material(mi, kind, dyes, pixel), shell.uv, {"vertex_fuzz": fuzz})]
    if len(stitches):
        facing = unit(area_vectors(stitches))
        normals = np.broadcast_to(facing[:, None], stitches.shape)
        shade = STITCHED if pixel < 2.0 * THREAD else LINE
        thread = shade * dyes.mean(axis=0) if kind.thread is None else np.array(kind.thread)
        made.append(_mesh(mi, stitches, normals, _diffuse(thread)))
    return made


def _diffuse(colour: Floats) -> dict[str, Any]:
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(colour)}}}


_LACQUER = {
    "type": "twosided",
    "bsdf": {
        "type": "principled",
        "base_color": {"type": "rgb", "value": [0.55, 0.525, 0.49]},
        "roughness": 0.42,
        "specular": 0.45,
    },
}
"""Satin lacquer of a shop's mannequin."""


KEY, FILL, RIM, SKY = 1.12, 0.16, 0.30, 0.16
"""Brightness of a white matt surface that faces the light and has no other: with all of them, the side of a cloth that
the camera sees has about the colour of its dye."""


def _stage(mi: Any, everything: Floats, camera: Viewpoint, up: Floats, extent: float) -> dict[str, Any]:
    """Floor that curves into a wall behind the scene, and lights that turn with the camera.

    A large soft light over its left shoulder, a weak one from its right, one against it, and a sky.
    """
    side, upright = camera.axes[0], up / np.linalg.norm(up)
    level = np.cross(side, upright)
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

    def panel(towards: Floats, distance: float, half: float, brightness: float, tint: list[float]) -> dict[str, Any]:
        origin = centre + distance * extent * unit(towards)
        turned = mi.ScalarTransform4f().look_at(
            origin=list(origin), target=list(centre), up=list(upright + 0.01 * side)
        )
        radiance = brightness * np.pi * (distance / (2.0 * half)) ** 2 * np.array(tint)
        emitter = {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}}
        return {
            "type": "rectangle",
            "to_world": turned @ mi.ScalarTransform4f().scale(half * extent),
            "emitter": emitter,
        }

    return {
        "backdrop": _mesh(mi, strip(left, far), strip(facing, facing), _diffuse(BACKDROP)),
        "key": panel(-0.80 * side + 0.75 * upright + 0.60 * level, 3.6, 0.76, KEY, [1.02, 1.0, 0.97]),
        "fill": panel(1.0 * side + 0.35 * upright + 0.7 * level, 3.2, 1.0, FILL, [0.95, 1.0, 1.08]),
        "rim": panel(0.75 * side + 0.9 * upright - 0.75 * level, 2.4, 0.5, RIM, [1.0, 1.0, 1.04]),
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": SKY}},
    }


SHOULDER = 0.6
"""Linear light from which on it is compressed: white cloth that lies under the lamp still shows its folds."""


def _developed(light: Any) -> Floats:
    """SRGB in [0, 1] of linear light, its brightest part compressed without a change of hue or saturation."""
    linear = np.maximum(np.asarray(light, np.float64), 0.0)
    most = linear.max(axis=-1, keepdims=True)
    shown = 1.0 - (1.0 - SHOULDER) * np.exp(np.minimum(SHOULDER - most, 0.0) / (1.0 - SHOULDER))
    return np.clip(srgb(linear * np.where(most > SHOULDER, shown / np.maximum(most, SHOULDER), 1.0)), 0.0, 1.0)
