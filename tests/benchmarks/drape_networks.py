"""Auto-encoders of drapes against principal components: `python -m tests.benchmarks.drape_networks FARM -o table.json`.

The drapes of a farm of mannequins of varied shape are brought to the base body (`transfer.canonical`). Then, on the
last ones, which are held out: principal components in the metric of areas and Laplacians, ridge regression to their
coefficients, the mean of the nearest drapes, and Santesteban's auto-encoder with its regressor, at the same dimension;
and for random codes, how many vertices of the decoded garment are inside the body and how many pairs of triangles
intersect, by the exact test.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array, kron

from clothsim.base.arrays import Floats, Ints
from clothsim.base.file_writing import write_atomically
from clothsim.garments.penetration import count_penetrations
from clothsim.scene.assembly.scene_world import world_of
from clothsim.study.farm.plan import Farm, open_farm
from clothsim.study.farm.publication import processor
from clothsim.study.farm.reading import CLOTH
from clothsim.study.farm.status import manifest
from transfer.body_model import PosedBody
from transfer.canonical import kernel_average
from transfer.drape_autoencoder import DrapeAutoencoder, Training, distance_grid, trained_autoencoder
from transfer.signed_distance import BodySurface, body_surface
from transfer.subspace import Subspace, metric_components, nearest, ridge

LAPLACIAN = 1e-3
"""Weight of the Laplacian in the metric G = M + w L'ML, with L of one over the number of neighbours [1]."""

NEAREST = 8
"""Training drapes that are blended, by the inverse distance of their parameters."""


@dataclass(frozen=True, eq=False)
class Drapes:
    """Drapes of one garment on bodies of one mesh.

    Attributes
    ----------
    parameters : (n, p) ndarray
    positions, canonical : (n, k, 3) ndarray
        At rest, and on the base body [m].
    bodies : (n, b, 3) ndarray
    base : (b, 3) ndarray
        Base body [m].
    triangles, body_triangles : (m, 3), (l, 3) ndarray
    rows : csr_array (k, b)
        Averages of the base body at the garment's vertices.
    """

    parameters: Floats
    positions: Floats
    canonical: Floats
    bodies: Floats
    base: Floats
    triangles: Ints
    body_triangles: Ints
    rows: Any

    @cached_property
    def surface(self) -> BodySurface:
        """The base body."""
        return body_surface(self.base, self.body_triangles)

    def posed(self, canonical: Floats, number: int) -> Floats:
        """A canonical garment on the body of a drape."""
        return _shaped(self.base, self.bodies[number]).posed(canonical, self.rows)

    @cached_property
    def metric(self) -> Any:
        """G for flat drapes."""
        return flat_metric(self.canonical.mean(axis=0), self.triangles)


