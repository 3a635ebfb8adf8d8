"""Errors of the presets on scenes: `python -m tests.benchmarks.measure_presets SCENE ... [--budget 120] [--write]`.

Each scene is studied; what its presets came to is printed, and with --write kept in `clothsim.build.preset_errors`,
from where `clothsim run --preset` prints it; what it says of other scenes stays.
"""

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from clothsim.accuracy.study import Study, study_accuracy
from clothsim.build import preset_errors
from clothsim.build.preset_errors import Measured
from clothsim.build.presets import PRESETS
from clothsim.errors import ClothsimError, InputError
from clothsim.scene.toml_file import load_scene
from clothsim.text_table import text_table


def rows_of(study: Study, name: str) -> list[Measured]:
    """Measurement of the presets by a study; InputError where it knows no error."""
    if study.result["reference"] is None:
        raise InputError(f"The study of {name} is unfinished: {study}", "Give --budget more seconds.")
    own = study.result["reference"]["own_error"]
    return [
        Measured(
            each["settings"]["preset"],
            name,
            float(f"{each['error']:.3g}"),
            float(f"{each['relative']:.3g}"),
            float(f"{own:.2g}"),
            float(f"{each['seconds']:.2g}"),
        )
        for each in study.result["points"]
        if "preset" in each["settings"]
    ]


def written_into(source: str, rows: Sequence[Measured], date: str) -> str:
    """The source of `preset_errors` with other rows, in the order of PRESETS."""
    order = sorted(rows, key=lambda row: (list(PRESETS).index(row.preset), row.scene))
    lines = [
        f'    Measured("{r.preset}", "{r.scene}", {r.error!r}, {r.relative_error!r}, {r.own!r}, {r.seconds!r}),'
        for r in order
    ]
    table = (
        "\n".join(["MEASURED: tuple[Measured, ...] = (", *lines, ")"])
        if lines
        else "MEASURED: tuple[Measured, ...] = ()"
    )
    source = re.sub(r'^DATE = ".*"$', f'DATE = "{date}"', source, flags=re.MULTILINE)
    return re.sub(r"^MEASURED: .*?^\)$|^MEASURED: .*\(\)$", lambda found: table, source, flags=re.MULTILINE | re.DOTALL)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print, and write where asked."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.measure_presets", description=__doc__)
    parser.add_argument("scenes", nargs="+", type=Path, metavar="SCENE")
    parser.add_argument("-o", "--output", type=Path, default=Path("preset_studies"), help="where the studies go")
    parser.add_argument("--budget", type=float, default=120.0, metavar="S", help="of each study")
    parser.add_argument("--write", action="store_true", help="keep the numbers in the package")
    arguments = parser.parse_args(argv)
    rows: list[Measured] = []
    date = ""
    try:
        for path in arguments.scenes:
            directory = arguments.output / path.stem
            study = study_accuracy(load_scene(path), directory, budget=arguments.budget, name=path.stem)
            rows += rows_of(study, path.stem)
            date = study.result["date"][:10]
    except ClothsimError as error:
        print(error, file=sys.stderr)
        return 2
    cells = [
        [r.preset, r.scene, f"{r.error:g}", f"{100 * r.relative_error:.2g}", f"{r.own:g}", f"{r.seconds:g}"]
        for r in rows
    ]
    print(text_table(("preset", "scene", "error [mm]", "of size [%]", "reference's own [mm]", "seconds"), cells))
    if arguments.write:
        file = Path(preset_errors.__file__)
        again = {row.scene for row in rows}
        kept = [row for row in preset_errors.MEASURED if row.scene not in again]
        file.write_text(written_into(file.read_text(encoding="utf-8"), [*kept, *rows], date), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
