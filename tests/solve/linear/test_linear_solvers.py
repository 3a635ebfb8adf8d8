"""Direct solvers: equal solutions, and equal rejection of matrices that are not positive definite."""

import ctypes
import gc
import sys
from dataclasses import replace

import numpy as np
import pytest
from effect_builders import membrane
from meshes import deformed, grid, small_world
from small_scenes import small_scene

from clothsim.base.errors import ClothsimError, InputError, MissingPackageError
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.solve.linear.linear_solvers import SOLVERS, NotPositiveDefiniteError, make_solver, slowness
from clothsim.solve.linear.sparsity import make_pattern


def newton_matrix():
    """A positive definite matrix of a small sheet, as data in its pattern, and dense."""
    world = small_world()
    hessian = membrane(world).hessian(deformed(world))
    pattern = make_pattern(world.n_cloth, world.triangles, [hessian])
    data = pattern.shift(pattern.assemble([hessian])[0], np.full(3 * world.n_cloth, 0.1))
    upper = pattern.upper(data).toarray()
    return pattern, data, upper + np.triu(upper, 1).T


@pytest.fixture(params=SOLVERS)
def solver(request):
    pattern, _, _ = newton_matrix()
    try:
        return make_solver(request.param, pattern, threads=1)
    except MissingPackageError as error:
        pytest.skip(str(error))


def test_solution(solver):
    _, data, dense = newton_matrix()
    b = np.random.default_rng(0).standard_normal(len(dense))
    exact = np.linalg.solve(dense, b)
    assert np.abs(solver.solve(data, b) - exact).max() < 1e-11 * np.abs(exact).max()


def test_one_analysis_serves_many_matrices(solver):
    pattern, data, dense = newton_matrix()
    rng = np.random.default_rng(1)
    for _ in range(3):
        amount, b = rng.uniform(0, 1, len(dense)), rng.standard_normal(len(dense))
        exact = np.linalg.solve(dense + np.diag(amount), b)
        assert np.abs(solver.solve(pattern.shift(data, amount), b) - exact).max() < 1e-11 * np.abs(exact).max()


@pytest.mark.parametrize("fraction", [0.0, 0.5])
@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_a_matrix_with_what_is_not_finite_is_refused_and_the_next_one_solved(solver, number, fraction):
    """Also on the diagonal, where PARDISO takes an infinite pivot for a large one."""
    _, data, dense = newton_matrix()
    b, wrong = np.ones(len(dense)), data.copy()
    wrong[int(fraction * len(data))] = number
    with pytest.raises(NotPositiveDefiniteError):
        solver.solve(wrong, b)
    assert np.abs(dense @ solver.solve(data, b) - b).max() < 1e-11


def test_a_matrix_that_is_not_positive_definite_is_refused_and_the_next_one_solved(solver):
    pattern, data, dense = newton_matrix()
    b = np.ones(len(dense))
    lowest = np.linalg.eigvalsh(dense)[0]
    for amount in (-1.5 * lowest, -10.0):
        with pytest.raises(NotPositiveDefiniteError):
            solver.solve(pattern.shift(data, np.full(len(dense), amount)), b)
    assert np.abs(dense @ solver.solve(data, b) - b).max() < 1e-11


def test_auto_is_the_first_that_is_installed():
    pattern, data, dense = newton_matrix()
    solver = make_solver("auto", pattern, threads=1)
    assert solver.name in SOLVERS
    assert np.abs(dense @ solver.solve(data, np.ones(len(dense))) - 1).max() < 1e-11


def test_auto_falls_back_and_reports_it(monkeypatch):
    missing_packages(monkeypatch)
    solver = make_solver("auto", newton_matrix()[0])
    assert solver.name == "superlu"
    assert "ten times slower" in slowness(solver)


@pytest.mark.parametrize(("name", "extra"), [("mixed", "mkl"), ("pardiso", "mkl"), ("cholmod", "cholmod")])
def test_a_missing_library_is_named_with_its_extra(monkeypatch, name, extra):
    missing_packages(monkeypatch)
    with pytest.raises(MissingPackageError) as caught:
        make_solver(name, newton_matrix()[0])
    assert f"solver.linear = '{name}'" in caught.value.sentence
    assert f"clothsim[{extra}]" in caught.value.remedy


def test_a_missing_library_is_named_before_the_first_step(monkeypatch):
    scene = small_scene(solver={"dt": 0.02, "linear": "cholmod"})
    built = build(scene)
    missing_packages(monkeypatch)
    with pytest.raises(MissingPackageError):
        prepare(scene, built)


def missing_packages(monkeypatch):
    for name in ("pypardiso", "pymklpardiso", "sksparse", "sksparse.cholmod"):
        monkeypatch.setitem(sys.modules, name, None)


def test_an_unknown_solver_is_refused_by_name():
    with pytest.raises(InputError, match=r"'paradiso'.*mixed, pardiso, cholmod, superlu"):
        make_solver("paradiso", newton_matrix()[0])


def test_only_superlu_is_slow():
    pattern = newton_matrix()[0]
    assert slowness(make_solver("superlu", pattern)) != ""
    solver = make_solver("auto", pattern)
    assert (slowness(solver) == "") == (solver.name != "superlu")


