"""Rendered truth: a skirt in four pictures with noise, and its numbers from them.

`python -m tests.benchmarks.views [-o FOLDER] [--small] [--seeds N]`: hem widths, length and bending of a skirt of two
panels that hangs from a waistband over a ball, 5 to 12 % and a factor of 2 off at the start, from masks with a pixel of
noise and normals with five degrees. The pictures are made with another mesh, step and start than the fit has. Each seed
has a noise, a start and true numbers of its own.
"""

import argparse
import sys
import time
from pathlib import Path

import igl
import numpy as np
from PIL import Image
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import clothsim
from clothsim import Cloth, Scene
from clothsim.base.ray_casting import first_hits
from clothsim.base.text import text_table
from clothsim.gradients.camera import Camera
from clothsim.gradients.run import Trace, traced
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
OFF = (0.05, 0.12)
"""How far factors of other seeds are off 1."""
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


def skirt(
    mesh: PatternMesh, bending: float, dt: float = 0.05, ripple: float = 0.0, duration: float = 1.2, seed: int = 0
) -> Scene:
    """The skirt as a cone about the ball, sewn and pinned at the waist; ripple: of the start [m], its turn by seed."""
    x, y = mesh.panel_coordinates.T
    height = np.ptp(y)
    down = 1 - (y - y.min()) / height
    angle = np.zeros(len(x))
    for name, rows in mesh.vertices.items():
        half = 0.5 * (WAIST + (np.ptp(x[rows]) - WAIST) * down[rows])
        angle[rows] = np.pi / 2 * np.clip(x[rows] / half, -1, 1) + (np.pi if name == "back" else 0.0)
    radius = (WAIST + (HEM - WAIST) * down) / np.pi + ripple * down * np.sin(3 * angle + 1.0 + seed)
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


def ball_corners() -> np.ndarray:
    """Corners of the triangles of the ball, (m, 3, 3) [m]."""
    ball, faces = sphere(BALL["radius"], 5)
    return (ball + BALL["position"])[faces]


def pictures(
    camera: Camera, x, triangles, rng, noise: tuple[float, float], grain=0.0, body=None
) -> tuple[np.ndarray, np.ndarray]:
    """Mask and normals in a camera, with noise of a mask's border [pixels] and of normals [degrees].

    grain: distance at which the noise of normals is still alike [pixels]; body: corners (m, 3, 3) of what is in front
    and behind, the ball where none are given.
    """
    weights, fine = refined(triangles, len(x), 1)
    y = weights @ x
    corners = np.concatenate([y[fine], ball_corners() if body is None else body])
    v, u = np.indices((camera.height, camera.width))
    rays = camera.rays(np.column_stack([u.ravel(), v.ravel()]))
    hits = first_hits(corners, camera.position, rays)
    cloth = (hits.triangle >= 0) & (hits.triangle < len(fine))
    clean = cloth.reshape(v.shape)
    away = distance_transform_edt(clean) - distance_transform_edt(~clean)
    shifts = gaussian_filter(rng.standard_normal(v.shape), 1.5)
    mask = away + noise[0] * shifts / shifts.std() > 0.0
    per_vertex = igl.per_vertex_normals(y, fine)
    normals = np.zeros((len(rays), 3))
    at = fine[hits.triangle[cloth]]
    found = np.einsum("kc,kcd->kd", hits.weights[cloth], per_vertex[at])
    found *= -np.sign((found * rays[cloth]).sum(axis=1))[:, None]
    speckle = gaussian_filter(rng.standard_normal((*v.shape, 3)), (grain, grain, 0.0)) if grain else None
    white = rng.standard_normal(found.shape) if speckle is None else (speckle / speckle.std())[clean]
    found += np.radians(noise[1]) * white
    normals[cloth] = (found / np.linalg.norm(found, axis=1)[:, None]) @ camera.rotation.T
    return mask, normals.reshape(*v.shape, 3)


def body_corners(trace: Trace) -> np.ndarray:
    """Corners of the triangles of the bodies of a run, (m, 3, 3) [m]."""
    world = trace.session.built.world
    everything = world.start() + world.origin
    parts = [everything[rows][body.triangles] for body, rows in zip(world.bodies, world.body_slices, strict=True)]
    return np.concatenate(parts)


