"""Separations of triangles that were proved at one state, and hold until the triangles have moved by as much.

A search keeps, for all pairs of triangles of two surfaces (or of one with itself), a front in the product of their box
trees: pairs of nodes, down to single triangles, each with a lower bound of its separation when it was last tested. The
farthest motion of a vertex in each node is added up from state to state, rounded upwards. While the motions of both
nodes together stay below the bound, nothing in one can have met anything in the other; then the pair is tested again,
and where that fails its parts are. Pairs that share vertices are kept beside the front, with bounds of the change of
their edges instead of the motion, and pairs without a bound are tested exactly at each state.

The bounds do not depend on the way between two states: any state may follow any other. Nothing is shared with contact,
whose candidate lists are kept by distances of points and edges.
"""

from dataclasses import astuple, dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points
from clothsim.base.jit import kernel, part
from clothsim.geometry.intersection.intersecting_pairs import (
    LIMIT,
    boxes,
    intersecting_pairs,
    leaf_range,
    tree,
)
from clothsim.geometry.intersection.predicates import (
    DOWN,
    EPSILON,
    LARGEST_EXPONENT,
    clearance,
    clearance_beyond_edge,
    clearance_beyond_vertex,
)
from clothsim.geometry.intersection.triangle_pair import others, shared_vertices, triangles_intersect

UP = 1.0 + 64.0 * EPSILON
"""Factor that exceeds the rounding of a few dozen operations."""
STEPS_AHEAD = 3.0
"""Number of steps like the last one for which a separation should hold: a coarser one is refined."""
STACK = 1024
"""Capacity of the stack of waiting pairs: a level of two trees leaves three."""
MOST_PAIRS = 100
"""Pairs for each triangle beyond which none are kept: surfaces that intersect nearly everywhere. 10 to 20 are usual."""
GROWTH = 2.0
"""The front is made anew where it has grown by this factor, as its pairs are split and never joined."""
IDLE = 8
"""States after which a search is dropped whose surfaces were not looked at any more."""


@dataclass(frozen=True)
class Effort:
    """Tests of one state, or of several.

    Parameters
    ----------
    states : int
        Number of states.
    pairs_tested : int
        Pairs of triangles that were tested.
    pairs_proved : int
        Near pairs of triangles that were not, as the proof of an earlier state held.
    boxes_tested, boxes_proved : int
        Pairs of boxes that were compared, and that were not; they stand for all other pairs of triangles.
    full_searches : int
        Searches without proofs, as there would have been too many.
    """

    states: int = 0
    pairs_tested: int = 0
    pairs_proved: int = 0
    boxes_tested: int = 0
    boxes_proved: int = 0
    full_searches: int = 0

    def __add__(self, other: "Effort") -> "Effort":
        """Return the sums."""
        return Effort(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))


class ProvedSeparations:
    """The proofs of the searches of a scene: those of one state, which the next one uses and replaces."""

    def __init__(self) -> None:
        self._searches: list[_PairProof] = []
        self._effort = Effort()

    def take_effort(self) -> Effort:
        """The effort of the searches since it was taken last, as that of one state."""
        effort, self._effort = self._effort, Effort()
        return replace(effort, states=1)

    def intersecting_pairs(self, positions: Floats, first: Ints, second: Ints | None, limit: int = LIMIT) -> Ints:
        """Pairs of triangles that intersect, as the function of that name finds them.

        Parameters
        ----------
        positions : (n, 3) array
            Vertex positions, finite.
        first, second : (m, 3), (k, 3) int array
            Triangles of both surfaces; None: the first with itself.
        limit : int
            Number of pairs at which the search ends.

        Returns
        -------
        (p, 2) int array
            `first[i]` and `second[j]`, sorted.
        """
        x = as_points("positions", positions)
        search = next((each for each in self._searches if each.is_of(len(x), first, second)), None)
        if search is None:
            search = _PairProof(first, second, len(x))
            self._searches.append(search)
        search.idle = 0
        if not search.abandoned:
            found, effort = search.at(x)
            self._effort += effort
            if len(found) < limit and not search.abandoned:
                return found[np.lexsort((found[:, 1], found[:, 0]))]
            search.abandon()
        self._effort += Effort(full_searches=1)
        return intersecting_pairs(x, first, second, limit)

    def end_state(self) -> None:
        """Drop the searches that no state has used for long: those of surfaces that change would fill the memory."""
        for search in self._searches:
            search.idle += 1
        self._searches = [search for search in self._searches if search.idle <= IDLE]


