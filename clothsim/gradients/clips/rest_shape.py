"""Rest shapes that bring cloth nearer to edited frames: smooth, bounded, priced.

Lengths come first. Cloth hardly stretches: where an edge of an edited frame is longer than in the run, its rest length
is longer by the same factor, wherever the folds are. What all edited frames agree on is added to the rest lengths, and
a run shows what is left.

What is left at an edited frame, turned back to the rest shape by the rotation of each vertex's neighbourhood, is a
displacement of the rest shape that would move the cloth there if nothing but it acted. Its mean over the frames,
smoothed by a Laplacian, is added; a run shows what is left then, and Anderson's mixing of the last displacements
(Walker & Ni 2011, "Anderson acceleration for fixed-point iterations") finds the next.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array, kron
from scipy.sparse.linalg import splu

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.kinematics.kabsch_frames import vertex_frames
from clothsim.mesh.topology import interior_edges, unique_edges, vertex_rings

SMOOTHING = 0.7
"""Length over which displacements are smoothed, in edges of the mesh."""
GAUSS_NEWTON = 4
"""Steps in which a displacement is found that has given edge lengths."""
LONGEST = 0.25
"""Largest relative change of the length of an edge of the rest shape."""
MOST_RUNS = 12
"""Bound on the runs for a rest shape."""
MEMORY = 3
"""Displacements that are mixed."""
UNSURE = 0.5
"""Fraction of what is left that counts as noise of each key in the next step."""
LENGTH_RUNS = 6
"""Bound on the runs for rest lengths."""
EVEN = 0.01
"""Weight of the squared Laplacian of a displacement, in mean edges, beside the squared changes of length."""
LEAST_GAIN = 0.03
"""Relative drop of what is left below which two runs in a row end the search."""


@dataclass(frozen=True)
class RestPrice:
    """What a rest shape costs beside the one of the scene.

    Attributes
    ----------
    displacement, most : float
        Root mean square and largest displacement of a vertex, less the mean [m].
    length : float
        Largest relative change of an edge's length.
    angle : float
        Largest change of the angle at an edge [rad].
    before, after : float
        Root mean square distance at the edited frames, each by the inverse square of its noise, without it and with
        it [m].
    runs : int
        Runs that it took.
    """

    displacement: float
    most: float
    length: float
    angle: float
    before: float
    after: float
    runs: int


@dataclass(frozen=True, eq=False)
class RestMesh:
    """Triangles (m, 3) and rest positions (n, 3) [m] of all cloths, and how displacements of them are smoothed."""

    rest: Floats
    triangles: Ints

    def smooth(self, displacements: Floats) -> Floats:
        """(I + l^2 L)^-1 of displacements (n, 3), L the graph Laplacian over its mean degree, l in edges."""
        laplacian = self._laplacian()
        mean_degree = max(float(laplacian.diagonal().mean()), 1.0)
        factor = splu(csc_array(eye_array(len(self.rest)) + SMOOTHING**2 * 4 / mean_degree * laplacian))
        return np.asarray(factor.solve(displacements))

    def _laplacian(self) -> csc_array:
        """That of the graph of the edges, (n, n)."""
        (a, b), n = unique_edges(self.triangles).T, len(self.rest)
        links = csc_array((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(n, n))
        return csc_array(diags_array(np.asarray(links.sum(axis=1)).ravel()) - links)

    def bounded(self, displacements: Floats) -> Floats:
        """Displacements scaled down at the vertices of edges whose length would change by more than LONGEST."""
        edges = unique_edges(self.triangles)
        out = displacements.copy()
        for _ in range(20):
            worst = np.abs(_lengths(self.rest + out, edges) / _lengths(self.rest, edges) - 1)
            far = edges[worst > LONGEST]
            if not len(far):
                return out
            scale = np.ones(len(out))
            scale[far.ravel()] = 0.8
            out = self.smooth(out * scale[:, None]) if len(far) > len(edges) // 10 else out * scale[:, None]
        left = float(np.max(np.abs(_lengths(self.rest + out, edges) / _lengths(self.rest, edges) - 1)))
        return out * min(1.0, LONGEST / left)

    def lengthened(self, displacements: Floats, changes: Floats) -> Floats:
        """Displacements (n, 3) with which the logarithms of the rest lengths change by (e,) beside those of others.

        The sum over the edges of (l / l* - 1)^2, l* the length that is wanted, and EVEN times that over the vertices of
        (L d)^2 is minimised by Gauss and Newton's method, L the graph Laplacian, d the displacement in mean edges:
        lengths alone leave a shell almost free to bend.
        """
        (a, b), n = unique_edges(self.triangles).T, len(self.rest)
        wanted = _lengths(self.rest + displacements, np.column_stack([a, b])) * np.exp(changes)
        laplacian = self._laplacian()
        even = csc_array(kron(EVEN / wanted.mean() ** 2 * laplacian.T @ laplacian, eye_array(3)))
        ground = 1e-9 / wanted.mean() ** 2 * eye_array(3 * n)  # a rigid motion changes no length
        rows = np.repeat(np.arange(len(a)), 6)
        columns = np.concatenate([3 * a[:, None] + np.arange(3), 3 * b[:, None] + np.arange(3)], axis=1).ravel()
        out = displacements.copy()
        for _ in range(GAUSS_NEWTON):
            along = (self.rest + out)[a] - (self.rest + out)[b]
            lengths = np.linalg.norm(along, axis=1)
            along /= (lengths * wanted)[:, None]
            strain = csc_array((np.hstack([along, -along]).ravel(), (rows, columns)), shape=(len(a), 3 * n))
            slope = strain.T @ (lengths / wanted - 1) + even @ (out - displacements).ravel()
            out -= splu(csc_array(strain.T @ strain + even + ground)).solve(slope).reshape(n, 3)
        return out

    def turned_back(self, positions: Floats, offsets: Floats) -> Floats:
        """Offsets (n, 3) of positions (n, 3) [m] by the inverse rotation of each vertex's neighbourhood."""
        starts, neighbours = vertex_rings(self.triangles, len(self.rest))
        turns = vertex_frames(self.rest, positions, starts, neighbours).rotations
        return np.einsum("nji,nj->ni", turns, offsets)

    def price(self, displacements: Floats, before: float, after: float, runs: int) -> RestPrice:
        """Price of displacements (n, 3) [m] of the rest shape."""
        edges = unique_edges(self.triangles)
        length = np.abs(_lengths(self.rest + displacements, edges) / _lengths(self.rest, edges) - 1)
        moved = np.linalg.norm(displacements - displacements.mean(axis=0), axis=1)
        turn = np.abs(_angles(self.rest + displacements, self.triangles) - _angles(self.rest, self.triangles))
        turn = np.minimum(turn, 2 * np.pi - turn)
        return RestPrice(
            float(np.sqrt((moved**2).mean())),
            float(moved.max()),
            float(length.max()),
            float(turn.max(initial=0.0)),
            before,
            after,
            runs,
        )


