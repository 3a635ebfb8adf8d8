"""`python -m tests.reality --data FOLDER`: drapes of every measured fabric, scored against simple rivals; knits."""

import argparse
import datetime
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from clothsim.base.file_writing import write_atomically
from tests.benchmarks.stored_tables import markdown_table, write_between
from tests.reality import causes, knits, specimens
from tests.reality.borders import NAME, Lays, measured_lays, scans, scatter_of_centres
from tests.reality.ensembles import BENDING_LENGTHS, RATIOS, Fit, fitted, simulated
from tests.reality.score import Scored, mean_scores, scored, skills_over_one_rival

MARK, CAUSES_MARK, SPECIMENS_MARK, KNITS_MARK = "reality", "causes", "specimens", "knits"
RECORD = Path(__file__).parents[2] / "docs" / "results" / "reality.json"
HEADER = (
    "fabric", "lays", "c [mm]", "ratio", "coefficient [%]", "n_eff", "sd r [mm]", "score: simulated", "with spread",
    "fitted lay", "quadratic", "ceiling", "skill: simulated", "with spread",
)  # fmt: skip


def main(argv: Sequence[str] | None = None) -> int:
    """Simulate or read the ensembles, fit and score every fabric; exit code 0, also where there are no data."""
    parser = argparse.ArgumentParser(prog="python -m tests.reality", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, metavar="FOLDER", help=f"folder with {NAME}")
    parser.add_argument("--record", type=Path, default=RECORD, metavar="FILE", help="stored ensembles (JSON)")
    parser.add_argument("--simulate", action="store_true", help="simulate the ensembles again, for minutes")
    parser.add_argument(
        "--lays", type=int, default=len(RATIOS), metavar="N", help="of each length (default %(default)s)"
    )
    parser.add_argument("--page", type=Path, metavar="FILE", help="write the table between FILE's marks")
    arguments = parser.parse_args(argv)
    if not (arguments.data / NAME).is_file():
        print(f"Skipped: {arguments.data} has no {NAME}, the scanned drapes.")
        return 0
    if arguments.simulate:
        table = simulated(arguments.lays, lambda line: print(line, flush=True))
        made = {"date": datetime.date.today().isoformat(), "lengths_mm": BENDING_LENGTHS, "ratios": RATIOS}
        write_atomically(arguments.record, (json.dumps({**made, "lays": table}) + "\n").encode())
    stored = json.loads(arguments.record.read_text(encoding="utf-8"))
    labels, radii = scans(arguments.data)
    lays = measured_lays(labels, radii)
    scatters = scatter_of_centres(lays)
    fits = [fitted(stored["lays"], each, scatter) for each, scatter in zip(lays, scatters, strict=True)]
    scores = scored(lays, [each.ensemble for each in fits])
    texts = {
        MARK: page(lays, fits, scores, stored),
        CAUSES_MARK: markdown_table(causes.HEADER, causes.rows(stored["lays"], lays)),
        SPECIMENS_MARK: specimens.text(labels, radii),
    }
    if (arguments.data / knits.NAME).is_file():
        texts[KNITS_MARK] = knits_text(knits.compared_knits(arguments.data))
    print("\n\n".join(texts.values()))
    if arguments.page:
        for mark, text in texts.items():
            write_between(arguments.page, mark, text)
    return 0


