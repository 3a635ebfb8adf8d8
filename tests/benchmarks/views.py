"""Rendered truth: a skirt in four pictures with noise, and its numbers from them.

`python -m tests.benchmarks.views [-o FOLDER] [--small]`: hem widths, length and bending of a skirt of two panels that
hangs from a waistband over a ball, 6 to 10 % and a factor of 2 off at the start, from masks with a pixel of noise and
normals with five degrees. The pictures are made with another mesh, step and start than the fit has.
"""

import argparse
import sys
import time
from pathlib import Path

import igl
import numpy as np
from PIL import Image
from scipy.ndimage import distance_transform_edt, gaussian_filter

import clothsim
from clothsim import Cloth, Scene
from clothsim.base.ray_casting import first_hits
from clothsim.base.text import text_table
from clothsim.gradients.camera import Camera
from clothsim.gradients.run import traced
from clothsim.mesh.generators.shapes import sphere
from clothsim.mesh.refinement import refined
from clothsim.mesh.weld import mean_of_parts
from clothsim.patterns.pattern_mesh import PatternMesh, mesh_pattern, sewn_vertices
from clothsim.patterns.specification import pattern_of

WAIST, HEM, LENGTH = 0.24, 0.32, 0.26
"""Widths and length of a panel as it is read [m]."""
TRUTH = {"front": 1.10, "back": 0.94, "length": 1.07}
"""Factors of the hem's widths and of the length."""
BENDING = 8e-5
"""Bending stiffness of the truth [N m]; the fit begins with half of it."""
BALL = {"name": "ball", "mesh": "sphere", "radius": 0.074, "subdivisions": 3, "position": [0.0, 0.0, -0.11]}
FREE = ("pattern.front.flare", "pattern.back.flare", "pattern.front+back.height", "bending_stiffness")


def entries(front: float = 1.0, back: float = 1.0, length: float = 1.0) -> dict:
    """A specification.json of the skirt [cm]."""

    def panel(factor):
        hem, height = 100 * HEM * factor, 100 * LENGTH * length
        corners = [[-hem / 2, 0], [hem / 2, 0], [50 * WAIST, height], [-50 * WAIST, height]]
        edges = [{"endpoints": [k, (k + 1) % 4]} for k in range(4)]
        return {"translation": [0, 0, 0], "rotation": [0, 0, 0], "vertices": corners, "edges": edges}

    sides = [({"panel": "front", "edge": a}, {"panel": "back", "edge": b}) for a, b in ((1, 3), (3, 1))]
    body = {"panels": {"front": panel(front), "back": panel(back)}, "stitches": [list(pair) for pair in sides]}
    return {"pattern": body, "properties": {"units_in_meter": 100, "curvature_coords": "relative"}}


def skirt(mesh: PatternMesh, bending: float, dt: float = 0.05, ripple: float = 0.0, duration: float = 1.2) -> Scene:
    """The skirt as a cone about the ball, sewn and pinned at the waist; ripple: of the start [m]."""
    x, y = mesh.panel_coordinates.T
    height = np.ptp(y)
    down = 1 - (y - y.min()) / height
    angle = np.zeros(len(x))
    for name, rows in mesh.vertices.items():
        half = 0.5 * (WAIST + (np.ptp(x[rows]) - WAIST) * down[rows])
        angle[rows] = np.pi / 2 * np.clip(x[rows] / half, -1, 1) + (np.pi if name == "back" else 0.0)
    radius = (WAIST + (HEM - WAIST) * down) / np.pi + ripple * down * np.sin(3 * angle + 1.0)
    positions = np.column_stack([radius * np.sin(angle), -radius * np.cos(angle), -0.98 * height * down])
    number = sewn_vertices(mesh, mesh.seams)
    top = np.unique(number[down < 1e-9])
    cloth = Cloth(
        mean_of_parts(positions, number),
        number[mesh.triangles],
        rest=mesh.material_coordinates,
        fabric="cotton",
        bending_stiffness=bending,
    )
    effects = {
        "inertia": {},
        "membrane": {},
        "bending": {"model": "hinge"},
        "gravity": {},
        "damping": {"rate": 5.0},
        "pins": {"select": top.tolist()},
        "body_contact": {"d_hat": 3e-3, "stiffness": 3e3},
    }
    solver = {"dt": dt, "threads": 1, "linear": "superlu", "tolerance": 1e-3}
    return Scene(cloth, BALL, effects, solver, run={"duration": duration, "frames_per_second": 20})


def cameras(count: int, size: tuple[int, int] = (640, 480)) -> list[Camera]:
    """Cameras around the skirt, 1.2 m away, somewhat above and below."""
    made = []
    for k in range(count):
        turn, up = np.radians(20 + 360 * k / count), (0.15, -0.25, 0.3, 0.0)[k % 4]
        eye = np.array([1.2 * np.sin(turn), -1.2 * np.cos(turn), up])
        forward = np.array([0.0, 0.0, -0.13]) - eye
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        axes = np.array([right, np.cross(forward, right), forward])
        f = 1.6 * size[0]
        made.append(Camera(*size, (f, f), (np.array(size) - 1) / 2, axes, eye))
    return made


