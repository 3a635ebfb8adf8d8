"""Parametric body model with linear blend skinning (Loper et al. 2015, SMPL; equations 2-11).

v = W(T + B_s(beta) + B_p(theta), J(beta), theta, weights): a template with blend shapes of the shape beta and of the
pose theta, skinned to joints that are regressed from the shaped mesh. It is made from arrays or from an .npz file with
the keys of SMPL; pickled data is never read.
"""

import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from transfer.errors import TransferError
from transfer.triangle_surface import Floats, Ints, as_points, as_surface


@dataclass(frozen=True)
class BodyModel:
    """Body of n vertices, j joints and k shape parameters; made by `body_model` or `read_body_model`.

    Attributes
    ----------
    template : ndarray (n, 3)
        Vertices of the mean shape [m].
    triangles : ndarray (m, 3)
    shape_directions : ndarray (n, 3, k)
        Shape blend shapes [m per unit of beta].
    pose_directions : ndarray (n, 3, 9 (j - 1))
        Pose blend shapes [m].
    joint_regressor : ndarray (j, n)
        Rows of sum 1.
    weights : ndarray (n, j)
        Skinning weights >= 0, rows of sum 1.
    parents : ndarray (j,)
        Parent of each joint, listed before its children; -1 for the root.
    """

    template: Floats
    triangles: Ints
    shape_directions: Floats
    pose_directions: Floats
    joint_regressor: Floats
    weights: Floats
    parents: Ints

    def shaped(self, beta: ArrayLike = ()) -> Floats:
        """Shaped template T + B_s(beta), (n, 3) [m]; beta: up to k numbers, the others 0."""
        shape = _numbers("beta", beta)
        known = self.shape_directions.shape[2]
        if shape.ndim != 1 or len(shape) > known:
            raise TransferError(f"beta must be at most {known} numbers, not an array of shape {shape.shape}.")
        return np.asarray(self.template + self.shape_directions[:, :, : len(shape)] @ shape, np.float64)

    def joints(self, beta: ArrayLike = ()) -> Floats:
        """Joint positions J(beta) of the shaped body, (j, 3) [m]."""
        return np.asarray(self.joint_regressor @ self.shaped(beta), np.float64)

    def pose_offsets(self, theta: ArrayLike) -> Floats:
        """Pose offsets B_p(theta), (n, 3) [m], linear in flatten(R_j - I) of all joints but the root."""
        return np.asarray(self.pose_directions @ pose_feature(self._rotations(theta)), np.float64)

    def transforms(self, beta: ArrayLike, theta: ArrayLike) -> tuple[Floats, Floats]:
        """Rest-to-posed transform p -> R_j p + t_j of each joint: rotations (j, 3, 3), translations (j, 3) [m]."""
        return joint_transforms(self._rotations(theta), self.joints(beta), self.parents)

    def vertices(
        self, beta: ArrayLike = (), theta: ArrayLike | None = None, translation: ArrayLike = (0, 0, 0)
    ) -> Floats:
        """Vertices of the posed body.

        Parameters
        ----------
        beta : array_like (up to k,)
            Shape parameters; those left out are 0.
        theta : array_like (j, 3), optional
            Rotation vector of each joint relative to its parent [rad]; None: all zero.
        translation : array_like (3,)
            Added to every vertex [m].

        Returns
        -------
        ndarray (n, 3)
            Positions [m].

        Raises
        ------
        TransferError
            A parameter has another shape or a value that is not finite.
        """
        move = _numbers("translation", translation)
        if move.shape != (3,):
            raise TransferError(f"translation must be 3 numbers, not an array of shape {move.shape}.")
        if theta is None:
            return self.shaped(beta) + move
        rest = self.shaped(beta) + self.pose_offsets(theta)
        return skinned(rest, self.weights, *self.transforms(beta, theta)) + move

    def _rotations(self, theta: ArrayLike) -> Floats:
        pose = _numbers("theta", theta)
        if pose.shape != (len(self.parents), 3):
            raise TransferError(f"theta must have shape ({len(self.parents)}, 3), not {pose.shape}.")
        return rotation_matrices(pose)


