"""Round trip of drapes through the rest pose of their body: `python -m tests.benchmarks.canonical_round_trip`.

Garments of the mannequin in drawn shapes, fabrics and poses are draped while the body goes into its pose; frames of
runs that exist (--run) count as drapes too. Each is unposed and posed again, with the averages of the garment at time 0
(fixed) and with those of each canonical position itself (field). Distances are those of vertices from where they were.
"""

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from clothsim.base.text_table import text_table
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.garments.unpose import character_of_scene, skinning
from clothsim.run.results import Run, open_run
from clothsim.run.simulate import simulate
from clothsim.scene.assembly.model_body import PlacedCharacter
from clothsim.scene.scene import Scene, scene_from_text
from transfer.canonical import unposed_in_field
from transfer.diffuse import kernel_average

NEAR = 1e-3
"""Distance within which a vertex counts as brought back [m]."""
EASES = {"shirt": 0.022, "skirt": 0.022, "trousers": 0.011}
"""Ease of each garment [m]: wider trousers of this mesh intersect between the legs."""
FABRICS = "cotton", "polyester", "denim", "wool"
CLIPS = {"walk": 1.0, "turn": 1.0}
"""Clips that poses are drawn from, and their lengths [s]."""
MOST_DRAWS = 3
"""Draws for each drape that is asked for."""
LEAD_IN, DURATION, FRAMES = 0.3, 0.4, 10
EFFECTS = {
    "inertia": {},
    "membrane": {},
    "bending": {},
    "gravity": {},
    "damping": {"rate": 3.0},
    "body_contact": {},
    "self_contact": {},
    "friction": {"coefficient": 0.3},
}


@dataclass(frozen=True)
class Row:
    """A drape and how far its vertices are from where they were, by both averages.

    fixed [m]: the farthest vertex; within: fraction of the vertices within NEAR; missed: number of the others;
    worst [m]; joints: the two joints that share each missed vertex, with counts.
    """

    name: str
    vertices: int
    fixed: float
    within: float
    missed: int
    worst: float
    joints: Counter[str]


def drawn_scene(rng: np.random.Generator, edge: float = 0.04) -> tuple[str, Scene]:
    """A garment on a mannequin, both drawn, that goes into a drawn pose; and its name."""
    shape = {name: float(rng.uniform(0.95, 1.08)) for name in ("chest", "waist", "hips", "limb_girth")}
    shape["height"] = float(rng.uniform(1.55, 1.9))
    garment, fabric = str(rng.choice(sorted(EASES))), str(rng.choice(FABRICS))
    clip = str(rng.choice(sorted(CLIPS)))
    at = float(rng.uniform(0.0, CLIPS[clip] - 0.1))
    motion = {"clip": clip, "start": at, "end": at + 0.1, "lead_in": LEAD_IN}
    scene = Scene(
        cloth={"name": garment, "mesh": garment, "edge": edge, "ease": EASES[garment], "fabric": fabric, **shape},
        body={"name": "mannequin", "model": "mannequin", "shape": shape, "motion": motion},
        effects=EFFECTS,
        solver={"dt": 0.04, "threads": 1},
        contact={"pinch": "carry"},
        run={"duration": DURATION, "frames_per_second": FRAMES},
    )
    return f"{garment}, {fabric}, {clip} {at:.2f} s", scene


def last_frames(count: int, seed: int) -> Iterator[Row]:
    """Rows of the ends of `count` drawn drapes; others are drawn for those that fail, with a line to stderr."""
    rng, left = np.random.default_rng(seed), count
    for _ in range(MOST_DRAWS * count):
        if not left:
            return
        name, scene = drawn_scene(rng)
        with tempfile.TemporaryDirectory(prefix="clothsim-round-trip-") as folder:
            try:
                run = simulate(scene, Path(folder) / "run")
            except ClothsimError as error:
                print(f"{name}: {error}", file=sys.stderr)
                continue
            if run.status != "completed":
                print(f"{name}: {run.reason}", file=sys.stderr)
                continue
            left -= 1
            yield from rows_of(run, scene, [len(run) - 1], name)