class _PairProof:
    """All pairs of two surfaces, or of one with itself.

    Parameters
    ----------
    first, second : (m, 3), (k, 3) int array
        Their triangles; None: the first with itself.
    n_vertices : int
        Number of rows of x.
    """

    def __init__(self, first: Ints, second: Ints | None, n_vertices: int) -> None:
        self._first, self._second, self._n_vertices = first, second, n_vertices
        self._most = MOST_PAIRS * (len(first) + (0 if second is None else len(second)))
        self._exponent = self._least = self._count = self._n_near = self._leaves = 0
        self._travelled = 0.0
        self._x: Floats | None = None
        self.abandoned, self.idle = False, 0

    def is_of(self, n_vertices: int, first: Ints, second: Ints | None) -> bool:
        """True where the surfaces are those of the search."""
        if self._second is None or second is None:
            same = self._second is second
        else:
            same = np.array_equal(second, self._second)
        return same and n_vertices == self._n_vertices and np.array_equal(first, self._first)

    def at(self, positions: Floats) -> tuple[Ints, Effort]:
        """Pairs that intersect, in the order in which they were found, and the effort."""
        exponent = int(np.frexp(np.abs(positions).max(initial=0.0))[1])
        if self._x is not None and not self._exponent - 8 <= exponent <= self._exponent:
            self._x = None
        if self._x is None:  # one unit for all states, as the predicates need it: the largest is about 2^200
            self._exponent = exponent
        x = np.ascontiguousarray(np.ldexp(positions, LARGEST_EXPONENT - self._exponent))
        if self._x is None:
            self._begin(x)
            self._least, moved = 0, False
        else:
            self._travelled = _travelled(x, self._x, *self._trees, self._second is None, self._travelled)
            moved = self._travelled > 0.0
        found, effort = self._advanced(x)
        if not self.abandoned and self._least and self._count > GROWTH * self._least:
            self._begin(x, self._x)
            found, more = self._advanced(x)
            effort, self._least = effort + more, 0
        if moved and not self._least:  # pairs are split by the motion
            self._least = self._count
        self._x = x
        return found, effort

    def abandon(self) -> None:
        """Give up all proofs, for good."""
        self.abandoned = True
        del self._front, self._near, self._trees, self._x

    def _begin(self, x: Floats, before: Floats | None = None) -> None:
        """Forget all proofs: trees of the state, motions from the one before, and the pair of the roots."""
        one = _tree_of(x, self._first)
        self._trees = one, (one if self._second is None else _tree_of(x, self._second))
        if before is not None:
            _travelled(x, before, *self._trees, self._second is None, 0.0)
            for *_, paths, bends in self._trees:
                paths[:] = bends[:] = 0.0
        self._travelled, self._leaves, self._count, self._n_near = 0.0, 0, 1, 0
        self._front, self._near = ((np.ones((64, 2), np.int32), *np.full((2, 64), -1.0)) for _ in range(2))

    def _advanced(self, x: Floats) -> tuple[Ints, Effort]:
        """Test the pairs whose proof has ended."""
        is_self, (one, other) = self._second is None, self._trees
        proved, boxes_proved = self._leaves + self._n_near, self._count - self._leaves
        pairs, ends, keys = self._front
        due = _due(pairs, ends, keys, one[4], other[4], self._count, self._travelled, 2.0)
        again = again_leaves = int(((pairs[due, 0] >= len(one[1])) & (pairs[due, 1] >= len(other[1]))).sum())
        boxes_again = len(due) - again
        stack = np.concatenate([pairs[due], np.empty((STACK, 2), np.int32)])
        ends[due] = keys[due] = np.inf  # those that stay free
        found, numbers = np.empty((64, 2), np.int64), (len(due), len(due), self._count, self._n_near, 0, 0, 0, 0)
        while numbers[0]:
            numbers = _split(
                x, one, other, is_self, self._travelled, stack, self._front, self._near[0], due, found, numbers
            )
            waiting, free, count, n_near, n_found, *_ = numbers
            if not free and count == len(self._front[0]):
                self._front = tuple(_twice(each) for each in self._front)
            if n_near == len(self._near[0]):
                self._near = tuple(_twice(each) for each in self._near)
            if n_found == len(found):
                found = _twice(found)
            if waiting + 3 > len(stack):
                stack = _twice(stack)
            if count > self._most:
                self.abandoned = True
                break
        _, _, self._count, n_near, n_found, tested, boxes_tested, leaves = numbers
        pairs, ends, keys = self._near
        ends[self._n_near : n_near] = keys[self._n_near : n_near] = -1.0
        due = _due(pairs, ends, keys, one[5], other[5], n_near, self._travelled, 4.0)
        again += int((due < self._n_near).sum())
        of_near = np.empty((len(due), 2), np.int64)
        of_near = of_near[: _neighbours_tested(x, one, other, is_self, self._travelled, due, self._near, of_near)]
        self._n_near = n_near
        self._leaves += leaves - again_leaves
        effort = Effort(0, tested + len(due), proved - again, boxes_tested, boxes_proved - boxes_again)
        return np.concatenate([found[:n_found], of_near]), effort


