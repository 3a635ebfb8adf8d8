"""Table of fits: every garment on every body, after its size stage or draped.

`python -m tests.benchmarks.fit_table [--garments shirt ..] [--bodies mean_all ..] [--stage drape] -o DIR [--docs]`:
rows and pictures in DIR, a row that is there is not computed again; `--docs` writes the table into docs/results/fit.md.
"""

import argparse
import datetime
import tempfile
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import clothsim
from clothsim.garments.fit.transfer_seed import Size, sized, transferred
from clothsim.garments.fit.wear_check import WearCheck, check_wear
from clothsim.garments.inputs import BodyMesh, Garment, read_body_mesh, read_garment
from clothsim.mesh.generators.table import GENERATORS
from tests.benchmarks.stored_tables import Record, markdown_table, read_record, when, write_between, write_record
from transfer.signed_distance import body_surface

DATA = Path(__file__).parents[3] / "shared" / "data"
BASE = DATA / "bodies" / "makehuman_hm08_base.obj"
GENERATED = ("shirt", "trousers", "skirt")
SUITS = ("casualsuit", "sportsuit")
DRESS = DATA / "dress_on_body" / "dress_knife_drape.obj"
DRESS_VERTICES = (0, 15656)
DRESS_WELD = 0.006
GARMENTS = (*GENERATED, *SUITS, "dress")
FILES = ("mean_all", "mean_all_tpose", "mean_female", "f_smpl_average_A40")
BODIES = (*FILES, "makehuman", "mannequin", "mannequin_large")
LARGE = {"height": 1.82, "chest": 1.15, "waist": 1.2, "hips": 1.12}
HEADER = (
    *("garment", "body", "status", "edge ratios: percentiles 1 to 99", "doubled or halved [%]", "hem shift [%]"),
    *("vertices inside", "size factors: chest, waist, hips, trunk length", "stages", "CPU s"),
)
SHOWN = ("chest", "waist", "hips", "trunk_length")
DOCS = Path(__file__).parents[2] / "docs" / "results" / "fit.md"


def figure_named(name: str) -> BodyMesh:
    """Body of that name."""
    if name.startswith("mannequin"):
        return BodyMesh(name, *GENERATORS["mannequin"](**(LARGE if name.endswith("large") else {})), 1.0, ())
    if name == "codim_ipc":
        return replace(read_body_mesh(DRESS), name=name)
    figure = (
        read_body_mesh(BASE, group="body") if name == "makehuman" else read_body_mesh(DATA / "bodies" / f"{name}.obj")
    )
    return replace(figure, name=name)


def garment_named(name: str) -> tuple[Garment, str]:
    """Garment of that name, and the name of its own body."""
    if name in GENERATED:
        return Garment(name, *GENERATORS[name]()), "mannequin"
    if name == "dress":
        dress = read_garment(DRESS, DRESS, 1.0, part=DRESS_VERTICES, weld=DRESS_WELD)
        return replace(dress, name=name), "codim_ipc"
    return read_garment(DATA / "garments" / f"female_{name}01.mhclo", BASE, 0.1), "makehuman"


def seed(garment: Garment, source: BodyMesh, target: BodyMesh) -> tuple[np.ndarray, Size, WearCheck]:
    """Transferred and graded garment (n, 3) [m], its size, its look."""
    moved = transferred(garment, source, target)
    body = body_surface(target.positions, target.triangles)
    size = sized(garment, source, target, moved.positions, body, graded=True)
    return size.positions, size, check_wear(garment, size.positions, source, target)


def draw(file: Path, garment: Garment, positions: np.ndarray, target: BodyMesh) -> None:
    """Front and back side by side."""
    from PIL import Image

    from clothsim.render.picture import picture_setup, rendered
    from clothsim.render.surface_look import Surface

    frame, plain = target.frame, np.zeros((0, 2))
    surfaces = [
        Surface(garment.name, positions, garment.triangles, "cloth", plain),
        Surface(target.name, target.positions, target.triangles, "body", plain),
    ]
    panels = []
    for side in (1.0, -1.0):
        view = tuple(side * frame.front + 0.25 * frame.left + 0.1 * frame.up)
        setup = picture_setup(
            [surfaces],
            size=(360, 560),
            colour="plain",
            up=frame.up,
            view=view,
            title=f"{garment.name} on {target.name}",
            renderer="auto",
            focus=np.concatenate([target.positions, positions]),
        )
        panels.append(rendered(setup, surfaces))
    Image.fromarray(np.hstack(panels)).save(file, format="PNG")