def fitted_rest(
    sheet: RestMesh,
    keys: Sequence[Floats],
    start: Floats,
    run: Callable[[Floats], Sequence[Floats]],
    noise: Floats,
    at: Floats | None = None,
) -> tuple[Floats, RestPrice]:
    """Displacements of a rest shape that bring runs nearer to edited frames.

    Parameters
    ----------
    sheet : RestMesh
    keys : sequence of (n, 3) ndarray [m]
        The edited frames.
    start : (k n, 3) ndarray [m]
        Positions of the run at them, one after the other.
    run : callable
        Displacements (n, 3) [m] to the positions of the run with them, one for each key; none where it fails.
    noise : (k,) ndarray
        Root mean square distance [m] that each key is known to: it counts by the inverse square of that, and the search
        ends where all are as near.
    at : (n, 3) ndarray [m], optional
        Displacements of the run to start from, with the lengths that the keys agree on. They are found first by
        default.

    Returns
    -------
    displacements : (n, 3) ndarray [m]
        Zero where nothing brings the cloth nearer.
    price : RestPrice
    """
    known = noise**-2.0
    before = _left(np.split(start, len(keys)), keys, known)
    runs = 0
    if at is None:
        at, start, runs = fitted_lengths(sheet, keys, start, run, noise, float(known.mean() ** -0.5))
    found = list(np.split(start, len(keys)))
    best = _left(found, keys, known)
    tried: list[tuple[Floats, Floats]] = []
    poor, scale = 0, 1.0
    while runs < MOST_RUNS and best > known.mean() ** -0.5 and poor < 2:
        offsets = [sheet.turned_back(x, key - x) for x, key in zip(found, keys, strict=True)]
        weights = np.maximum(noise, UNSURE * best) ** -2.0
        step = sheet.smooth(np.average(offsets, axis=0, weights=weights))
        tried = [*tried, (at, step)][-MEMORY:]
        trial = sheet.bounded(_mixed(tried) if scale == 1.0 else at + scale * step)
        places = run(trial)
        runs += 1
        left = _left(places, keys, known) if len(places) else float("inf")
        if left < best:
            poor = poor + (1 if scale == 1.0 else 2) if left > (1 - LEAST_GAIN) * best else 0
            at, found, best, scale = trial, list(places), left, 1.0
        elif scale > 0.2:
            scale, tried = 0.5 * scale, tried[:-1]
        else:
            break
    return at, sheet.price(at, before, best, runs)


