"""Evaluation of study points within a budget, with stored results reused; material points between meshes."""

import json
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import igl
import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.file_writing import write_atomically
from clothsim.base.record import read_summary, to_json
from clothsim.base.triangles import barycentric as weights_in
from clothsim.base.triangles import thirds_at_vertices, triangle_areas
from clothsim.engine import World
from clothsim.study.points import BASE, Bench, Point, PointOutcome, predicted_seconds
from clothsim.study.workers import SHORT, TIMES, PointJob, ProcessorTime, Runner


@dataclass(frozen=True)
class Material:
    """The cloths of a run: rest positions (n, 3) [m] and triangles (m, 3) of each, in the order of its vertices."""

    rest: tuple[Floats, ...]
    triangles: tuple[Ints, ...]

    def same_as(self, other: "Material") -> bool:
        """True where the vertices are the same points of the material."""
        pairs = zip(self.rest, other.rest, strict=True)
        return all(one.shape == another.shape and np.array_equal(one, another) for one, another in pairs)


def material_of(rest: Sequence[Floats], triangles: Sequence[Ints]) -> Material:
    """A material of several cloths."""
    return Material(tuple(rest), tuple(triangles))


def world_material(world: World) -> Material:
    """The cloths of a world at rest."""
    return material_of([each.rest_positions for each in world.cloths], [each.triangles for each in world.cloths])


def nearest_weights(points: Floats, rest: Floats, triangles: Ints) -> tuple[Ints, Floats]:
    """For each of `points (k, 3)` [m] the nearest triangle (k,) of a mesh at rest, and its weights (k, 3).

    The weights are those of the point's foot on the plane of the triangle, and may be negative at a border that is
    coarser than the point's own: a linear function of the material is interpolated exactly.
    """
    _, nearest, _ = igl.point_mesh_squared_distance(points, rest, triangles)
    return nearest, weights_in(rest[triangles[nearest]], points)


def at_points_of(base: Material, run: Material, positions: Floats) -> Floats:
    """Positions of the vertices of `base` in a run whose vertices are at `positions (n, 3)` [m]."""
    if run.same_as(base):
        return positions
    starts = np.cumsum([0, *(len(rest) for rest in run.rest)])
    parts = []
    for points, rest, triangles, first in zip(base.rest, run.rest, run.triangles, starts[:-1], strict=True):
        nearest, weights = nearest_weights(points, rest, triangles)
        parts.append(np.einsum("ij,ijk->ik", weights, positions[first + triangles[nearest]]))
    return np.concatenate(parts)


def point_areas(material: Material) -> Floats:
    """The area that each vertex stands for: a third of that of its triangles at rest, (n,) [m2]."""
    return np.concatenate(
        [
            thirds_at_vertices(triangle_areas(rest[triangles]), triangles, len(rest))
            for rest, triangles in zip(material.rest, material.triangles, strict=True)
        ]
    )


STUDY_NAME, FOLDER = "study.json", "points"
FIRST_GUESS = {"draft": 0.2, "fine": 12.0}
"""First guess of a preset's cost relative to the base."""


@dataclass(frozen=True)
class StudyProgress:
    """Progress of a study at the start or end of a run: runs done and known, CPU seconds so far, budget [s], label."""

    done: int
    known: int
    seconds: float
    budget: float
    label: str