def rotation_matrices(rotation_vectors: Floats) -> Floats:
    """Rotation matrices (j, 3, 3) of rotation vectors (j, 3) [rad], by Rodrigues' formula."""
    angles = np.linalg.norm(rotation_vectors, axis=1)
    axes = rotation_vectors / np.where(angles > 0, angles, 1.0)[:, None]
    cross = np.cross(np.eye(3), axes[:, None, :])
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.asarray(np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross), np.float64)


def pose_feature(rotations: Floats) -> Floats:
    """Pose feature flatten(R_j - I) of the rotations (j, 3, 3) of all joints but the root, row by row, (9 (j - 1),)."""
    return np.asarray((rotations[1:] - np.eye(3)).ravel(), np.float64)


def joint_transforms(rotations: Floats, joints: Floats, parents: Ints) -> tuple[Floats, Floats]:
    """Forward kinematics about the rest joints (j, 3): rotations (j, 3, 3), translations (j, 3)."""
    turns, moves = rotations.copy(), np.zeros_like(joints)
    for j, parent in enumerate(parents):
        own = joints[j] - rotations[j] @ joints[j]
        if parent < 0:
            moves[j] = own
        else:
            turns[j] = turns[parent] @ rotations[j]
            moves[j] = turns[parent] @ own + moves[parent]
    return turns, moves


def skinned(points: Floats, weights: Floats, rotations: Floats, translations: Floats) -> Floats:
    """Linear blend skinning: sum_j w_j (R_j p + t_j) of `points (n, 3)` with `weights (n, j)`."""
    blended = np.tensordot(weights, rotations, axes=1)
    return np.asarray(np.einsum("nkl,nl->nk", blended, points) + weights @ translations, np.float64)


def _numbers(name: str, values: ArrayLike) -> Floats:
    try:
        numbers = np.asarray(values, np.float64)
    except (ValueError, TypeError) as error:
        raise TransferError(f"{name} must be numbers: {error}.") from error
    if not np.isfinite(numbers).all():
        raise TransferError(f"{name} holds a number that is not finite.")
    return numbers


KEYS = ("v_template", "shapedirs", "posedirs", "J_regressor", "weights", "kintree_table", "f")
NO_PARENT = 2**32 - 1
"""The root's parent in a table of unsigned integers: -1."""
UNREADABLE = (
    OSError, ValueError, EOFError, MemoryError, RuntimeError, OverflowError, SyntaxError, tokenize.TokenError,
    zipfile.BadZipFile, zlib.error, NotImplementedError,
)  # fmt: skip
"""Exceptions that numpy raises for a broken or a pickled file."""
SUM_ERROR = 1e-3
"""Largest deviation of a row sum from 1, as single precision and rounded files leave; rows are then normalised."""


def read_body_model(path: str | Path) -> BodyModel:
    """Read a body model from an .npz file with the keys of SMPL; other keys are ignored.

    Parameters
    ----------
    path : str or Path
        File with v_template (n, 3) [m], shapedirs (n, 3, k) [m], posedirs (n, 3, 9 (j - 1)) [m], J_regressor (j, n),
        weights (n, j), kintree_table (2, j) (names of the parents over names of the joints) and f (m, 3).

    Raises
    ------
    TransferError
        The file is missing, is not an .npz file, lacks a key, holds pickled data or arrays of inconsistent shapes.

    Examples
    --------
    >>> from transfer.body_model import read_body_model
    >>> read_body_model("missing.npz")
    Traceback (most recent call last):
    transfer.errors.TransferError: There is no file missing.npz.
    """
    name = Path(path).name
    if Path(path).exists() and not Path(path).is_file():
        raise TransferError(f"{name} is not a regular file.")
    try:
        file = np.load(path, allow_pickle=False)
    except FileNotFoundError as error:
        raise TransferError(f"There is no file {name}.") from error
    except UNREADABLE as error:
        raise TransferError(
            f"{name} is not an .npz file of plain arrays.", "Convert pickled files (.pkl), which may run code, to .npz."
        ) from error
    if not isinstance(file, np.lib.npyio.NpzFile):
        raise TransferError(f"{name} holds one array, not a body model.", "Give an .npz file.")
    with file:
        lacking = [key for key in KEYS if key not in file.files]
        if lacking:
            raise TransferError(f"{name} has no {lacking[0]!r}.", f"A body model has {', '.join(KEYS)}.")
        arrays = {}
        for key in KEYS:
            try:
                arrays[key] = np.asarray(file[key])
            except UNREADABLE as error:
                raise TransferError(
                    f"{key!r} of {name} is not a plain array.",
                    "Pickled data is not read: save it as an array of numbers.",
                ) from error
        return body_model(arrays)


