"""Scans of worn garments: their residuals, both ways at a hem, and the motion that lays a scan onto a body."""

import numpy as np
import pytest
from command_line import refused
from hanging_towel import HEIGHT, write_towel
from scipy.spatial.transform import Rotation

from clothsim import InputError, load_scene, recover_views
from clothsim.base.triangles import area_vectors
from clothsim.cli import main
from clothsim.files.meshes.mesh_file import read_cloud
from clothsim.gradients.camera import Obstacle
from clothsim.gradients.run import traced
from clothsim.gradients.scan import ScanSurface, registered
from clothsim.gradients.scene_of_pattern import shaped_scene
from clothsim.gradients.views import read_views
from clothsim.mesh.generators.mannequin.generator import template
from clothsim.mesh.generators.shapes import rectangle
from clothsim.mesh.refinement import refined

NOISE = 1e-3


def sheet(width=1.0, length=1.0, cells=8):
    flat, triangles = rectangle((width, length), (cells, cells))
    wavy = flat + np.column_stack([np.zeros((len(flat), 2)), 0.05 * np.sin(5 * flat[:, 0]) * np.cos(3 * flat[:, 1])])
    return wavy, triangles


def cloud(positions, triangles, count=20_000, noise=0.0, seed=0):
    """Random points of a surface refined once, and its normals there."""
    rng = np.random.default_rng(seed)
    weights, fine = refined(triangles, len(positions), 1)
    corners = (weights @ positions)[fine]
    normals = area_vectors(corners)
    sizes = np.linalg.norm(normals, axis=1)
    own = rng.choice(len(corners), count, p=sizes / sizes.sum())
    points = (rng.dirichlet(np.ones(3), count)[:, :, None] * corners[own]).sum(axis=1)
    return points + noise * rng.standard_normal(points.shape), normals[own] / sizes[own, None]


@pytest.mark.parametrize("normals", [False, True])
@pytest.mark.parametrize("stretch", [0.9, 1.0, 1.1])
def test_the_derivative_is_that_of_differences(stretch, normals):
    positions, triangles = sheet()
    points, own = cloud(positions, triangles, 3000, noise=4e-3)
    loss = ScanSurface(points, own if normals else own[:0], noise=4e-3).checked()
    x = positions * [1.0, stretch, 1.0] + 2e-3 * np.random.default_rng(1).standard_normal(positions.shape)
    found = loss.residuals(x, triangles)
    along = np.random.default_rng(2).standard_normal(x.shape)
    h, count = 1e-7, len(found.values) - 64  # edges of the refined border
    plus, minus = (loss.residuals(x + sign * h * along, triangles).values for sign in (1, -1))
    assert len(plus) == len(minus) == len(found.values)
    slopes = found.jacobian @ along.ravel()
    agree = np.abs((plus - minus) / (2 * h) - slopes) < 1e-4 * np.abs(slopes).max()
    assert agree[:count][found.values[:count] > 0.01].mean() > 0.999  # a point may change its triangle
    outward = np.array([1.0, 0.0, 0.0])  # of a hem the direction is held
    away = (loss.residuals(x + 1e-3 * outward, triangles).values - found.values)[count:]
    hems = (found.jacobian @ np.tile(outward, len(x)))[count:]
    assert np.median(np.abs(away - 1e-3 * hems)) < 0.1 * 1e-3 / loss.noise


def test_the_misfit_of_the_true_surface_is_its_noise():
    positions, triangles = sheet(cells=16)
    points, _ = cloud(positions, triangles, noise=NOISE)
    found = ScanSurface(points, noise=NOISE).residuals(positions, triangles)
    assert np.sqrt(found.weights @ found.values**2 / found.weights.sum()) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("factor", [0.95, 1.05])
def test_a_hem_is_drawn_to_where_the_scan_ends(factor):
    positions, triangles = sheet()
    loss = ScanSurface(cloud(positions, triangles)[0], noise=NOISE)
    middle = positions.mean(axis=0)

    def scaled(by):
        return loss.evaluate(middle + (positions - middle) * [1.0, by, 1.0], triangles)[0]

    assert scaled(factor) > 1.5 * scaled(0.5 * (1 + factor)) > 1.5 * scaled(1.0)


def test_points_given_twice_are_one():
    positions, triangles = sheet()
    points, _ = cloud(positions, triangles, 4000)
    once, twice = (ScanSurface(each, noise=NOISE) for each in (points, np.repeat(points, 3, axis=0)))
    assert twice.evaluate(positions, triangles)[0] == pytest.approx(once.evaluate(positions, triangles)[0])


def test_points_of_another_layer_are_left_out_by_their_normals():
    positions, triangles = sheet()
    points, normals = cloud(positions, triangles, 2000)
    both, sides = np.concatenate([points, points + np.array([0, 0, 0.1])]), np.concatenate([normals, -normals])
    found = ScanSurface(both, sides).residuals(positions, triangles)
    assert found.left_out == pytest.approx(0.5, abs=0.05)
    assert np.abs(found.values[:1700]).max() < 0.1
    assert np.sqrt(np.mean(found.values**2)) < 1.0
    with pytest.raises(InputError):
        ScanSurface(points, -normals).residuals(positions, triangles)