def _twice(array: np.ndarray) -> np.ndarray:
    """A copy with room for twice as many."""
    return np.concatenate([array, np.empty_like(array)])


_Tree = tuple[Ints, Ints, Floats, Floats, Floats, Floats]
"""Boxes and motions of one surface: node 1 is the root, 2 k and 2 k + 1 are the children of k, the leaves come last.

triangles (m, 3); items (leaves,): triangle of each leaf, -1 for none; nodes (2 leaves, 2, 3): boxes; rates and paths
(2 leaves,): largest motion of a vertex in the last step, and the sum of those; bends (leaves,): sum of the largest
changes of an edge.
"""


def _tree_of(x: Floats, triangles: Ints) -> _Tree:
    """The tree of a surface, whose motions are zero."""
    items, nodes = _boxes_of(x, triangles)
    return triangles, items, nodes, np.zeros(len(nodes)), np.zeros(len(nodes)), np.zeros(len(items))


@kernel
def _boxes_of(x, triangles):
    """The triangle of each leaf and the boxes of all nodes."""
    lower, upper = boxes(x, triangles)
    order, nodes = tree(lower, upper, 1)
    leaves = len(nodes) // 2
    items = np.full(leaves, -1, np.int64)
    for leaf in range(leaves):
        start, stop = leaf_range(len(order), nodes, leaves + leaf)
        if start < stop:
            items[leaf] = order[start]
    return items, nodes


@kernel
def _travelled(x, before, one, other, is_self, travelled):
    """Add the motions from `before` to x, relative to the mean one of the second surface: the largest sum of all."""
    common, rows = np.zeros(3), other[0]
    for t in range(len(rows)):
        for k in range(3):
            common[k] += x[rows[t, 0], k] - before[rows[t, 0], k]
    common /= len(rows)
    farthest = _add_motions(x, before, one, common)
    if not is_self:
        farthest = max(farthest, _add_motions(x, before, other, common))
    return UP * (travelled + farthest)