def body_model(arrays: Mapping[str, ArrayLike]) -> BodyModel:
    """Make a body model from arrays.

    Parameters
    ----------
    arrays : mapping of str to array_like
        Arrays under the keys of `read_body_model`.

    Raises
    ------
    TransferError
        A key is missing, or an array has another shape or type, or a value that is not finite.

    Examples
    --------
    One triangle on one joint at the origin, without shape or pose blend shapes:

    >>> import numpy as np
    >>> from transfer.body_model import body_model
    >>> body = body_model({
    ...     "v_template": np.eye(3), "shapedirs": np.zeros((3, 3, 1)), "posedirs": np.zeros((3, 3, 0)),
    ...     "J_regressor": np.full((1, 3), 1 / 3), "weights": np.ones((3, 1)),
    ...     "kintree_table": np.array([[-1], [0]]), "f": np.array([[0, 1, 2]]),
    ... })
    >>> body.vertices(translation=(0, 0, 1))[2].tolist()
    [0.0, 0.0, 2.0]
    """
    lacking = [key for key in KEYS if key not in arrays]
    if lacking:
        raise TransferError(f"The body model has no {lacking[0]!r}.", f"It needs {', '.join(KEYS)}.")
    template = _floats(arrays, "v_template", (None, 3))
    n = len(template)
    parents = _parents(np.asarray(arrays["kintree_table"]))
    j = len(parents)
    return BodyModel(
        template,
        as_surface("The body model's", template, arrays["f"])[1],
        _floats(arrays, "shapedirs", (n, 3, None)),
        _floats(arrays, "posedirs", (n, 3, 9 * (j - 1))),
        _normalized_rows(_floats(arrays, "J_regressor", (j, n)), "J_regressor", below_zero=True),
        _normalized_rows(_floats(arrays, "weights", (n, j)), "weights", below_zero=False),
        parents,
    )


def _floats(arrays: Mapping[str, ArrayLike], key: str, shape: tuple[int | None, ...]) -> Floats:
    """Finite float64 array of `shape` (None: any length); TransferError otherwise."""
    raw = np.asarray(arrays[key])
    if raw.dtype.kind not in "fiu":
        raise TransferError(f"{key} must be numbers, not {raw.dtype}.")
    if raw.ndim != len(shape) or any(b is not None and a != b for a, b in zip(raw.shape, shape, strict=True)):
        wanted = ", ".join("any" if b is None else str(b) for b in shape)
        raise TransferError(f"{key} must have shape ({wanted}), not {raw.shape}.")
    values = np.ascontiguousarray(raw, np.float64)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        raise TransferError(f"{key}{bad[0].tolist()} is not finite.")
    return values


def _normalized_rows(rows: Floats, key: str, *, below_zero: bool) -> Floats:
    """Rows divided by their sums, which must be 1 within SUM_ERROR; negative entries only if `below_zero`."""
    sums = rows.sum(axis=1)
    bad = np.flatnonzero(np.abs(sums - 1) > SUM_ERROR)
    if bad.size:
        raise TransferError(f"{key}[{bad[0]}] sums to {sums[bad[0]]:.6g}, not to 1.")
    if not below_zero and (rows < 0).any():
        i, k = np.argwhere(rows < 0)[0]
        raise TransferError(f"{key}[{i}, {k}] is {rows[i, k]:g}, below 0.")
    return np.asarray(rows / sums[:, None], np.float64)


