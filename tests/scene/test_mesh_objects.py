"""Mesh objects of trimesh, pyvista, meshio and scikit-fem as cloths and bodies."""

import subprocess
import sys
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
import pyvista
import skfem
import trimesh
from meshes import grid

from clothsim import Body, Cloth, InputError, Scene
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.mesh_objects import surface_of

POINTS, FACES = grid(3, 2)
QUADS = np.array([[0, 1, 3, 2], [1, 4, 5, 3]])
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [2, 0, 0], [2, 1, 0]], float)
CURVED = skfem.MeshTri2.init_circle()
TORN = skfem.MeshTri1DG.from_mesh(skfem.MeshTri())
TORN.doflocs[0, :3] -= 0.5
PADDED = np.column_stack([np.full(len(FACES), 3), FACES]).ravel()


def meshes():
    yield "trimesh", trimesh.Trimesh(POINTS, FACES, process=False)
    yield "pyvista", pyvista.PolyData(POINTS, PADDED)
    yield "grid", pyvista.PolyData(POINTS, PADDED).cast_to_unstructured_grid()
    yield "meshio", meshio.Mesh(POINTS, {"triangle": FACES, "line": [[0, 1]]})


@pytest.mark.parametrize("mesh", [pytest.param(mesh, id=name) for name, mesh in meshes()])
def test_vertices_and_triangles_are_those_of_the_object(mesh):
    vertices, triangles = surface_of("cloth", mesh)
    assert np.abs(vertices - POINTS).max() < 1e-7  # pyvista may hold single precision
    assert np.array_equal(triangles, FACES)
    assert (vertices.dtype, triangles.dtype) == (np.float64, np.int64)
    assert len(build(Scene(cloth=mesh, effects={"inertia": {}})).world.triangles) == len(FACES)


def test_strips_are_the_same_surface_with_the_same_sides():
    ball = pyvista.Sphere(theta_resolution=7, phi_resolution=6)
    strips = ball.strip(max_length=5)
    assert strips.n_strips > 1
    for mesh in (strips, strips + pyvista.Cube().triangulate().translate([3, 0, 0])):
        vertices, triangles = surface_of("body", mesh)
        assert len(triangles) == mesh.triangulate().n_cells
        assert volume(vertices, triangles) == pytest.approx(mesh.triangulate().volume)


def volume(vertices, triangles):
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return (a * np.cross(b, c)).sum() / 6


def structured():
    x, y = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 2, 3))
    yield "structured", pyvista.StructuredGrid(x, y, 0 * x)
    yield "rectilinear", pyvista.RectilinearGrid(np.linspace(0, 1, 4), np.linspace(0, 2, 3))
    yield "image", pyvista.ImageData(dimensions=(4, 3, 1), spacing=(1 / 3, 1, 1))


@pytest.mark.parametrize("mesh", [pytest.param(mesh, id=name) for name, mesh in structured()])
def test_grids_of_one_layer_are_surfaces(mesh):
    world = build(Scene(cloth=mesh, effects={"inertia": {}})).world
    assert (world.n_cloth, len(world.triangles)) == (12, 12)
    assert world.rest_areas.sum() == pytest.approx(2.0, rel=1e-6)
    edge1, edge2 = (world.start()[world.triangles[:, k]] - world.start()[world.triangles[:, 0]] for k in (1, 2))
    assert len(set(np.sign(np.cross(edge1, edge2)[:, 2]))) == 1


@pytest.mark.parametrize("make", [Cloth, Body])
def test_the_classes_take_them_as_they_are(make):
    made = make(trimesh.Trimesh(POINTS, FACES, process=False), position=[0, 0, 1])
    assert np.array_equal(made.triangles, FACES)


def quads():
    yield "pyvista", pyvista.PolyData(CORNERS, np.column_stack([[4, 4], QUADS]).ravel())
    yield "mixed", pyvista.PolyData(CORNERS, [4, *QUADS[0], 3, 1, 4, 5, 3, 1, 5, 3])
    yield "meshio", meshio.Mesh(CORNERS, {"quad": QUADS})


@pytest.mark.parametrize("mesh", [pytest.param(mesh, id=name) for name, mesh in quads()])
def test_quads_are_cut(mesh):
    vertices, triangles = surface_of("cloth", mesh)
    edge1, edge2 = (vertices[triangles[:, k]] - vertices[triangles[:, 0]] for k in (1, 2))
    normals = np.cross(edge1, edge2)
    assert len(triangles) == 4
    assert normals[:, 2].sum() == pytest.approx(4.0)
    assert (normals[:, 2] > 0).all()