def write_views(folder: Path, made: list[Camera], trace: Trace, noise=(1.0, 5.0), seed: int = 0) -> Path:
    """Write the pictures of the end of a run, and views.toml."""
    rng = np.random.default_rng(seed)
    x, triangles = trace.cloth_positions(), trace.session.built.world.triangles
    body = body_corners(trace)
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"[noise]\nmask = {noise[0] or 1.0}\nnormals_degrees = {noise[1] or 5.0}\n"]
    for k, camera in enumerate(made):
        mask, normals = pictures(camera, x, triangles, rng, noise, body=body)
        Image.fromarray(np.where(mask, 255, 0).astype(np.uint8)).save(folder / f"mask{k}.png")
        np.save(folder / f"normals{k}.npy", normals.astype(np.float32))
        keys = {"focal": camera.focal, "principal": camera.principal, "rotation": camera.rotation}
        lines.append(f'[[view]]\nname = "{k}"\nwidth = {camera.width}\nheight = {camera.height}\n')
        lines += [f"{key} = {value.tolist()}\n" for key, value in (keys | {"position": camera.position}).items()]
        lines.append(f'mask = "mask{k}.png"\nnormals = "normals{k}.npy"\n')
    (folder / "views.toml").write_text("".join(lines), encoding="utf-8")
    return folder / "views.toml"


def write_scan(folder: Path, trace: Trace, count: int = 20_000, noise: float = 1.5e-3, seed: int = 0) -> Path:
    """Write points of the cloth and of the skin beside it at the end of a run, turned and moved, and scan.toml."""
    rng = np.random.default_rng(seed)
    x, triangles = trace.cloth_positions(), trace.session.built.world.triangles
    weights, fine = refined(triangles, len(x), 1)
    cloth, body = (weights @ x)[fine], body_corners(trace)
    points = {"garment": _sampled(cloth, count, rng), "skin": _sampled(body, count, rng)}
    far = cKDTree(points["garment"]).query(points["skin"])[0] > 0.02
    points["skin"] = points["skin"][far]
    turn = Rotation.from_rotvec(rng.normal(size=3)).as_matrix()
    for name, own in points.items():
        noisy = own + noise * rng.standard_normal(own.shape)
        np.savetxt(folder / f"{name}.xyz", noisy @ turn + [0.4, -0.2, 0.9], fmt="%.6f")
    text = f'[noise]\npoints = {noise}\n[[scan]]\nname = "worn"\npoints = "garment.xyz"\nskin = "skin.xyz"\n'
    (folder / "scan.toml").write_text(text, encoding="utf-8")
    return folder / "scan.toml"