def _parents(table: NDArray) -> Ints:
    """Row of each joint's parent, (j,), -1 for the root, from a table of names: parents over joints."""
    if table.dtype.kind not in "iu" or table.ndim != 2 or table.shape[0] != 2 or not table.shape[1]:
        raise TransferError(f"kintree_table must be whole numbers of shape (2, j), not {table.dtype} of {table.shape}.")
    wide = table.astype(np.int64)
    wide[wide == NO_PARENT] = -1
    names = wide[1].tolist()
    rows = {name: k for k, name in enumerate(names)}
    if len(rows) < len(names):
        raise TransferError("kintree_table names a joint twice.")
    parents = []
    for k, name in enumerate(wide[0].tolist()):
        if name != -1 and rows.get(name, k) >= k:
            raise TransferError(
                f"kintree_table gives joint {k} the parent {name}, which does not precede it.",
                "Sort the joints so that parents come first.",
            )
        parents.append(-1 if name == -1 else rows[name])
    if parents[0] != -1 or parents.count(-1) != 1:
        raise TransferError(f"kintree_table has {parents.count(-1)} roots.", "Only the first joint has no parent.")
    return np.array(parents, np.int64)


SINGULAR = 1e-3
"""Least determinant of a blended matrix that is inverted: halves of a limb turned against each other have 0."""


@dataclass(frozen=True)
class PosedBody:
    """Skinning of a body in one shape and pose: p -> sum_j w_j (R_j (p + b) + t_j).

    Attributes
    ----------
    weights : ndarray (n, j)
        Skinning weights >= 0, rows of sum 1.
    offsets : ndarray (n, 3)
        b: the sum of the shape and the pose offsets [m].
    linear : ndarray (j, 3, 3)
        R.
    translations : ndarray (j, 3)
        t [m].
    """

    weights: Floats
    offsets: Floats
    linear: Floats
    translations: Floats

    def posed(self, points: ArrayLike, rows: Any) -> Floats:
        """Posed positions M_G (k, 3) [m] of canonical `points` (k, 3) [m] with averaging `rows` (k, n)."""
        given = as_points("points", points)
        linear, moves, offsets = self.blended(len(given), rows)
        return np.asarray(np.einsum("kab,kb->ka", linear, given + offsets) + moves, np.float64)

    def unposed(self, points: ArrayLike, rows: Any) -> Floats:
        """Canonical positions (k, 3) [m] of posed `points` (k, 3) [m] with fixed averaging `rows` (k, n).

        Raises
        ------
        TransferError
            A vertex has a blended matrix that cannot be inverted, or `rows` is of another garment.
        """
        given = as_points("points", points)
        linear, moves, offsets = self.blended(len(given), rows)
        size = np.abs(np.linalg.det(linear))
        if len(given) and size.min() < SINGULAR:
            worst = int(size.argmin())
            raise TransferError(
                f"Vertex {worst} is between two joints turned against each other: its blended matrix is singular.",
                "Use another frame, or weights of vertices nearer to one of the joints.",
            )
        return np.asarray(np.linalg.solve(linear, (given - moves)[..., None])[..., 0] - offsets, np.float64)

    def blended(self, count: int, rows: Any) -> tuple[Floats, Floats, Floats]:
        """Blended matrices (k, 3, 3), translations (k, 3), and offsets (k, 3)."""
        if rows.shape != (count, len(self.weights)):
            wanted = f"({count}, {len(self.weights)})"
            raise TransferError(f"The averaging rows have shape {rows.shape}, not {wanted}.")
        weights = rows @ self.weights
        return np.tensordot(weights, self.linear, axes=1), weights @ self.translations, rows @ self.offsets


def posed_body(model: BodyModel, beta: ArrayLike = (), theta: ArrayLike | None = None) -> PosedBody:
    """Skinning of a body model with shape parameters `beta` and rotation vectors `theta` (j, 3) [rad]."""
    turns = np.zeros((len(model.parents), 3)) if theta is None else theta
    offsets = model.shaped(beta) - model.template + model.pose_offsets(turns)
    return PosedBody(model.weights, offsets, *model.transforms(beta, turns))