@dataclass
class Gatherer:
    """The points known so far: outcomes (data points and failures), and {point: why it was left out}.

    stored: {key: entry of study.json} of an earlier study of the same scene; spent: CPU seconds of all processes;
    left: those of the budget that are left, none once the study is asked to end; begun: {target: guess} of the runs
    under way.
    """

    bench: Bench
    material: Material
    warm: str
    directory: Path
    fingerprint: str
    runner: Runner
    spent: ProcessorTime
    budget: float
    left: Callable[[], float]
    progress: Callable[[StudyProgress], None]
    stored: dict[str, dict[str, Any]]
    outcomes: dict[Point, PointOutcome] = field(default_factory=dict)
    left_out: dict[Point, str] = field(default_factory=dict)
    begun: dict[str, float] = field(default_factory=dict)
    reused: int = 0

    def gather(self, points: Sequence[Point], fraction: float = 1.0) -> None:
        """Run the points, the cheapest first, where each fits into `fraction` of what is left of the budget."""
        jobs: dict[str, tuple[Point, PointJob]] = {}
        for where in sorted((p for p in dict.fromkeys(points) if p not in self.outcomes), key=self._guess):
            try:
                key, scene = self.bench.key(where), self.bench.scene(where)
            except InputError as error:
                self.left_out[where] = error.sentence.rstrip(".")
                continue
            job = PointJob(scene.to_text(), self.warm, self._file(key), where.seed)
            if key in self.stored and self._reuse(where, key):
                continue
            jobs[str(job.target)] = (where, job)
        self._run(jobs, fraction)

    def field_seconds(self) -> dict[Point, float]:
        """Seconds of the data points."""
        return {where: each.seconds for where, each in self.outcomes.items() if not each.failed}

    def good(self, where: Point) -> bool:
        """True for a point that is a data point."""
        return where in self.outcomes and not self.outcomes[where].failed

    def own_positions(self, where: Point) -> Floats:
        """Positions of the vertices of a data point's own mesh at its end, (k, 3) [m]."""
        with np.load(self._file(self.bench.key(where))) as arrays:
            return np.asarray(arrays["positions"], np.float64)

    def missing_seconds(self, points: Iterable[Point]) -> float:
        """CPU seconds that those of the points would take that are not known yet, from those that are."""
        done = self.field_seconds()
        missing = [where for where in points if where not in self.outcomes]
        return sum(_timed(predicted_seconds(where, done, self.bench.parameters)) for where in missing)

    def _run(self, jobs: dict[str, tuple[Point, PointJob]], fraction: float) -> None:
        def fits(job: PointJob) -> bool:
            where = jobs[str(job.target)][0]
            left, guess = self.left() - sum(self.begun.values()), _timed(self._guess(where))
            if guess > left * fraction:
                self.left_out[where] = f"it would take about {guess:.0f} s, and {max(left, 0):.0f} s were left"
                return False
            self.begun[str(job.target)] = guess
            self._tell(where.label(), len(jobs))
            return True

        done = 0
        for job, answer in self.runner([job for _, job in jobs.values()], fits, self.left):
            where = jobs[str(job.target)][0]
            self.begun.pop(str(job.target), None)
            done += 1
            if answer is None:
                self.left_out.setdefault(where, "the budget was spent before its end")
                continue
            key = self.bench.key(where)
            self.stored[key] = {
                "key": key,
                "label": where.label(),
                "settings": {**self.bench.settings(where), **({"seed": where.seed} if where.seed else {})},
                **answer,
            }
            self._reuse(where, key)
            self.reused -= 1
            write_points(self.directory, self.fingerprint, list(self.stored.values()))
            self._tell(where.label(), len(jobs) - done)

    def _reuse(self, where: Point, key: str) -> bool:
        """Read a stored point; False where its arrays are missing or broken: it is then computed again."""
        try:
            entry = self.stored[key]
            failed = str(entry.get("failed", ""))
            positions = np.zeros((0, 3))
            if not failed:
                with np.load(self._file(key)) as arrays:
                    cloths = range(sum(name.startswith("rest_") for name in arrays.files))
                    shapes = [arrays[f"rest_{k}"] for k in cloths], [arrays[f"triangles_{k}"] for k in cloths]
                    positions = at_points_of(self.material, material_of(*shapes), arrays["positions"])
            counts = {"warmup_seconds": entry.get("warmup_seconds", 0.0), **entry.get("counts", {})}
            times = entry.get("seconds") or 0.0, entry.get("wall_seconds") or 0.0
            energy = np.nan if entry.get("energy") is None else entry["energy"]
            estimate = sum(each or 0.0 for each in entry.get("estimate", {}).values())
            self.outcomes[where] = PointOutcome(where, positions, *times, counts, energy, estimate, failed)
        except (OSError, EOFError, LookupError, TypeError, ValueError, AttributeError, BadZipFile, zlib.error):
            return False
        self.left_out.pop(where, None)
        self.reused += 1
        return True

    def _file(self, key: str) -> Path:
        return (self.directory / FOLDER / f"{key}.npz").resolve()

    def _guess(self, where: Point) -> float:
        """Seconds that a point will take: nothing is known before the base, nor of a preset."""
        done = self.field_seconds()
        if BASE not in done or where.variant:
            return done.get(BASE, 0.0) * FIRST_GUESS.get(where.variant, 1.2)
        return predicted_seconds(where, done, self.bench.parameters)

    def _tell(self, label: str, left: int) -> None:
        known = len(self.outcomes)
        self.progress(StudyProgress(known, known + left, self.spent.seconds(), self.budget, label))


def _timed(seconds: float) -> float:
    """CPU seconds of a run that takes that long: a short one is timed several times."""
    return seconds * (TIMES if seconds < SHORT else 1)


def write_points(directory: Path, fingerprint: str, points: list[dict[str, Any]], **rest: Any) -> dict[str, Any]:
    """Write study.json whole, and return what it holds. `points` may hold failures: they are listed apart."""
    result = {
        "scene": fingerprint,
        "points": [entry for entry in points if not entry.get("failed")],
        "front": [],
        "recommended": [],
        **rest,
        "failed": [entry for entry in points if entry.get("failed")],
    }
    text = to_json(result, indent=1)
    write_atomically(directory / STUDY_NAME, f"{text}\n".encode())
    plain: dict[str, Any] = json.loads(text)
    return plain


def stored_points(directory: Path, fingerprint: str) -> dict[str, dict[str, Any]]:
    """The points of an earlier study in `directory` by key; none of one of another scene, or of none."""
    file = directory / STUDY_NAME
    if not file.is_file():
        return {}
    result = read_summary(file)
    if result.get("scene") != fingerprint:
        return {}
    entries = [entry for part in ("points", "others", "failed") for entry in result.get(part) or []]
    return {
        entry["key"]: entry
        for entry in entries
        if isinstance(entry, dict) and "key" in entry and ("estimate" in entry or entry.get("failed"))
    }
