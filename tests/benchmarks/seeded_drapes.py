"""Draping from the transfer seed against a start held away from the body: `python -m tests.benchmarks.seeded_drapes`.

A garment made for one body is draped on another, from (a) the shape that deformation transfer gives it there and (b)
its own shape: the body is made thinner until it is clear of that and grows back under contact. Both have the same rest
shape, drape under the same settings, and are at rest once no vertex is faster than a bound until the end. Seconds are
of the processor.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import process_time

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.text_table import text_table
from clothsim.garments.fit.guaranteed_path import clearings
from clothsim.garments.fit.moving_body import StageSettings, draped, moved_with_body
from clothsim.garments.fit.transfer_seed import transferred
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.stages import Garment
from clothsim.mesh.generators.garments.shirt_skirt_trousers import shirt
from clothsim.mesh.generators.mannequin.generator import mannequin
from clothsim.mesh.generators.shapes import capsule
from clothsim.mesh.generators.sheets import tube
from clothsim.run.results import Run
from transfer.errors import TransferError
from transfer.signed_distance import body_surface

REST = 0.02
"""At rest no vertex is faster [m/s]."""
DURATION = 2.0
"""Duration of each drape [s]."""
FABRIC = "cotton"


@dataclass(frozen=True)
class Case:
    """A garment on the body that it was made for, another body of the same mesh, and which way is up."""

    garment: Garment
    source: BodyMesh
    target: BodyMesh


def tube_on_capsule() -> Case:
    """A tube round a lying capsule, which hangs from its top; the other capsule is 15 % thicker."""
    upright, triangles = capsule(radius=0.15, height=0.9, segments=24)
    x, cloth = tube(radius=0.17, height=0.3, cells=(32, 10))
    lying = [2, 0, 1]
    thick = upright * [1.15, 1.15, 1.0]
    return Case(
        Garment("tube", x[:, lying], cloth),
        BodyMesh("capsule", upright[:, lying], triangles, 1.0, ()),
        BodyMesh("thick capsule", thick[:, lying], triangles, 1.0, ()),
    )


def shirt_on_mannequin() -> Case:
    """The shirt of the mannequin on one of another shape."""
    body, triangles = mannequin()
    other, _ = mannequin(chest=1.08, waist=1.15, hips=1.08, limb_girth=1.1)
    x, cloth = shirt(edge=0.03)
    return Case(
        Garment("shirt", x, cloth),
        BodyMesh("mannequin", body, triangles, 1.0, ()),
        BodyMesh("wide mannequin", other, triangles, 1.0, ()),
    )


CASES: Mapping[str, Callable[[], Case]] = {"tube": tube_on_capsule, "shirt": shirt_on_mannequin}


@dataclass
class _Clock:
    """Processor seconds at the end of each step, from its making."""

    began: float = field(default_factory=process_time)
    seconds: list[float] = field(default_factory=list)

    def __call__(self, _: object) -> None:
        self.seconds.append(process_time() - self.began)


@dataclass(frozen=True)
class Row:
    """A start and what it took to rest: processor seconds before the drape (seeding, growth) and of the drape until
    rest, Newton iterations of both, and when the garment was at rest, in the drape's time [s] (None: never).

    positions (n, 3) [m]: where the drape ended; fastest [m/s]: a vertex then.
    """

    start: str
    preparing_seconds: float
    draping_seconds: float
    preparing_iterations: int
    draping_iterations: int
    rest_at: float | None
    fastest: float
    positions: Floats

    @property
    def seconds(self) -> float:
        """Of all until rest."""
        return self.preparing_seconds + self.draping_seconds

    @property
    def iterations(self) -> int:
        """Newton's, of all until rest."""
        return self.preparing_iterations + self.draping_iterations


