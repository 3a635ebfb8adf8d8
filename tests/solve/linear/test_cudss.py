"""cuDSS through nvmath-python, with a stand-in for its module: the same calls by NumPy, and its own refusals."""

import enum
import sys
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from effect_builders import membrane
from meshes import deformed, small_world
from small_scenes import small_scene

from clothsim.base.errors import MissingPackageError
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.solve.linear import cudss
from clothsim.solve.linear.direct_solver import NotPositiveDefiniteError
from clothsim.solve.linear.linear_solvers import ON_REQUEST, make_solver
from clothsim.solve.linear.sparsity import make_pattern
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.stepping import advance


class MatrixType(enum.IntEnum):
    GENERAL, SYMMETRIC, HERMITIAN, SPD, HPD = range(5)


class ViewType(enum.IntEnum):
    FULL, LOWER, UPPER = range(3)


@dataclass
class Options:
    sparse_system_type: MatrixType = MatrixType.GENERAL
    sparse_system_view: ViewType = ViewType.FULL
    logger: Any = None


class StandIn:
    """DirectSolver by a dense Cholesky factor; it copies its operands, as nvmath does from the host to the GPU."""

    made: tuple["StandIn", ...] = ()

    def __init__(self, a, b, *, options):
        assert options.sparse_system_type is MatrixType.SPD
        assert options.sparse_system_view is ViewType.UPPER
        assert a.format == "csr"
        assert a.indices.dtype == a.indptr.dtype == np.int32
        assert a.has_sorted_indices
        assert (a.dtype, b.dtype, b.shape) == (np.float64, np.float64, a.shape[:1])
        self.calls: list[str] = []
        self._a, self._b = a.copy(), b.copy()
        self._factor = None
        StandIn.made = (*StandIn.made, self)

    def plan(self):
        self.calls.append("plan")

    def reset_operands(self, a=None, b=None):
        assert (a is None) != (b is None)
        if a is not None:
            assert a.nnz == self._a.nnz
            np.testing.assert_array_equal(a.indices, self._a.indices)
            self._a, self._factor = a.copy(), None
        else:
            assert b.flags.c_contiguous
            self._b = b.copy()

    def factorize(self):
        self.calls.append("factorize")
        assert "plan" in self.calls
        upper = self._a.toarray()
        assert not np.tril(upper, -1).any()
        try:
            self._factor = np.linalg.cholesky(upper + np.triu(upper, 1).T)
        except np.linalg.LinAlgError:
            return SimpleNamespace(info=1)
        return SimpleNamespace(info=0)

    def solve(self):
        self.calls.append("solve")
        return np.linalg.solve(self._factor.T, np.linalg.solve(self._factor, self._b))

    def free(self):
        self.calls.append("free")


def install(monkeypatch, solver):
    module = SimpleNamespace(
        DirectSolver=solver,
        DirectSolverOptions=Options,
        DirectSolverMatrixType=MatrixType,
        DirectSolverMatrixViewType=ViewType,
    )
    monkeypatch.setitem(sys.modules, cudss.API, module)


@pytest.fixture
def stand_in(monkeypatch):
    monkeypatch.setattr(StandIn, "made", ())
    install(monkeypatch, StandIn)


def newton_matrix():
    world = small_world()
    hessian = membrane(world).hessian(deformed(world))
    pattern = make_pattern(world.n_cloth, world.triangles, [hessian])
    data = pattern.shift(pattern.assemble([hessian])[0], np.full(3 * world.n_cloth, 0.1))
    upper = pattern.upper(data).toarray()
    return pattern, data, upper + np.triu(upper, 1).T


@pytest.mark.usefixtures("stand_in")
def test_one_plan_serves_many_matrices_and_right_sides():
    pattern, data, dense = newton_matrix()
    solver = make_solver("cudss", pattern)
    rng = np.random.default_rng(2)
    for _ in range(2):
        amount, b, c = rng.uniform(0, 1, len(dense)), *rng.standard_normal((2, len(dense)))
        exact = np.linalg.solve(dense + np.diag(amount), np.column_stack([b, c]))
        scale = 1e-11 * np.abs(exact).max()
        assert np.abs(solver.solve(pattern.shift(data, amount), b) - exact[:, 0]).max() < scale
        assert np.abs(solver.back_solve(c) - exact[:, 1]).max() < scale
    (made,) = StandIn.made
    assert made.calls == ["plan", *("factorize", "solve", "solve") * 2]
    del solver
    assert made.calls[-1] == "free"


@pytest.mark.usefixtures("stand_in")
@pytest.mark.parametrize("fault", ["indefinite", "infinite", "not a number"])
def test_a_matrix_that_has_no_factor_is_refused_and_the_next_one_solved(fault):
    pattern, data, dense = newton_matrix()
    solver, b = make_solver("cudss", pattern), np.ones(len(dense))
    wrong = pattern.shift(data, np.full(len(dense), -10.0))
    if fault != "indefinite":
        wrong = data.copy()
        wrong[0] = np.inf if fault == "infinite" else np.nan
    with pytest.raises(NotPositiveDefiniteError):
        solver.solve(wrong, b)
    assert np.abs(dense @ solver.solve(data, b) - b).max() < 1e-11


@pytest.mark.usefixtures("stand_in")
def test_a_scene_steps_as_with_superlu():
    ends = []
    for name in ("cudss", "superlu"):
        scene = small_scene(solver={"dt": 0.02, "linear": name, "tolerance": 1e-6})
        session = prepare(scene, build(scene))
        ends.append(advance(session.integrator, first_state(session.built.world, 0.02), 0.02).state.positions)
    assert np.abs(ends[0] - ends[1]).max() < 1e-9
    assert any("factorize" in made.calls for made in StandIn.made)


@pytest.mark.usefixtures("stand_in")
def test_auto_never_takes_it():
    assert ON_REQUEST == ("cudss",)
    assert make_solver("auto", newton_matrix()[0]).name != "cudss"
    assert StandIn.made == ()


def test_the_missing_package_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, cudss.API, None)
    with pytest.raises(MissingPackageError) as caught:
        make_solver("cudss", newton_matrix()[0])
    assert "solver.linear = 'cudss'" in caught.value.sentence
    assert "clothsim[cuda]" in caught.value.remedy


def test_a_machine_without_a_gpu_is_refused_in_one_sentence(monkeypatch):
    def without_gpu(*_, **__):
        raise RuntimeError("no CUDA driver\nand a second line")

    install(monkeypatch, without_gpu)
    with pytest.raises(MissingPackageError, match="could not start cuDSS on a GPU") as caught:
        make_solver("cudss", newton_matrix()[0])
    assert "RuntimeError: no CUDA driver)" in caught.value.sentence
    assert 'linear = "auto"' in caught.value.remedy
