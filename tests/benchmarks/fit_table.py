"""Table of fits: every garment on every body, after its size stage or draped.

`python -m tests.benchmarks.fit_table [--garments shirt ..] [--bodies mean_all ..] [--stage seed|drape] [-o DIR]`
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np

import clothsim
from clothsim.fitting.inputs import Figure, read_figure, read_garment
from clothsim.fitting.sized import Size, sized
from clothsim.fitting.stage import Garment
from clothsim.fitting.transfer_seed import transferred
from clothsim.fitting.worn_look import Look, look_of
from clothsim.mesh.generators.table import GENERATORS
from transfer.body_frame import body_frame
from transfer.signed_distance import body_surface

DATA = Path(__file__).parents[3] / "shared" / "data"
BASE = DATA / "bodies" / "makehuman_hm08_base.obj"
GENERATED = ("shirt", "trousers", "skirt")
SUITS = ("casualsuit", "sportsuit")
FILES = ("mean_all", "mean_all_tpose", "mean_female", "f_smpl_average_A40")
BODIES = (*FILES, "makehuman", "mannequin", "mannequin_large")
LARGE = {"height": 1.82, "chest": 1.15, "waist": 1.2, "hips": 1.12}
HEAD = (
    "| garment | body | status | edges, 1st to 99th % | doubled or halved % | hem % | inside | size factors | CPU s |\n"
    "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"
)


def figure_named(name: str) -> Figure:
    """Body of that name."""
    if name.startswith("mannequin"):
        return Figure(name, *GENERATORS["mannequin"](**(LARGE if name.endswith("large") else {})), 1.0, ())
    figure = read_figure(BASE, group="body") if name == "makehuman" else read_figure(DATA / "bodies" / f"{name}.obj")
    return replace(figure, name=name)


def garment_named(name: str) -> tuple[Garment, str]:
    """Garment of that name, and the name of its own body."""
    if name in GENERATED:
        return Garment(name, *GENERATORS[name]()), "mannequin"
    return read_garment(DATA / "garments" / f"female_{name}01.mhclo", BASE, 0.1), "makehuman"


def seed(garment: Garment, source: Figure, target: Figure) -> tuple[np.ndarray, Size, Look]:
    """Transferred and graded garment (n, 3) [m], its size, its look."""
    moved = transferred(garment, source, target)
    body = body_surface(target.positions, target.triangles)
    size = sized(garment, source, target, moved.positions, body, graded=True)
    return size.positions, size, look_of(garment, size.positions, source, target)


def draw(file: Path, garment: Garment, positions: np.ndarray, target: Figure) -> None:
    """Front and back side by side."""
    from PIL import Image

    from clothsim.render.picture import picture_setup, rendered
    from clothsim.render.surface_look import Surface

    frame, plain = body_frame(target.positions, target.triangles), np.zeros((0, 2))
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


def row(garment: Garment, source: Figure, target: Figure, stage: str, folder: Path | None) -> str:
    """Line of the table."""
    started = process_time()
    if stage == "seed":
        positions, size, look = seed(garment, source, target)
        status = "distorted" if look.fault else "worn"
        inside = int((body_surface(target.positions, target.triangles).closest(positions).signed_distance < 0).sum())
    else:
        with tempfile.TemporaryDirectory() as temporary:
            meshes = [
                clothsim.Cloth(garment.positions, garment.triangles),
                *(clothsim.Body(figure.positions, figure.triangles) for figure in (target, source)),
            ]
            fit = clothsim.fit(*meshes, temporary)
        positions, size, look, status = fit.positions, fit.size, fit.look, fit.status
        inside = fit.counts.penetrating_vertices
    seconds = process_time() - started
    if folder is not None:
        draw(folder / f"{garment.name.split('.')[0]}_{target.name}.png", garment, positions, target)
    return (
        f"| {garment.name} | {target.name} | {status} | {look.edge_low:.2f} to {look.edge_high:.2f} | "
        f"{100 * look.distorted:.2f} | {100 * look.hem:+.1f} | {inside} | {size} | {seconds:.1f} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--garments", nargs="+", default=[*GENERATED, *SUITS], choices=[*GENERATED, *SUITS])
    parser.add_argument("--bodies", nargs="+", default=[*BODIES], choices=BODIES)
    parser.add_argument("--stage", default="seed", choices=["seed", "drape"])
    parser.add_argument("-o", "--output", type=Path, help="directory for pictures")
    arguments = parser.parse_args()
    if arguments.output is not None:
        arguments.output.mkdir(parents=True, exist_ok=True)
    print(HEAD, flush=True)
    for name in arguments.garments:
        garment, own = garment_named(name)
        source = figure_named(own)
        for body in (body for body in arguments.bodies if body != own):
            print(row(garment, source, figure_named(body), arguments.stage, arguments.output), flush=True)


if __name__ == "__main__":
    main()