@part
def _add_motions(x, before, surface, common):
    """Add the motions of one surface to its sums and let its boxes follow: the largest motion of a vertex."""
    triangles, items, nodes, rates, paths, bends = surface
    leaves = len(items)
    if not common.any() and not _any_moved(x, before, triangles):
        rates[:] = 0.0
        return 0.0
    for leaf in range(leaves):
        t = items[leaf]
        if t < 0:
            continue
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        rate = max(_motion(x, before, a, common), _motion(x, before, b, common), _motion(x, before, c, common))
        rates[leaves + leaf] = rate
        bend = max(_change(x, before, a, b), _change(x, before, b, c), _change(x, before, c, a))
        bends[leaf] = UP * (bends[leaf] + min(bend, 2.0 * rate))
        for k in range(3):
            p, q, r = x[a, k], x[b, k], x[c, k]
            nodes[leaves + leaf, 0, k], nodes[leaves + leaf, 1, k] = min(p, q, r), max(p, q, r)
    for node in range(leaves - 1, 0, -1):
        rates[node] = max(rates[2 * node], rates[2 * node + 1])
        for k in range(3):
            nodes[node, 0, k] = min(nodes[2 * node, 0, k], nodes[2 * node + 1, 0, k])
            nodes[node, 1, k] = max(nodes[2 * node, 1, k], nodes[2 * node + 1, 1, k])
    for node in range(1, 2 * leaves):
        paths[node] = UP * (paths[node] + rates[node])
    return rates[1]


@part
def _any_moved(x, before, triangles):
    """True where a corner is not where it was."""
    for t in range(len(triangles)):
        for corner in range(3):
            i = triangles[t, corner]
            if x[i, 0] != before[i, 0] or x[i, 1] != before[i, 1] or x[i, 2] != before[i, 2]:
                return True
    return False


@part
def _motion(x, before, i, common):
    """Upper bound of the motion of a vertex relative to the common one."""
    squares, terms = 0.0, 0.0
    for k in range(3):
        moved = x[i, k] - before[i, k]
        squares += (moved - common[k]) ** 2
        terms += abs(moved)
    return UP * np.sqrt(squares) + 4.0 * EPSILON * terms


@part
def _change(x, before, i, j):
    """Upper bound of the change of an edge vector."""
    squares, terms = 0.0, 0.0
    for k in range(3):
        now, then = x[j, k] - x[i, k], before[j, k] - before[i, k]
        squares += (now - then) ** 2
        terms += abs(now) + abs(then)
    return UP * np.sqrt(squares) + 4.0 * EPSILON * terms


@kernel
def _due(pairs, ends, keys, paths, other_paths, count, travelled, speed):
    """Indices of the pairs whose proof has ended; `speed` [-]: motion of both together over the travelled distance."""
    indices, n = np.empty(count, np.int64), 0
    for k in range(count):
        if keys[k] > travelled:
            continue
        together = UP * (paths[pairs[k, 0]] + other_paths[pairs[k, 1]])
        keys[k] = DOWN * (travelled + (ends[k] - together) / speed)
        if not together < ends[k]:
            indices[n] = k
            n += 1
    return indices[:n]