def test_threads_that_a_sequential_library_leaves_idle_are_reported():
    solver = make_solver("superlu", newton_matrix()[0])
    solver.name, solver.wanted_threads = "mixed", 4
    assert "clothsim[mkl]" in slowness(solver)
    solver.threads = 4
    assert slowness(solver) == ""


def mixed():
    pattern, data, dense = newton_matrix()
    try:
        return make_solver("mixed", pattern, threads=1), pattern, data, dense
    except MissingPackageError as error:
        pytest.skip(str(error))


def test_single_precision_is_refined_as_far_as_is_asked_for():
    solver, _, data, dense = mixed()
    b = np.random.default_rng(2).standard_normal(len(dense))
    exact = np.linalg.solve(dense, b)

    def error(x):
        return np.sqrt((x - exact) @ dense @ (x - exact) / (exact @ dense @ exact))

    solver.factorise(data)
    assert 1e-9 < error(solver.back_solve(b)) < 1e-4
    assert error(solver.solve(data, b, accuracy=1e-2)) < 1e-7  # one refinement is always made: it checks the factor
    assert error(solver.solve(data, b)) < 1e-13
    assert solver.doubles == 0


def test_a_matrix_too_ill_conditioned_for_single_precision_gets_double_until_the_next_step():
    """A stiff direction across the axes: in single precision nothing is left of what is soft across it."""
    solver, pattern, _, dense = mixed()
    b = np.random.default_rng(3).standard_normal(len(dense))
    stiff = np.array([1.0, 2.0, -1.5]) / np.sqrt(7.25)
    block = 1e-3 * np.eye(3) + 1e8 * np.outer(stiff, stiff)
    vertices = np.arange(pattern.n_vertices)[:, None]
    values, _ = pattern.assemble([ElementHessian(vertices, np.tile(block, (pattern.n_vertices, 1, 1)))])
    expected = np.linalg.solve(block, b.reshape(-1, 3).T).T.ravel()
    x = solver.solve(values, b, accuracy=1e-2)
    assert np.abs(x - expected).max() < 1e-4 * np.abs(expected).max()
    assert solver.doubles == 1
    solver.solve(pattern.shift(values, np.ones(len(b))), b)
    assert solver.doubles == 2  # single precision is not tried again
    solver.restart()
    solver.solve(newton_matrix()[1], b)
    assert solver.doubles == 2


def test_what_single_precision_cannot_hold_gets_double():
    solver, _, data, dense = mixed()
    b = np.ones(len(dense))
    assert np.abs(solver.solve(1e60 * data, b) * 1e60 - np.linalg.solve(dense, b)).max() < 1e-9
    assert solver.doubles == 1


@pytest.mark.parametrize("scale", [1e-300, 1e-42, 1e30])
def test_a_right_hand_side_of_any_size_keeps_its_digits(scale):
    solver, _, data, dense = mixed()
    b = np.random.default_rng(6).standard_normal(len(dense))
    expected = np.linalg.solve(dense, b)
    assert np.abs(solver.solve(data, scale * b) / scale - expected).max() < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize(("code", "output"), [(-2, "not enough memory to factorise"), (-3, "its error -3")])
def test_what_pardiso_gives_up_is_reported_in_a_sentence(code, output, monkeypatch):
    solver, _, data, _ = mixed()
    library = solver._single._library
    integer = ctypes.POINTER(np.ctypeslib.as_ctypes_type(library.integer))

    def giving_up(*arguments):
        ctypes.cast(arguments[-1], integer)[0] = code

    monkeypatch.setattr(solver._single, "_library", replace(library, pardiso=giving_up))
    with pytest.raises(ClothsimError, match=output):
        solver.factorise(data)
    monkeypatch.undo()


@pytest.mark.parametrize("name", ["mixed", "pardiso"])
def test_a_factor_of_one_thread_leaves_that_of_two_alone(name):
    """The number of threads belongs to the process: PARDISO crashes where it is not the one of the analysis."""
    pytest.importorskip("pypardiso")  # the sequential library has one thread

    def problem(cells, threads):
        _, triangles = grid(cells, cells)
        blocks = np.broadcast_to(np.eye(9) + 0.1, (len(triangles), 9, 9)).copy()
        pattern = make_pattern((cells + 1) ** 2, triangles, [])
        data, _ = pattern.assemble([ElementHessian(triangles, blocks)])
        return make_solver(name, pattern, threads), data, np.ones(3 * pattern.n_vertices)

    (large, *system), (small, *other) = problem(66, 2), problem(10, 1)
    first = large.solve(*system)
    small.solve(*other)
    assert np.array_equal(large.solve(*system), first)
    del small
    assert np.array_equal(large.solve(*system), first)


@pytest.mark.parametrize("name", ["pardiso", "mixed"])
def test_a_factor_without_references_frees_the_memory_of_its_library(name):
    pattern, data, _ = newton_matrix()
    try:
        solver = make_solver(name, pattern, threads=1)
    except MissingPackageError as error:
        pytest.skip(str(error))
    solver.factorise(data)
    factor = solver._factor
    handle = factor._handle
    assert handle.any()
    del solver, factor
    gc.collect()
    assert not handle.any()