@pytest.mark.parametrize("kind", [skfem.MeshTri, skfem.MeshQuad])
def test_scikit_fem_meshes_lie_in_the_plane_and_face_up(kind):
    vertices, triangles = surface_of("cloth", kind().refined(2))
    assert vertices.shape[1] == 3
    assert not vertices[:, 2].any()
    edge1, edge2 = (vertices[triangles[:, k]] - vertices[triangles[:, 0]] for k in (1, 2))
    assert (np.cross(edge1, edge2)[:, 2] > 0).all()
    assert build(
        Scene(cloth=Cloth(kind().refined(2)), effects={"inertia": {}})
    ).world.rest_areas.sum() == pytest.approx(1)


@pytest.mark.parametrize("kind", [skfem.MeshTri2, skfem.MeshTri1DG, skfem.MeshQuad2])
def test_scikit_fem_meshes_of_another_order_are_surfaces_where_they_are_straight_and_whole(kind):
    linear = (skfem.MeshQuad if kind is skfem.MeshQuad2 else skfem.MeshTri)().refined(2)
    mesh = kind.from_mesh(linear)
    assert mesh.p.shape[1] > linear.p.shape[1]
    world = build(Scene(cloth=mesh, effects={"inertia": {}})).world
    assert world.n_cloth == linear.p.shape[1]
    assert world.rest_areas.sum() == pytest.approx(1.0)
    assert {tuple(point) for point in world.start().round(9)} == {(*point, 0.0) for point in linear.p.T.round(9)}


def test_a_scikit_fem_surface_in_space_is_wound_alike():
    flat = skfem.MeshTri().refined(2)
    bowl = skfem.MeshTri(np.vstack([flat.p, (flat.p**2).sum(axis=0)]), flat.t)
    assert build(Scene(cloth=Cloth(bowl), effects={"inertia": {}})).world.n_cloth == flat.p.shape[1]


@pytest.mark.parametrize(
    ("mesh", "names", "remedy"),
    [
        (skfem.MeshTet(), "tetrahedral", "MeshTri"),
        (meshio.Mesh(np.eye(4)[:, :3], {"tetra": [[0, 1, 2, 3]]}), "'tetra'", ""),
        (pyvista.ImageData(dimensions=(3, 3, 3)).cast_to_unstructured_grid(), "VTK", "mesh.extract_surface()"),
        (pyvista.ImageData(dimensions=(3, 3, 3)), "VTK", "mesh.extract_surface().triangulate()"),
        (pyvista.MultiBlock([pyvista.Sphere()]), "MultiBlock", "mesh.combine().extract_surface()"),
        (trimesh.Scene(trimesh.creation.box()), "Scene", "scene.to_mesh()"),
        (trimesh.PointCloud(np.eye(3)), "PointCloud", "vertices and triangles"),
        (CURVED, "MeshTri2", "skfem.MeshTri.from_mesh(mesh)"),
        (TORN, "MeshTri1DG", "skfem.MeshTri.from_mesh(mesh)"),
        (pyvista.PolyData(np.eye(3)), "PolyData", ""),
        (meshio.Mesh(POINTS, {"line": [[0, 1]]}), "Mesh", ""),
        (object(), "object", ""),
        (3.5, "float", ""),
        (SimpleNamespace(vertices=POINTS, faces=None), "SimpleNamespace", ""),
        (trimesh.Trimesh, "ABCMeta", ""),
    ],
    ids=lambda value: None if isinstance(value, str) else type(value).__name__,
)
def test_what_is_no_surface_is_refused_with_the_call_that_makes_one(mesh, names, remedy):
    with pytest.raises(InputError) as caught:
        Cloth(mesh)
    assert names in caught.value.sentence
    assert remedy in caught.value.remedy
    assert caught.value.remedy


def test_none_of_the_libraries_is_imported():
    code = (
        "import sys, clothsim; clothsim.Cloth([[0,0,0],[1,0,0],[0,1,0]], [[0,1,2]]);"
        "print([n for n in ('trimesh', 'pyvista', 'meshio', 'skfem', 'numba', 'scipy') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
