"""Assembly into the sparsity pattern against the dense sum."""

import numpy as np
import pytest
from meshes import cloth, grid, small_world
from scipy import sparse

from clothsim.base.jit import LANES
from clothsim.physics.energies.hessians import AT_ONCE, ByElement, ElementHessian, LanesHessian, LowRankHessian
from clothsim.solve.linear.sparsity import couplings, extended, hessian_product, make_pattern


def random_blocks(elements, seed):
    k = 3 * elements.shape[1]
    blocks = np.random.default_rng(seed).standard_normal((len(elements), k, k))
    return ElementHessian(elements, blocks + np.swapaxes(blocks, 1, 2))


def random_elements(count, size, n, seed):
    rng = np.random.default_rng(seed)
    return np.array([rng.choice(n, size, replace=False) for _ in range(count)]).astype(np.int64)


N, ROWS = 9, 13
"""Nine unknown vertices; four more rows of x belong to bodies and ghosts."""

TRIANGLES = random_elements(6, 3, N, 0)


def contact(seed=5):
    """A symmetric sparse matrix over all rows whose unknown part lies within the triangles."""
    blocks = random_blocks(np.column_stack([TRIANGLES, np.arange(6) % 4 + N]), seed)
    return sparse.csr_array(blocks.to_sparse(ROWS))


def squares(elements, seed):
    """None to three squares an element, in no order."""
    rng = np.random.default_rng(seed)
    count = np.arange(len(elements)) % 4
    first = np.concatenate([np.cumsum(count[::-1])[::-1][1:], [0]])
    return LowRankHessian(elements, first, count, rng.standard_normal((count.sum(), 3 * elements.shape[1])))