def row(garment: Garment, source: BodyMesh, target: BodyMesh, stage: str, picture: Path) -> dict[str, Any]:
    """Measures of a fit; its picture."""
    started = process_time()
    if stage == "seed":
        positions, size, look = seed(garment, source, target)
        status = "distorted" if look.fault else "worn"
        inside = int((body_surface(target.positions, target.triangles).closest(positions).signed_distance < 0).sum())
        stages: list[dict[str, Any]] = []
    else:
        with tempfile.TemporaryDirectory() as temporary:
            cloth = clothsim.Cloth(garment.positions, garment.triangles, sewn=garment.sewn)
            bodies = (clothsim.Body(figure.positions, figure.triangles) for figure in (target, source))
            fit = clothsim.fit(cloth, *bodies, temporary)
        positions, size, look, status = fit.positions, fit.size, fit.look, fit.status
        inside = fit.counts.penetrating_vertices
        stages = [one.as_dict() for one in fit.stages]
    seconds = process_time() - started
    draw(picture, garment, positions, target)
    return {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "status": status,
        "look": look.as_dict(),
        "inside": inside,
        "factors": size.factors,
        "stages": stages,
        "cpu_seconds": seconds,
    }


def line(garment: str, body: str, seen: dict[str, Any]) -> tuple[str, ...]:
    """Cells of a row."""
    look, factors = seen["look"], seen["factors"]
    return (
        garment,
        body,
        seen["status"],
        f"{look['edge_low']:.2f} to {look['edge_high']:.2f}",
        f"{100 * look['distorted']:.2f}",
        f"{100 * look['hem']:+.1f}",
        str(seen["inside"]),
        ", ".join(f"{factors[name]:.2f}" for name in SHOWN if name in factors),
        ", ".join(stage["name"] for stage in seen["stages"] if stage["name"] not in ("garment", "transfer", "size")),
        f"{seen['cpu_seconds']:.0f}",
    )


def table(record: Record) -> str:
    """The table of the rows that are there, and the days on which they were measured."""
    pairs = [(garment, body, f"{garment} on {body}") for garment in GARMENTS for body in BODIES]
    rows = [line(garment, body, record[key]) for garment, body, key in pairs if key in record]
    seen = list(record.values())
    worn = sum(one["status"] in ("worn", "completed") for one in seen)
    days = when(one["date"] for one in seen)
    return f"{markdown_table(HEADER, rows)}\n\n{worn} of {len(seen)} pairs meet the criteria (measured {days})."


def main() -> None:
    """Compute the rows that are missing, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--garments", nargs="+", default=[*GENERATED, *SUITS], choices=GARMENTS)
    parser.add_argument("--bodies", nargs="+", default=[*BODIES], choices=BODIES)
    parser.add_argument("--stage", default="seed", choices=["seed", "drape"])
    parser.add_argument("--again", action="store_true", help="compute rows again that are there")
    parser.add_argument("--docs", action="store_true", help="write the table into docs/results/fit.md")
    parser.add_argument("-o", "--output", type=Path, required=True, help="directory for rows and pictures")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    file = arguments.output / f"{arguments.stage}.json"
    for name in arguments.garments:
        garment, own = garment_named(name)
        source = figure_named(own)
        for body in (body for body in arguments.bodies if body != own):
            key = f"{name} on {body}"
            if key in read_record(file) and not arguments.again:
                continue
            picture = arguments.output / f"{name}_{body}.png"
            seen = row(garment, source, figure_named(body), arguments.stage, picture)
            write_record(file, read_record(file) | {key: seen})
            print(" | ".join(line(name, body, seen)), flush=True)
    text = table(read_record(file))
    if arguments.docs:
        write_between(DOCS, f"fit table, {arguments.stage}", text)
    print(text)


if __name__ == "__main__":
    main()