def pictures(camera: Camera, x, triangles, rng, noise: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Mask and normals in a camera, with noise of a mask's border [pixels] and of normals [degrees]."""
    weights, fine = refined(triangles, len(x), 1)
    y = weights @ x
    ball, faces = sphere(BALL["radius"], 5)
    corners = np.concatenate([y[fine], (ball + BALL["position"])[faces]])
    v, u = np.indices((camera.height, camera.width))
    rays = camera.rays(np.column_stack([u.ravel(), v.ravel()]))
    hits = first_hits(corners, camera.position, rays)
    cloth = (hits.triangle >= 0) & (hits.triangle < len(fine))
    clean = cloth.reshape(v.shape)
    away = distance_transform_edt(clean) - distance_transform_edt(~clean)
    grain = gaussian_filter(rng.standard_normal(v.shape), 1.5)
    mask = away + noise[0] * grain / grain.std() > 0.0
    per_vertex = igl.per_vertex_normals(y, fine)
    normals = np.zeros((len(rays), 3))
    at = fine[hits.triangle[cloth]]
    found = np.einsum("kc,kcd->kd", hits.weights[cloth], per_vertex[at])
    found *= -np.sign((found * rays[cloth]).sum(axis=1))[:, None]
    found += np.radians(noise[1]) * rng.standard_normal(found.shape)
    normals[cloth] = (found / np.linalg.norm(found, axis=1)[:, None]) @ camera.rotation.T
    return mask, normals.reshape(*v.shape, 3)


def write_views(folder: Path, made: list[Camera], scene: Scene, noise=(1.0, 5.0), seed: int = 0) -> Path:
    """Write the pictures of a scene's end, and views.toml."""
    trace, rng = traced(scene), np.random.default_rng(seed)
    x, triangles = trace.cloth_positions(), trace.session.built.world.triangles
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"[noise]\nmask = {noise[0] or 1.0}\nnormals_degrees = {noise[1] or 5.0}\n"]
    for k, camera in enumerate(made):
        mask, normals = pictures(camera, x, triangles, rng, noise)
        Image.fromarray(np.where(mask, 255, 0).astype(np.uint8)).save(folder / f"mask{k}.png")
        np.save(folder / f"normals{k}.npy", normals.astype(np.float32))
        keys = {"focal": camera.focal, "principal": camera.principal, "rotation": camera.rotation}
        lines.append(f'[[view]]\nname = "{k}"\nwidth = {camera.width}\nheight = {camera.height}\n')
        lines += [f"{key} = {value.tolist()}\n" for key, value in (keys | {"position": camera.position}).items()]
        lines.append(f'mask = "mask{k}.png"\nnormals = "normals{k}.npy"\n')
    (folder / "views.toml").write_text("".join(lines), encoding="utf-8")
    return folder / "views.toml"


def meshed(spacing: float, **factors: float) -> PatternMesh:
    """The pattern with factors of its numbers, meshed."""
    return mesh_pattern(pattern_of(entries(**factors)), spacing)


def true_values() -> dict[str, float]:
    """The numbers that are looked for, by path."""
    factors = (TRUTH["front"], TRUTH["back"], LENGTH * TRUTH["length"], BENDING)
    return dict(zip((*FREE[:3], f"cloth.{FREE[3]}"), factors, strict=True))


def in_millimetres(path: str) -> float:
    """Millimetres, or micronewton metres, of a number's unit: a hem's width for a flare."""
    return 1e6 if path.startswith("cloth.") else 1e3 * (HEM if path.endswith("flare") else 1.0)


def table(found: clothsim.ViewRecovery) -> str:
    """The numbers beside the truth, in millimetres and micronewton metres, and their stated errors."""
    header = ["number", "start", "truth", "found", "off", "stated", "off/stated", *found.told]
    rows = []
    starts = dict(zip(true_values(), (1.0, 1.0, LENGTH, 0.5 * BENDING), strict=True))
    for path, truth in true_values().items():
        unit, value, error = in_millimetres(path), found.values[path], found.errors[path]
        off = value - truth
        cells = [unit * starts[path], unit * truth, unit * value, unit * off, unit * value * error]
        fewer = [f"{unit * value * errors[path]:.3g}" for errors in found.told.values()]
        rows.append([path, *(f"{cell:.4g}" for cell in cells), f"{off / (value * error):.2g}", *fewer])
    return text_table(header, rows)


def main(arguments: list[str] | None = None) -> int:
    """Make the pictures, fit, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("views_output"))
    parser.add_argument("--small", action="store_true", help="two views of 160 x 120, coarse meshes")
    parser.add_argument("--size", type=float, default=0.02, help="of the fit's mesh [m]")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    count, size = (2, (160, 120)) if given.small else (4, (640, 480))
    fine, coarse, long, short = (0.04, 0.06, 0.6, 0.4) if given.small else (0.014, given.size, 1.6, 0.8)
    truth = skirt(meshed(fine, **TRUTH), BENDING, dt=0.04, ripple=0.004, duration=long)
    views = write_views(given.output, cameras(count, size), truth, seed=given.seed)
    before = time.process_time()
    mesh = meshed(coarse)

    def tell(start: int, run: object) -> None:
        print(f"{time.process_time() - before:.0f} CPU s: {run.loss:.5g} {run.failure}", flush=True)

    found = clothsim.recover_views(skirt(mesh, 0.5 * BENDING, duration=short), views, FREE, progress=tell, pattern=mesh)
    for name, picture in found.overlays.items():
        Image.fromarray(picture).save(given.output / f"overlay_{name}.png")
    print(table(found))
    for each in found.pictures:
        print(f"view {each.view}, {each.what}: {each.misfit:.2g} of the noise, {100 * each.left_out:.2g} % left out")
    print(
        f"{found.runs} runs, {time.process_time() - before:.0f} CPU s, {found.from_minimum:.2g} errors from a minimum"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