def _sampled(corners: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Random points (count, 3) on triangles (m, 3, 3), evenly by area."""
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    own = corners[rng.choice(len(corners), count, p=areas / areas.sum())]
    return (rng.dirichlet(np.ones(3), count)[:, :, None] * own).sum(axis=1)


def fewer(file: Path, pictures: str) -> Path:
    """Write views of the first camera ("one"), of masks alone ("masks"), or both ("mask"), and return their file."""
    if pictures == "all":
        return file
    head, *tables = file.read_text(encoding="utf-8").split("[[view]]")
    tables = tables if pictures == "masks" else tables[:1]
    if pictures != "one":
        tables = ["".join(line for line in each.splitlines(True) if "normals" not in line) for each in tables]
    made = file.with_name(f"views_{pictures}.toml")
    made.write_text("[[view]]".join([head, *tables]), encoding="utf-8")
    return made


PICTURES = ("all", "one", "masks", "mask")
"""What `fewer` leaves."""


def meshed(spacing: float, **factors: float) -> PatternMesh:
    """The pattern with factors of its numbers, meshed."""
    return mesh_pattern(pattern_of(entries(**factors)), spacing)


def truth_of(seed: int) -> dict[str, float]:
    """Factors of the truth: TRUTH for the seed 0."""
    if seed == 0:
        return dict(TRUTH)
    rng = np.random.default_rng(seed)
    return {name: 1.0 + float(rng.choice([-1, 1]) * rng.uniform(*OFF)) for name in TRUTH}


def true_values(factors: dict[str, float]) -> dict[str, float]:
    """The numbers that are looked for, by path."""
    values = (factors["front"], factors["back"], LENGTH * factors["length"], BENDING)
    return dict(zip((*FREE[:3], f"cloth.{FREE[3]}"), values, strict=True))


def in_millimetres(path: str) -> float:
    """Millimetres, or micronewton metres, of a number's unit: a hem's width for a flare."""
    return 1e6 if path.startswith("cloth.") else 1e3 * (HEM if path.endswith("flare") else 1.0)


def table(found: clothsim.ViewRecovery, true: dict[str, float]) -> str:
    """The numbers beside the truth, in millimetres and micronewton metres, and their stated errors."""
    twins = [twin for twin in found.twins if not twin.failure]
    header = ["number", "start", "truth", "found", "off", "stated", *(twin.name for twin in twins), "with them"]
    header += ["off/that", *found.fewer_pictures]
    rows = []
    starts = dict(zip(true, (1.0, 1.0, LENGTH, 0.5 * BENDING), strict=True))
    for path, truth in true.items():
        unit, value, error = in_millimetres(path), found.values[path], found.errors[path]
        off = value - truth
        total = unit * value * found.total_errors[path]
        cells = [unit * starts[path], unit * truth, unit * value, unit * off, unit * value * error]
        cells += [*(unit * value * twin.shifts[path] for twin in twins), total]
        fewer = [f"{unit * value * errors[path]:.3g}" for errors in found.fewer_pictures.values()]
        rows.append([path, *(f"{cell:.4g}" for cell in cells), f"{unit * off / total:.2g}", *fewer])
    return text_table(header, rows)


def fitted(folder: Path, seed: int, spacing: float, small: bool, shown: str = "all", finer: bool = False) -> int:
    """Make the pictures of a seed, fit, print the table, and return how many numbers are within two of their errors."""
    count, size = (2, (160, 120)) if small else (4, (640, 480))
    fine, coarse, long, short = (0.04, 0.06, 0.6, 0.4) if small else (0.014, spacing, 1.6, 0.8)
    factors = truth_of(seed)
    truth = skirt(meshed(fine, **factors), BENDING, dt=0.04, ripple=0.004, duration=long, seed=seed)
    views = fewer(write_views(folder, cameras(count, size), traced(truth), seed=seed), shown)
    before = time.process_time()
    mesh = meshed(coarse)

    def tell(start: int, run: object) -> None:
        print(f"{time.process_time() - before:.0f} CPU s: {run.loss:.5g} {run.failure}", flush=True)

    start = skirt(mesh, 0.5 * BENDING, duration=short)
    found = clothsim.recover_views(start, views, FREE, progress=tell, pattern=mesh, finer=finer)
    for name, picture in found.overlays.items():
        Image.fromarray(picture).save(folder / f"overlay_{name}.png")
    true = true_values(factors)
    print(table(found, true))
    for each in found.pictures:
        print(f"view {each.view}, {each.what}: {each.misfit:.2g} of the noise, {100 * each.left_out:.2g} % left out")
    print(
        f"{found.runs} runs, {time.process_time() - before:.0f} CPU s, {100 * found.adjoint_fraction:.2g} % of it in "
        f"the adjoint, {found.from_minimum:.2g} errors from a minimum; wide: {', '.join(found.wide) or 'none'}",
        flush=True,
    )
    return sum(abs(found.values[path] / true[path] - 1) < 2 * found.total_errors[path] for path in true)


def main(arguments: list[str] | None = None) -> int:
    """Fit the pictures of some seeds, and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("views_output"))
    parser.add_argument("--small", action="store_true", help="two views of 160 x 120, coarse meshes")
    parser.add_argument("--size", type=float, default=0.02, help="of the fit's mesh [m]")
    parser.add_argument("--pictures", choices=PICTURES, default="all", help="that the fit has")
    parser.add_argument("--finer", action="store_true", help="end on a mesh of half the size")
    parser.add_argument("--seed", type=int, default=0, help="the first one")
    parser.add_argument("--seeds", type=int, default=1, help="how many")
    given = parser.parse_args(arguments)
    seeds = range(given.seed, given.seed + given.seeds)
    within = [
        fitted(given.output / str(seed), seed, given.size, given.small, given.pictures, given.finer) for seed in seeds
    ]
    print(f"within two of their errors: {sum(within)} of {4 * len(within)} numbers")
    return 0


if __name__ == "__main__":
    sys.exit(main())