def page(lays: Sequence[Lays], fits: Sequence[Fit], scores: Sequence[Scored], stored: dict) -> str:
    """The table in Markdown, and what it comes to."""
    rows, away = [], []
    for own, fit, score in zip(lays, fits, scores, strict=True):
        cloth, cloud = own.others.mean(axis=0), fit.ensemble.mean(axis=0)
        away.append((cloud / cloth - 1, cloud[1] - cloth[1]))
        both = [
            f"{100 * cloud[0]:.0f} / {100 * cloth[0]:.0f}",
            f"{cloud[1]:.1f} / {cloth[1]:.1f}",
            f"{1e3 * cloud[2]:.1f} / {1e3 * cloth[2]:.1f}",
        ]
        numbers = (score.simulated, score.dressed, score.fitted_lay, score.quadratic, score.ceiling)
        skills = [f"{score.skill(value):.1f}" for value in (score.simulated, score.dressed)]
        rows.append(
            [str(own.fabric), str(score.lays), f"{fit.length:.1f}", f"{fit.ratio:.2f}", *both]
            + [f"{value:.2f}" for value in numbers]
            + (skills if score.rival > score.ceiling else ["", ""])
        )
    means, skills = mean_scores(scores)
    rivals, over_one = skills_over_one_rival(scores)
    better = [sum(getattr(each, name) < each.rival for each in scores) for name in ("simulated", "dressed")]
    depth = np.median([100 * each[0][2] for each in away])
    folds = np.median([abs(each[1]) for each in away])
    count = len(stored["lays"][0])
    summary = [
        f"For each bending length, {count} lays were simulated ({stored['date']}). The mean scores are {means[0]:.2f}",
        f"(simulated), {means[1]:.2f} (with spread), {means[2]:.2f} (better rival) and {means[3]:.2f} (ceiling).",
        f"The skill of the simulation is {skills[0]:.2f}, and {skills[1]:.2f} with spread. The better rival is chosen",
        "for each fabric after its lays are known, which no single rival can do. The mean scores of the rivals are",
        f"{rivals[0]:.2f} (fitted lay) and {rivals[1]:.2f} (quadratic). Over the better of these two, the skill is",
        f"{over_one[0]:.2f}, and {over_one[1]:.2f} with spread. The simulation has",
        f"a better score than both rivals for {better[0]} of {len(scores)} fabrics (with spread: {better[1]}). The",
        f"median difference between the simulation and the real cloth is {round(depth):+d} % in sd r and",
        f"{folds:.1f} in n_eff.",
    ]
    return f"{markdown_table(HEADER, rows)}\n\n{' '.join(summary)}"


def knits_text(compared: Sequence[knits.Compared]) -> str:
    """The table of knits in Markdown, and what it comes to."""
    rows = []
    for each in compared:
        spread = each.measured.std(axis=0, ddof=1)
        forces = [
            f"{a:.3g} / {b:.3g} +- {sd:.1g}" for a, b, sd in zip(each.simulated, each.held_out, spread, strict=True)
        ]
        ends = f"{100 * each.strains[0]:.0f} to {100 * each.strains[-1]:.0f}"
        rows.append([each.name.replace("_", " "), ends, *forces, f"{each.width:.2f} / {each.measured_width:.2f}"])
    within, all_of = sum(each.within for each in compared), sum(len(each.strains) for each in compared)
    off = np.median([abs(a / b - 1) for each in compared for a, b in zip(each.simulated, each.held_out, strict=True)])
    of_stretches = (f"force {k} [N]" for k in range(1, knits.STRETCHES + 1))
    header = ("knit", "stretch [%]", *of_stretches, "width at the largest stretch")
    lost = [100 * (1 - np.array([each.measured_width, each.width])) for each in compared]
    away = np.median([abs(simulated - measured) for measured, simulated in lost])
    mean = np.mean(lost, axis=0)
    return (
        f"{markdown_table(header, rows)}\n\nForces and widths are simulated / measured. A measured force is the mean "
        "of the pulls that were not fitted, +- the standard deviation of all pulls. Widths are relative to the width "
        f"at the start. {within} of {all_of} simulated forces lie within the range of the pulls. The median difference "
        f"from the pulls that were not fitted is {100 * off:.0f} %. On average, the width shrinks by {mean[0]:.0f} % "
        f"in these pulls and by {mean[1]:.0f} % in the simulation; the median difference is {away:.1f} points."
    )


if __name__ == "__main__":
    sys.exit(main())