def rows_of(run: Run, scene: Scene, frames: Sequence[int], name: str) -> Iterator[Row]:
    """Rows of frames of a run, all of its cloths together."""
    made, body = character_of_scene(scene)
    cloths = [surface.name for surface in run.trajectory.surfaces if surface.role == "cloth"]
    triangles, reference = made.character.triangles, made.character.positions
    start = np.concatenate([run[0].positions[cloth] for cloth in cloths])
    fixed = kernel_average(run[0].bodies[body], triangles).averaging(start)
    average = kernel_average(reference, triangles)
    for k in frames:
        points = np.concatenate([run[k].positions[cloth] for cloth in cloths])
        skin = skinning(made, float(run.times[k]), reference)
        canonical = skin.unposed(points, fixed)
        back = np.linalg.norm(skin.posed(canonical, fixed) - points, axis=1)
        found = unposed_in_field(skin, points, average.averaging, canonical).positions
        rows = average.averaging(found)
        off = np.linalg.norm(skin.posed(found, rows) - points, axis=1)
        missed = off > NEAR
        shared = Counter(joints_at(made, (rows @ skin.weights)[missed]))
        label = f"{name}, {run.times[k]:.2f} s" if len(frames) > 1 else name
        yield Row(label, len(points), back.max(), float(1 - missed.mean()), int(missed.sum()), off.max(), shared)


def joints_at(made: PlacedCharacter, weights: Floats) -> list[str]:
    """The two joints of the largest weights of each row of `weights` (k, j)."""
    names = made.character.skeleton.names
    return [" and ".join(sorted(names[k] for k in np.argsort(row)[-2:])) for row in weights]


def as_text(rows: Sequence[Row]) -> str:
    """The table of the rows."""
    head = "drape", "vertices", "fixed: worst mm", "field: % within 1 mm", "others", "worst mm", "joints of the others"
    return text_table(head, [_cells(row) for row in rows])


def _cells(row: Row) -> tuple[str, ...]:
    fixed, within, worst = f"{1e3 * row.fixed:.1e}", f"{100 * row.within:.2f}", f"{1e3 * row.worst:.2g}"
    return row.name, str(row.vertices), fixed, within, str(row.missed), worst, named(row.joints)


def in_all(rows: Sequence[Row]) -> str:
    """What the rows have together."""
    vertices, missed = sum(row.vertices for row in rows), sum(row.missed for row in rows)
    every = sum((row.joints for row in rows), Counter[str]())
    return (
        f"{len(rows)} drapes, {vertices} vertices. Fixed: at worst {1e3 * max(row.fixed for row in rows):.1e} mm. "
        f"Field: "
        f"{100 * (1 - missed / vertices):.3f} % within 1 mm, 99 % in {sum(row.within >= 0.99 for row in rows)} drapes; "
        f"{missed} others: {named(every) or 'none'}."
    )


def named(joints: Counter[str]) -> str:
    """Joints with counts, the commonest first."""
    return ", ".join(f"{name} {count}" for name, count in joints.most_common())


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drapes", type=int, default=25, metavar="N", help="drapes to draw")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the draws")
    parser.add_argument("--run", type=Path, action="append", default=[], metavar="DIR", help="a run with a body model")
    parser.add_argument("--frames", type=int, default=25, metavar="N", help="frames of each run, evenly")
    arguments = parser.parse_args(argv)
    rows = []
    for row in last_frames(arguments.drapes, arguments.seed):
        rows.append(row)
        print("  ".join(_cells(row)), file=sys.stderr, flush=True)
    for folder in arguments.run:
        run = open_run(folder)
        scene = scene_from_text(read_checkpoint(folder / CHECKPOINT_NAME).scene_text, folder)
        frames = np.unique(np.linspace(1, len(run) - 1, arguments.frames).astype(int)).tolist()
        rows += rows_of(run, scene, frames, folder.name)
    if not rows:
        return 1
    print(as_text(rows))
    print(in_all(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