def compare(case: Case, duration: float = DURATION, bound: float = REST) -> list[Row]:
    """The row of the seeded drape and that of the one from away. InputError where one cannot start or end."""
    began = process_time()
    seed = transferred(case.garment, case.source, case.target).positions
    seeding = process_time() - began
    worn = StageSettings(case.garment, seed, FABRIC, case.target.triangles, self_contact=True)
    with tempfile.TemporaryDirectory(prefix="clothsim-study-") as folder:
        warm_up(worn, seed, case, Path(folder) / "warm")
        first = _draped("transfer seed", worn, seed, case, Path(folder) / "seeded", duration, bound, seeding, 0)
        began = process_time()
        body = body_surface(case.target.positions, case.target.triangles)
        away = next(clearings(case.garment.positions, case.garment.triangles, body), None)
        if away is None:
            raise InputError(f"No deflation of {case.target.name} frees the garment.")
        grown = _completed(moved_with_body(worn, case.garment.positions, away.frames, Path(folder) / "grow", None))
        growing, iterations = process_time() - began, sum(entry["newton_iterations"] for entry in grown.record())
        start = grown.positions(-1)
        note = f"held away: the body {away.description}, grown back" if away.description else "held away"
        second = _draped(note, worn, start, case, Path(folder) / "cold", duration, bound, growing, iterations)
    return [first, second]


def warm_up(worn: StageSettings, start: Floats, case: Case, folder: Path) -> None:
    """Compile what a drape compiles: that is nobody's cost."""
    draped(worn, start, case.target.positions, case.target.up, folder, None, None, 0.01)


def _draped(
    start_name: str,
    worn: StageSettings,
    start: Floats,
    case: Case,
    folder: Path,
    duration: float,
    bound: float,
    seconds: float,
    iterations: int,
) -> Row:
    clock = _Clock()
    up = case.target.up
    run = _completed(draped(worn, start, case.target.positions, up, folder, clock, None, duration))
    record = run.record()
    settled = steps_to_rest([entry["fastest"] for entry in record], bound)
    steps = len(record) if settled is None else settled
    return Row(
        start_name,
        seconds,
        clock.seconds[steps - 1],
        iterations,
        sum(entry["newton_iterations"] for entry in record[:steps]),
        None if settled is None else record[settled - 1]["time"],
        record[-1]["fastest"],
        run.positions(-1),
    )


def steps_to_rest(fastest: Sequence[float], bound: float) -> int | None:
    """After how many steps no vertex is faster than `bound` [m/s] until the end; None where the last one is."""
    above = np.flatnonzero(np.asarray(fastest) >= bound)
    if len(above) and above[-1] == len(fastest) - 1:
        return None
    return int(above[-1]) + 2 if len(above) else 1


def _completed(run: Run) -> Run:
    if run.status != "completed":
        raise InputError(f"A drape of the study did not end: {run.reason}")
    return run


def as_text(rows: Sequence[Row]) -> str:
    """The table for people to read, the ratio, and how far the two rests are from one another."""
    header = ("start", "seconds", "before", "draping", "Newton", "before", "draping", "rest at", "m/s at end")
    cells = [
        [
            row.start,
            f"{row.seconds:.1f}",
            f"{row.preparing_seconds:.1f}",
            f"{row.draping_seconds:.1f}",
            f"{row.iterations:,}",
            f"{row.preparing_iterations:,}",
            f"{row.draping_iterations:,}",
            "-" if row.rest_at is None else f"{row.rest_at:.2f}",
            f"{row.fastest:.4f}",
        ]
        for row in rows
    ]
    seeded, cold = rows
    apart = np.linalg.norm(seeded.positions - cold.positions, axis=1)
    return "\n".join(
        [
            text_table(header, cells),
            f"seeded is {cold.seconds / seeded.seconds:.1f} times faster, with "
            f"{cold.iterations / seeded.iterations:.1f} times fewer Newton iterations",
            f"the two rests are {1e3 * np.sqrt((apart**2).mean()):.1f} mm apart (rms), {1e3 * apart.max():.1f} at most",
        ]
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Read the arguments, drape twice, print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.seeded_drapes", description=__doc__)
    parser.add_argument("--case", choices=CASES, default="tube", help="what is draped on what (default: tube)")
    parser.add_argument("--duration", type=float, default=DURATION, metavar="S", help="how long each drapes [s]")
    parser.add_argument("--rest", type=float, default=REST, metavar="V", help="the speed that counts as rest [m/s]")
    arguments = parser.parse_args(argv)
    if not (0 < arguments.duration < np.inf and 0 < arguments.rest < np.inf):
        parser.error("--duration and --rest are positive numbers.")
    try:
        print(as_text(compare(CASES[arguments.case](), arguments.duration, arguments.rest)))
    except (ClothsimError, TransferError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