def fitted_lengths(
    sheet: RestMesh,
    keys: Sequence[Floats],
    start: Floats,
    run: Callable[[Floats], Sequence[Floats]],
    noise: Floats,
    enough: float,
) -> tuple[Floats, Floats, int]:
    """The lengths of a rest shape that edited frames agree on.

    Parameters
    ----------
    sheet, keys, start, run, noise
        As of `fitted_rest`.
    enough : float
        Root mean square distance from the keys at which the search ends [m].

    Returns
    -------
    displacements : (n, 3) ndarray [m]
        Zero where no lengths bring the cloth nearer.
    positions : (k n, 3) ndarray [m]
        Of the run with them.
    runs : int
    """
    known, edges, at = noise**-2.0, unique_edges(sheet.triangles), np.zeros_like(sheet.rest)
    best = _left(np.split(start, len(keys)), keys, known)
    for runs in range(LENGTH_RUNS):
        if best <= enough:
            return at, start, runs
        trial = sheet.bounded(sheet.lengthened(at, length_changes(edges, start, keys)))
        places = run(trial)
        left = _left(places, keys, known) if len(places) else float("inf")
        if left > (1 - LEAST_GAIN) * best:
            return at, start, runs + 1
        at, start, best = trial, np.concatenate(places), left
    return at, start, LENGTH_RUNS


def agreed(changes: Sequence[Floats]) -> Floats:
    """The smallest of changes (e,) that have one sign, 0 where they have not: what is due to a fold is in one frame.

    Examples
    --------
    >>> agreed([np.array([0.1, 0.3, -0.2]), np.array([0.2, -0.1, -0.1])]).tolist()
    [0.1, 0.0, -0.1]
    """
    all_ = np.array(changes)
    sign = np.sign(all_[0]) * (np.sign(all_) == np.sign(all_[0])).all(axis=0)
    return np.asarray(sign * np.abs(all_).min(axis=0) + 0.0)


def length_changes(edges: Ints, start: Floats, keys: Sequence[Floats]) -> Floats:
    """Logarithms (e,) of factors from the lengths of edges in a run, (k n, 3) [m], to those that all keys agree on."""
    places = zip(np.split(start, len(keys)), keys, strict=True)
    ratios = [_lengths(key, edges) / np.maximum(_lengths(x, edges), 1e-300) for x, key in places]
    return agreed([np.log(np.clip(ratio, 1 - 2 * LONGEST, 1 + 2 * LONGEST)) for ratio in ratios])


def is_stretch(sheet: RestMesh, start: Floats, keys: Sequence[Floats]) -> bool:
    """True where edges are longer in the keys by more or less of the stretch that they have in the run.

    Another stiffness does that; another rest length does not ask how far the cloth is stretched. Half of the squared
    changes of length are along the mean stretch in the frames.
    """
    edges = unique_edges(sheet.triangles)
    changes = length_changes(edges, start, keys)
    lengths = [_lengths(x, edges) / _lengths(sheet.rest, edges) for x in np.split(start, len(keys))]
    stretch = np.log(lengths).mean(axis=0)
    along = float(changes @ stretch) ** 2 / max(float(stretch @ stretch), 1e-300)
    return along >= 0.5 * float(changes @ changes)


def _mixed(tried: Sequence[tuple[Floats, Floats]]) -> Floats:
    """Anderson's mixing of displacements and of the steps found at them."""
    at, step = tried[-1]
    if len(tried) == 1:
        return at + step
    changes = np.array([(step - other).ravel() for _, other in tried[:-1]]).T
    weights = np.linalg.lstsq(changes, step.ravel(), rcond=1e-3)[0]
    weights *= min(1.0, 2.0 / max(float(np.abs(weights).max()), 1e-300))
    out = at + step
    for weight, (place, other) in zip(weights, tried[:-1], strict=True):
        out = out - weight * ((at - place) + (step - other))
    return np.asarray(out)


def _left(places: Sequence[Floats], keys: Sequence[Floats], weights: Floats) -> float:
    squares = [((x - key) ** 2).sum(axis=1).mean() for x, key in zip(places, keys, strict=True)]
    return float(np.sqrt(np.average(squares, weights=weights)))


def _lengths(positions: Floats, edges: Ints) -> Floats:
    return np.asarray(np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1))


def _angles(positions: Floats, triangles: Ints) -> Floats:
    """Angles at the inner edges of a surface (h,) [rad]."""
    a, b, c, d = positions[interior_edges(triangles)[0]].transpose(1, 0, 2)
    along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    first, second = np.cross(b - a, c - a), np.cross(d - a, b - a)
    return np.arctan2((np.cross(first, second) * along).sum(axis=1), (first * second).sum(axis=1))