def lanes(elements, seed):
    """The blocks of `random_blocks`, told lane by lane; lanes without an element hold what must not be read."""
    blocks = random_blocks(elements, seed).blocks
    corners = elements.shape[1]

    def fill(room, first):
        room[:] = np.nan
        for i in range(min(LANES * len(room), len(elements) - first)):
            restricted = blocks[first + i].reshape(corners, 3, corners, 3)
            numbers = [restricted[a, :, b] for a in range(corners) for b in range(a, corners)]
            room[i // LANES, i % LANES :: LANES] = np.ravel(numbers)

    return LanesHessian(elements, fill)


def hessians():
    return [
        random_blocks(TRIANGLES, 1),
        random_blocks(random_elements(5, 4, ROWS, 2), 2),
        random_blocks(np.arange(N)[:, None], 3),
        ElementHessian(np.zeros((0, 1), np.int64), np.zeros((0, 3, 3))),
        contact(),
        squares(random_elements(7, 4, ROWS, 6), 7),
        lanes(random_elements(2 * LANES + 3, 4, ROWS, 10), 11),
    ]


def dense(parts, size=N):
    matrices = [h.to_sparse(ROWS) if isinstance(h, ByElement) else h for h in parts]
    return sum(matrix.toarray() for matrix in matrices)[: 3 * size, : 3 * size]


def full(upper):
    upper = upper.toarray()
    return upper + np.triu(upper, 1).T


def test_assembly_is_the_dense_sum_of_the_unknown_rows():
    parts = hessians()
    pattern = make_pattern(N, TRIANGLES, parts)
    data, _ = pattern.assemble(parts)
    expected = dense(parts)
    assert np.abs(full(pattern.upper(data)) - expected).max() < 1e-13 * np.abs(expected).max()
    assert np.abs(expected).max() > 1


@pytest.mark.parametrize("which", range(7))
def test_each_kind_of_hessian_alone(which):
    parts = hessians()
    pattern = make_pattern(N, TRIANGLES, parts)
    assembled = full(pattern.upper(pattern.assemble(parts[which : which + 1])[0]))
    assert np.abs(assembled - dense(parts[which : which + 1])).max() < 1e-13


def test_a_sum_of_squares_is_that_of_its_sides():
    part = hessians()[5]
    assert 0 < (part.count > 1).sum() < (part.count > 0).sum() < len(part.count)
    for block, first, count in zip(part.blocks, part.first, part.count, strict=True):
        factors = part.factors[first : first + count]
        assert block == pytest.approx(factors.T @ factors, abs=1e-14)
    assert part.nnz == part.blocks.size


@pytest.mark.parametrize("count", [0, 1, LANES, LANES + 1, 2 * AT_ONCE + 5])
def test_lanes_are_blocks(count):
    elements = random_elements(count, 3, ROWS, 12).reshape(count, 3)
    part, blocks = lanes(elements, 13), random_blocks(elements, 13)
    assert np.array_equal(part.blocks, blocks.blocks)
    assert part.nnz == blocks.nnz
    pattern = make_pattern(N, TRIANGLES, [part])
    data, outside = pattern.assemble([part])
    assert outside == 0
    assert np.abs(data - pattern.assemble([blocks])[0]).max(initial=0.0) < 1e-13 * max(1, count)
    vectors = np.random.default_rng(14).standard_normal((count, 9))
    assert np.array_equal(part.times(vectors), blocks.times(vectors))


@pytest.mark.parametrize("kind", [random_blocks, lanes])
def test_a_vertex_that_is_twice_in_an_element_gets_all_of_it(kind):
    part = kind(np.array([[2, 5, 2]]), 9)
    pattern = make_pattern(N, TRIANGLES, [part])
    assert np.abs(full(pattern.upper(pattern.assemble([part])[0])) - dense([part])).max() < 1e-14


def test_the_upper_triangle_is_canonical_csr_with_the_diagonal_first():
    pattern = make_pattern(N, TRIANGLES, hessians())
    upper = pattern.upper(np.arange(1.0, 9 * len(pattern.columns) + 1))
    assert upper.has_canonical_format
    assert np.array_equal(upper.indices[upper.indptr[:-1]], np.arange(3 * N))
    assert np.array_equal(pattern.diagonal(np.arange(1.0, 9 * len(pattern.columns) + 1)), upper.diagonal())
    assert sparse.tril(upper, -1).nnz == 0
    assert upper.indptr.dtype == upper.indices.dtype == np.int32
    assert upper.nnz == pattern.nonzeros


def test_the_pattern_of_a_sheet_is_its_one_ring_and_with_hinges_the_two_ring():
    world = small_world()
    ring = make_pattern(world.n_cloth, world.triangles, [])
    assert len(ring.columns) == world.n_cloth + len(world.edges)
    hinges = ElementHessian(world.hinges.vertices, np.zeros((len(world.hinges.vertices), 12, 12)))
    wider = make_pattern(world.n_cloth, world.triangles, [hinges])
    across = np.sort(world.hinges.vertices[:, 2:], axis=1)
    known = {tuple(edge) for edge in world.edges}
    assert len(wider.columns) == len(ring.columns) + len({tuple(pair) for pair in across} - known)


def test_what_is_outside_the_pattern_is_counted_and_a_coupled_pattern_takes_it():
    pattern = make_pattern(N, np.zeros((0, 3), np.int64), [])
    for part in (hessians()[0], hessians()[1], contact(), *hessians()[5:]):
        assert pattern.assemble([part])[1] > 0
        wider = extended(pattern, [couplings(part)])
        data, outside = wider.assemble([part])
        assert outside == 0
        assert np.abs(full(wider.upper(data)) - dense([part])).max() < 1e-13
        assert extended(wider, [couplings(part)]) is wider
        assert wider.same_as(extended(pattern, [couplings(part)]))
        assert not wider.same_as(pattern)


def test_a_wider_pattern_has_each_block_once_and_in_order():
    pattern = make_pattern(N, np.zeros((0, 3), np.int64), [])
    twice = np.array([[4, 1, 0], [0, 4, N], [1, 4, 1]])  # a row that is none of the cloth's, a vertex twice
    wider = extended(pattern, [twice, twice[:, :2]])
    blocks = [(i, int(j)) for i in range(N) for j in wider.columns[wider.starts[i] : wider.starts[i + 1]]]
    assert blocks == sorted({*((i, i) for i in range(N)), (0, 1), (0, 4), (1, 4)})


def test_the_pattern_of_some_rows_is_that_part_of_the_matrix():
    pattern = make_pattern(N, TRIANGLES, hessians())
    rows = np.array([0, 2, 3, N - 1])
    entries = (3 * rows[:, None] + np.arange(3)).ravel()
    whole, part = pattern.upper(np.ones(9 * len(pattern.columns))).toarray(), pattern.subpattern(rows)
    assert np.array_equal(part.upper(np.ones(9 * len(part.columns))).toarray(), whole[np.ix_(entries, entries)])
    assert pattern.subpattern(np.arange(N)).same_as(pattern)
    assert not len(pattern.subpattern(rows[:0]).columns)


def test_a_narrower_pattern_takes_its_own_blocks():
    parts = hessians()
    narrow, wide = make_pattern(N, TRIANGLES, [parts[0]]), make_pattern(N, TRIANGLES, parts)
    assert len(narrow.columns) < len(wide.columns)
    data, _ = wide.assemble(parts)
    restricted = narrow.upper(narrow.restricted(data, wide)).toarray()
    has = narrow.upper(np.ones(9 * len(narrow.columns))).toarray() > 0
    assert np.array_equal(restricted, np.where(has, wide.upper(data).toarray(), 0.0))


def test_fixed_rows_become_the_identity():
    parts = hessians()
    pattern = make_pattern(N, TRIANGLES, parts)
    data, _ = pattern.assemble(parts)
    fixed = np.zeros(N, bool)
    fixed[[0, 4, 5]] = True
    pattern.fix(data, fixed)
    expected = dense(parts)
    rows = np.repeat(fixed, 3)
    expected[rows] = 0
    expected[:, rows] = 0
    expected[rows, rows] = 1
    assert np.abs(full(pattern.upper(data)) - expected).max() < 1e-13


def test_shift_is_added_to_a_copy():
    parts = hessians()
    pattern = make_pattern(N, TRIANGLES, parts)
    data, _ = pattern.assemble(parts)
    before, amount = data.copy(), np.arange(1.0, 3 * N + 1)
    shifted = pattern.shift(data, amount)
    assert np.array_equal(data, before)
    assert np.allclose(full(pattern.upper(shifted)), full(pattern.upper(data)) + np.diag(amount))


def test_times_covers_all_rows():
    parts = hessians()
    vector = np.random.default_rng(8).standard_normal((ROWS, 3))
    expected = dense(parts, ROWS) @ vector.ravel()
    assert np.abs(hessian_product(parts, vector).ravel() - expected).max() < 1e-12 * np.abs(expected).max()


def test_products_with_translations_have_the_bits_of_single_ones():
    parts = hessians()
    pattern = make_pattern(N, TRIANGLES, parts)
    data, _ = pattern.assemble(parts)
    single = [pattern.times(data)(np.tile(axis, N)) for axis in np.eye(3)]
    assert np.array_equal(pattern.translated(data), single)


def test_a_vertex_without_a_triangle_has_its_diagonal():
    sheet = cloth(*grid(1, 1))
    pattern = make_pattern(6, sheet.triangles, [])
    assert len(pattern.diagonal(pattern.assemble([])[0])) == 18
    assert np.array_equal(np.diff(pattern.starts)[4:], [1, 1])


def test_of_lanes_only_what_is_pushed_is_computed():
    """A pinned vertex moves: its own elements' chunk, and no other."""
    elements = np.arange(3 * 3 * AT_ONCE).reshape(-1, 3)
    part, asked = lanes(elements, 15), []
    watched = LanesHessian(elements, lambda room, first: (asked.append(first), part.fill(room, first)))
    vectors = np.zeros((len(elements), 9))
    vectors[AT_ONCE + 3] = 1.0
    assert np.array_equal(watched.times(vectors), part.times(vectors))
    assert asked == [AT_ONCE]
    assert watched.times(vectors)[AT_ONCE + 3].any()