def flat_metric(positions: Floats, triangles: Ints) -> Any:
    """G = M + w L'ML for flat drapes (3k,) of positions like these (k, 3) [m], M of mean 1 / k in each vertex."""
    count = len(positions)
    a, b, c = positions[triangles].transpose(1, 0, 2)
    thirds = np.repeat(np.linalg.norm(np.cross(b - a, c - a), axis=1), 3)
    areas = np.bincount(triangles.ravel(), thirds, count)
    edges = np.concatenate([triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    near = csr_array((np.ones(2 * len(edges)), (np.r_[edges[:, 0], edges[:, 1]], np.r_[edges[:, 1], edges[:, 0]])))
    near.data[:] = 1.0
    laplacian = diags_array(1 / near.sum(axis=1)) @ near - diags_array(np.ones(count))
    mass = diags_array(areas / areas.sum())
    return kron(mass + LAPLACIAN * laplacian.T @ mass @ laplacian, np.eye(3), format="csr")


def drapes_of(farm: Farm) -> Drapes:
    """The usable drapes of a farm in the order of its plan."""
    rows = [row for row in manifest(farm) if row["usable"]]
    inputs = list(farm.settings["boxes"])
    base = world_of(farm.scene)
    body = base.bodies[0].positions + base.origin
    garment = base.cloths[0].positions + base.origin
    averages = kernel_average(body, base.bodies[0].triangles).averaging(garment)
    positions, bodies = [], []
    for row in rows:
        positions.append(np.load(farm.directory / "drapes" / row["id"] / CLOTH).astype(np.float64))
        (digest,) = row["meshes"]["body"].values()
        with np.load(farm.directory / "meshes" / f"{digest}.npz") as mesh:
            bodies.append(mesh["start"].astype(np.float64))
    canonical = [
        _shaped(body, other).unposed(points, averages) for points, other in zip(positions, bodies, strict=True)
    ]
    return Drapes(
        np.array([[row["parameters"][key] for key in inputs] for row in rows]),
        np.array(positions), np.array(canonical), np.array(bodies), body,
        base.cloths[0].triangles, base.bodies[0].triangles, averages,
    )  # fmt: skip


def _shaped(base: Floats, body: Floats) -> PosedBody:
    """The change of shape from the base body to another, without a pose."""
    return PosedBody(np.ones((len(base), 1)), body - base, np.eye(3)[None], np.zeros((1, 3)))


@dataclass(frozen=True)
class Errors:
    """Root mean square distances of a vertex to held-out drapes [m], and vertices inside per garment."""

    reconstruction: float
    prediction: float
    inside: float


def _errors(data: Drapes, held: Sequence[int], made: Floats, asked: Floats) -> Errors:
    """made, asked: (n, 3k) reconstructions and predictions of the held-out drapes, canonical."""
    inside = []
    for number, shape in zip(held, asked.reshape(len(held), -1, 3), strict=True):
        body = body_surface(data.bodies[number], data.body_triangles)
        inside.append(count_penetrations(data.posed(shape, number), data.triangles, body).penetrating_vertices)
    truth = data.canonical[held].reshape(len(held), -1)
    return Errors(_rms(made, truth), _rms(asked, truth), float(np.mean(inside)))


def _rms(one: Floats, other: Floats) -> float:
    return float(np.sqrt(3 * np.mean((one - other) ** 2)))


def random_codes(data: Drapes, decode: Callable[[Floats], Floats], size: int, count: int) -> dict[str, float]:
    """Decoded garments of codes from N(0, I) on the base body: vertices inside, pairs, free garments; exact tests."""
    shapes = decode(np.random.default_rng(1).standard_normal((count, size))).reshape(count, -1, 3)
    found = [count_penetrations(shape, data.triangles, data.surface) for shape in shapes]
    return {
        "vertices_inside": float(np.mean([each.penetrating_vertices for each in found])) / shapes.shape[1],
        "deepest": max(each.depth for each in found),
        "body_pairs": float(np.mean([each.body_pairs for each in found])),
        "self_pairs": float(np.mean([each.self_pairs for each in found])),
        "free_of_the_body": float(np.mean([each.on_body for each in found])),
        "free": float(np.mean([each.clean for each in found])),
    }


def table(data: Drapes, held_out: int, codes: int, training: Training, show: Callable[[str, Any], None]) -> Any:
    """Errors on the last drapes, and the counts for random codes, of every model."""
    count = len(data.parameters) - held_out
    held = range(count, len(data.parameters))
    flat = data.canonical.reshape(len(data.parameters), -1)
    known, asked = flat[:count], data.parameters[held]
    rows: dict[str, Any] = {}

    def add(name: str, entry: dict[str, Any]) -> None:
        rows[name] = entry
        show(name, entry)

    labels = [count_penetrations(each, data.triangles, data.surface) for each in data.canonical[:200]]
    add("labels", {"inside": float(np.mean([each.penetrating_vertices for each in labels]))})
    mean = np.broadcast_to(known.mean(axis=0), flat[held].shape)
    add("mean", vars(_errors(data, held, mean, mean)))
    space = metric_components(known, min(200, count - 1), data.metric)
    linear = metric_components(known, training.code_size, data.metric)
    fitted = ridge(data.parameters[:count], linear.coefficients(known))
    again = linear.drapes(linear.coefficients(flat[held]))
    entry = vars(_errors(data, held, again, linear.drapes(fitted(asked))))
    blended = nearest(data.parameters[:count], known, asked, NEAREST)
    add("nearest drapes", vars(_errors(data, held, blended, blended)))
    add("principal components", entry | random_codes(data, _gaussian(linear), training.code_size, codes))
    grid = distance_grid(data.surface, data.canonical[:count].reshape(-1, 3))
    weights = {
        "without collision": replace(training, collision=0.0),
        "without random codes": replace(training, random_codes=0),
        "with random codes": training,
    }
    made: dict[str, DrapeAutoencoder] = {}
    for name, own in weights.items():
        began = process_time()
        made[name] = trained_autoencoder(space, known, data.parameters[:count], grid, own)
        seconds = process_time() - began
        entry = vars(_errors(data, held, made[name].drapes(made[name].codes(flat[held])), made[name].predicted(asked)))
        add(name, entry | random_codes(data, made[name].drapes, training.code_size, codes) | {"training_cpu": seconds})
    return rows, made


def _gaussian(space: Subspace) -> Callable[[Floats], Floats]:
    """Drapes of standard normal codes, with the variances of the training drapes."""
    return lambda codes: space.drapes(codes * np.sqrt(space.variances))


def main(arguments: Sequence[str] | None = None) -> int:
    """Train all, and print the table as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("farm", type=Path)
    parser.add_argument("--held-out", type=int, default=200)
    parser.add_argument("--codes", type=int, default=1000, help="random codes")
    for name, value in (("steps", 6000), ("seed", 0), ("code-size", 24)):
        parser.add_argument(f"--{name}", type=int, default=value)
    for name in ("kl", "collision", "clearance"):
        parser.add_argument(f"--{name}", type=float, default=getattr(Training(), name))
    parser.add_argument("-o", "--output", type=Path)
    given = parser.parse_args(arguments)
    chosen = {name: getattr(given, name) for name in ("steps", "seed", "code_size", "kl", "collision", "clearance")}
    data = drapes_of(open_farm(given.farm))
    rows, made = table(data, given.held_out, given.codes, Training(**chosen), lambda *entry: print(*entry, flush=True))
    report = {
        "processor": processor(),
        "drapes": len(data.parameters),
        "held_out": given.held_out,
        **chosen,
        "rows": rows,
    }
    if given.output is not None:
        write_atomically(given.output, json.dumps(report, indent=1).encode())
        for name, model in made.items():
            np.savez_compressed(given.output.with_name(f"{name.replace(' ', '_')}.npz"), **model.arrays())
    print(json.dumps(report, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