@pytest.fixture(scope="module")
def body():
    """The mannequin, and the triangles of its skin where it wears a shirt and a skirt."""
    made = template()
    height = made.positions[made.triangles].mean(axis=1)[:, 2]
    low, high = made.positions[:, 2].min(), made.positions[:, 2].max()
    bare = (height < low + 0.3 * (high - low)) | (height > low + 0.85 * (high - low))
    return Obstacle(made.positions, made.triangles), made.triangles[bare]


@pytest.mark.parametrize("seed", range(4))
def test_a_scan_is_laid_onto_the_body_by_its_skin(body, seed):
    rng = np.random.default_rng(seed)
    own, bare = body
    (skin, _), (everything, _) = (
        cloud(own.positions, triangles, 3000, noise=NOISE, seed=seed) for triangles in (bare, own.triangles)
    )
    turn = Rotation.from_rotvec(rng.normal(size=3)).as_matrix()
    shift = rng.normal(size=3)
    laid = registered(skin @ turn + shift, everything @ turn + shift, own)
    assert np.linalg.norm(laid.moved(skin @ turn + shift) - skin, axis=1).max() < 3 * NOISE
    assert laid.angle == pytest.approx(np.linalg.norm(Rotation.from_matrix(turn).as_rotvec()), abs=5e-3)
    assert laid.distance < 2 * NOISE


def test_a_skin_that_is_none_is_refused(body):
    rng = np.random.default_rng(0)
    with pytest.raises(InputError):
        registered(rng.uniform(-1, 1, (500, 3)), rng.uniform(-1, 1, (500, 3)), body[0])
    with pytest.raises(InputError):
        registered(np.eye(3), np.eye(3), Obstacle())


def test_files_of_points(tmp_path):
    points = np.random.default_rng(0).uniform(size=(5, 3))
    np.savetxt(tmp_path / "plain.xyz", points)
    np.savetxt(tmp_path / "full.xyz", np.column_stack([points, points]))
    header = [
        "ply",
        "format ascii 1.0",
        "element vertex 5",
        *(f"property float {axis}" for axis in "xyz"),
        "end_header",
    ]
    rows = [" ".join(map(str, row)) for row in points]
    (tmp_path / "cloud.ply").write_text("\n".join([*header, *rows]) + "\n")
    for name, normals in (("plain.xyz", 0), ("full.xyz", 5), ("cloud.ply", 0)):
        read, own = read_cloud(tmp_path / name, 2.0)
        assert np.allclose(read, 2.0 * points, atol=1e-6)
        assert len(own) == normals


@pytest.mark.parametrize(
    "text",
    [
        "[[scan]]",
        '[[scan]]\npoints = "none.xyz"',
        '[[scan]]\npoints = "two.xyz"',
        '[[scan]]\npoints = "few.xyz"',
        '[[scan]]\npoints = "good.xyz"\nscale = -1',
        '[[scan]]\npoints = "good.xyz"\nunit = 1',
        '[[scan]]\npoints = "good.xyz"\nskin = "good.xyz"',
        "scan = 3\n[noise]\npoints = 0.0",
        '[[scan]]\nname = "a"\npoints = "good.xyz"\n[[scan]]\nname = "a"\npoints = "good.xyz"',
    ],
)
def test_bad_tables_are_told(tmp_path, text):
    np.savetxt(tmp_path / "good.xyz", np.random.default_rng(0).uniform(size=(50, 3)))
    np.savetxt(tmp_path / "two.xyz", np.ones((4, 2)))
    np.savetxt(tmp_path / "few.xyz", np.ones((2, 3)))
    (tmp_path / "views.toml").write_text(text)
    with pytest.raises(InputError):
        read_views(tmp_path / "views.toml", {}, Obstacle())


def test_the_height_of_a_towel_from_a_scan(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_towel(tmp_path)
    scene = load_scene("towel.toml")
    trace = traced(shaped_scene(scene).with_numbers({"pattern.towel.height": 1.06 * HEIGHT}))
    points, _ = cloud(trace.cloth_positions(), trace.session.built.world.triangles, 8000, noise=5e-4)
    np.savetxt("towel.xyz", 1e3 * points)
    (tmp_path / "scan.toml").write_text(
        '[noise]\npoints = 5e-4\n[[scan]]\nname = "it"\npoints = "towel.xyz"\nscale = 1e-3\n'
    )
    found = recover_views(scene, "scan.toml", ["pattern.towel.height"], twins=False)
    off = found.values["pattern.towel.height"] / (1.06 * HEIGHT) - 1.0
    assert abs(off) < 5e-3
    assert found.pictures[0].what == "scan"
    assert found.pictures[0].misfit < 1.3
    assert found.overlays["it"].shape == (480, 480, 3)
    words = ["recover", "towel.toml", "--views", "scan.toml", "--free", "pattern.towel.height", "--no-twins"]
    assert main([*words, "--folds", "1", "-o", "found"]) == 0
    capsys.readouterr()
    (tmp_path / "scan.toml").write_text('[[scan]]\npoints = "towel.xyz"\n')  # in millimetres
    refused(capsys, *words)