@kernel
def _split(x, one, other, is_self, travelled, stack, front, near_pairs, free, found, numbers):
    """Test the pairs of nodes that wait on the stack, and their parts where they are not separated.

    front: pairs, ends, keys. `numbers`, and what is returned: of pairs that wait, of free entries, of entries, of
    neighbours, of intersecting pairs found, of pairs and of boxes tested, of pairs of leaves that are new. It ends
    where one of the arrays is full, and goes on where it is called again.
    """
    pairs, ends, keys = front
    triangles, items, nodes, rates, paths, _ = one
    other_triangles, other_items, other_nodes, other_rates, other_paths, _ = other
    leaves, other_leaves = len(items), len(other_items)
    waiting, n_free, count, n_near, n_found, n_pairs, n_boxes, n_leaves = numbers
    while waiting:
        no_room = (n_free == 0 and count == len(ends)) or n_near == len(near_pairs) or n_found == len(found)
        if no_room or waiting + 3 > len(stack):
            break
        waiting -= 1
        a, b = stack[waiting, 0], stack[waiting, 1]
        is_leaf, other_is_leaf = a >= leaves, b >= other_leaves
        if is_self and a == b:
            if not is_leaf:
                waiting = _waiting(stack, _waiting(stack, waiting, 2 * a, 2 * a), 2 * a + 1, 2 * a + 1)
                waiting = _waiting(stack, waiting, 2 * a, 2 * a + 1)
            continue
        n_boxes += 1
        bound = _box_distance(nodes, a, other_nodes, b)
        if bound == np.inf:  # one of them is empty
            continue
        size, other_size = _size(nodes, a), _size(other_nodes, b)
        wanted = STEPS_AHEAD * (rates[a] + other_rates[b])
        wanted = wanted if wanted < max(size, other_size) else 0.0  # so fast that any separation is as good
        if not (bound > 0.0 and bound >= wanted):
            if not (is_leaf and other_is_leaf):
                split_first = not is_leaf and (other_is_leaf or size >= other_size)
                for child in range(2):
                    part_a, part_b = (2 * a + child, b) if split_first else (a, 2 * b + child)
                    waiting = _waiting(stack, waiting, part_a, part_b)
                continue
            i, j = items[a - leaves], other_items[b - other_leaves]
            s, t = _corners(triangles, i), _corners(other_triangles, j)
            if shared_vertices(s, t)[0]:
                near_pairs[n_near, 0], near_pairs[n_near, 1] = a - leaves, b - other_leaves
                n_near += 1
                continue
            n_pairs += 1
            bound = max(bound, clearance(x, s, t, wanted))
            if bound == 0.0 and triangles_intersect(x, s, t):
                found[n_found, 0], found[n_found, 1] = (j, i) if is_self and j < i else (i, j)
                n_found += 1
        slot = free[n_free - 1] if n_free else count
        count += 0 if n_free else 1
        n_free = max(n_free - 1, 0)
        n_leaves += is_leaf and other_is_leaf
        together = UP * (paths[a] + other_paths[b])
        pairs[slot, 0], pairs[slot, 1], ends[slot] = a, b, DOWN * (together + bound)
        keys[slot] = DOWN * (travelled + (ends[slot] - together) / 2.0)
    return waiting, n_free, count, n_near, n_found, n_pairs, n_boxes, n_leaves


@kernel
def _neighbours_tested(x, one, other, is_self, travelled, due, near, found):
    """Test the pairs `due` that share vertices; near: pairs, ends, keys. Returns the number of those that intersect."""
    pairs, ends, keys = near
    triangles, items, _, _, _, bends = one
    other_triangles, other_items, _, _, _, other_bends = other
    n_found = 0
    for k in due:
        a, b = pairs[k, 0], pairs[k, 1]
        i, j = items[a], other_items[b]
        s, t = _corners(triangles, i), _corners(other_triangles, j)
        bound = _neighbours_clearance(x, s, t)
        if bound == 0.0 and triangles_intersect(x, s, t):
            found[n_found, 0], found[n_found, 1] = (j, i) if is_self and j < i else (i, j)
            n_found += 1
        together = UP * (bends[a] + other_bends[b])
        ends[k] = DOWN * (together + bound)
        keys[k] = DOWN * (travelled + (ends[k] - together) / 4.0)
    return n_found


@part
def _neighbours_clearance(x, s, t):
    """Lower bound of the change of any edge before two triangles share more than their common vertices."""
    shared, a, b = shared_vertices(s, t)
    if shared == 1:
        return clearance_beyond_vertex(x, a, others(s, a), others(t, a))
    if shared == 2:
        return clearance_beyond_edge(x, a, b, s[0] + s[1] + s[2] - a - b, t[0] + t[1] + t[2] - a - b)
    return 0.0


@part
def _box_distance(nodes, a, other_nodes, b):
    """Lower bound of the distance of two boxes."""
    squares = 0.0
    for k in range(3):
        gap = max(other_nodes[b, 0, k] - nodes[a, 1, k], nodes[a, 0, k] - other_nodes[b, 1, k], 0.0)
        squares += gap * gap
    return DOWN * np.sqrt(squares)


@part
def _size(nodes, a):
    """The longest side of a box."""
    return max(nodes[a, 1, 0] - nodes[a, 0, 0], nodes[a, 1, 1] - nodes[a, 0, 1], nodes[a, 1, 2] - nodes[a, 0, 2])


@part
def _waiting(stack, n_waiting, a, b):
    """Put a pair on the stack."""
    stack[n_waiting, 0], stack[n_waiting, 1] = a, b
    return n_waiting + 1


@part
def _corners(triangles, t):
    return triangles[t, 0], triangles[t, 1], triangles[t, 2]
