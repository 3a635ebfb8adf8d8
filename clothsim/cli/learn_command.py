"""`clothsim learn`: models of the drapes of a farm, and of a garment in motion."""

import argparse
from math import isnan
from pathlib import Path
from typing import Any

from clothsim.base.errors import InputError
from clothsim.base.text import text_table
from clothsim.cli import on_demand
from clothsim.cli.arguments import add_output_options, add_overwrite, as_count, refuse_output
from clothsim.cli.farm_command import make_drapes, read_recipe
from clothsim.cli.report import Report

_LEARN = """\
Train a model of the drapes of a farm as a function of varied parameters, for [seed] from = "model". With --motion it
models a garment on moving bodies, from a farm of clips or its recipe. Errors are measured on held-out data.

  clothsim learn drapes -o model.npz
  clothsim learn shirt_in_motion --motion -o moving.npz     farm and training in one command
  clothsim learn moving_farm --motion --model recurrent -o moving.npz      a recurrent network too; the best is written
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    learn = commands.add_parser("learn", usage="clothsim learn DIR -o FILE [options]", description=_LEARN)
    learn.add_argument("directory", type=Path, metavar="DIR", help="folder of the farm; with --motion also a recipe")
    learn.add_argument("-o", "--output", type=Path, metavar="FILE", required=True, help="the model, an .npz file")
    learn.add_argument("--held-out", type=float, metavar="F", help="fraction held out (default 0.25)")
    learn.add_argument(
        "--components", type=int, metavar="K", help="principal components (default 16, with --motion 48)"
    )
    learn.add_argument("--motion", action="store_true", help="learn a garment in motion, from a farm of clips")
    learn.add_argument("--held-kind", metavar="KIND", help="with --motion: kind held out (default: drawn)")
    learn.add_argument("--held-bodies", default="2", metavar="N", help="with --motion: bodies held out (default 2)")
    learn.add_argument("--model", choices=["recurrent"], help="with --motion: also train this one (clothsim[learn])")
    learn.add_argument("--kind", choices=MODELS, help="with --motion: write that kind of model, not the best")
    learn.add_argument("--seed", default="0", metavar="N", help="with --motion: seed of random choices (default 0)")
    add_overwrite(learn)
    add_output_options(learn, json="print the errors as JSON", quiet="print nothing but errors", handler=_learn)


MODELS = ("skinned", "nearest", "ridge", "recurrent")
"""Kinds of models of motion; a test compares them with those of the package."""


def _learn(arguments: argparse.Namespace) -> Report | int:
    refuse_output(arguments.output, arguments)
    if arguments.motion:
        return _learn_motion(arguments)
    given = {"--held-kind": arguments.held_kind, "--kind": arguments.kind, "--model": arguments.model}
    lost = [name for name, value in given.items() if value]
    if lost:
        raise InputError(f"{lost[0]} is for models of motion.", "Add --motion, or leave it out.")
    components = 16 if arguments.components is None else arguments.components
    held_out = 0.25 if arguments.held_out is None else arguments.held_out
    farm = on_demand.open_farm(arguments.directory)
    farm.refuse_output([arguments.output])
    made = on_demand.learn(farm, held_out, components)
    made.model.write(arguments.output, arguments.overwrite)
    names = ("training", "held_out", "left_out", "error", "mean_error", "nearest_error")
    return Report(
        {"model": str(arguments.output), **{name: getattr(made, name) for name in names}},
        f"{arguments.output}: {made.training} drapes learned, {made.held_out} held out, {made.left_out} left out "
        f"(another mesh).\nerror of held-out drapes (rms): model {1e3 * made.error:.2f} mm, nearest drape "
        f"{1e3 * made.nearest_error:.2f} mm, mean drape {1e3 * made.mean_error:.2f} mm.",
    )


def _learn_motion(arguments: argparse.Namespace) -> Report | int:
    """Learn models of a garment in motion, from a farm or from the recipe of one."""
    directory, seed = arguments.directory, as_count("--seed", arguments.seed, least=0)
    if arguments.held_out is not None:
        raise InputError("--held-out is for models of drapes.", "With --motion give --held-kind or --held-bodies.")
    if arguments.components is not None and arguments.components < 1:
        raise InputError(f"--components is {arguments.components}.", "Give a whole number from 1.")
    bodies = as_count("--held-bodies", arguments.held_bodies, least=0)
    if not directory.is_dir():
        recipe = read_recipe(directory)
        labels = []
        for values in (recipe.values(k) for k in range(recipe.count)):
            clip = next((str(value) for key, value in values.items() if key.endswith("motion.clip")), "")
            body = {key: value for key, value in values.items() if key.startswith("body.") and ".motion" not in key}
            labels.append((str(body), clip, clip.partition(":")[0]))
        if any(clip for _, clip, _ in labels):
            on_demand.division(labels, arguments.held_kind, bodies, seed)
        directory = arguments.output.with_name(f"{arguments.output.stem}_farm")
        worked, _ = make_drapes(recipe, directory, arguments)
        if not isinstance(worked, Report):
            return worked
    components = 48 if arguments.components is None else arguments.components
    farm = on_demand.open_farm(directory)
    farm.refuse_output([arguments.output])
    recurrent = on_demand.RegressorTraining(seed=seed) if "recurrent" in (arguments.model, arguments.kind) else None
    made = on_demand.learn_motion(farm, arguments.held_kind, bodies, components, seed, recurrent)
    made.write(arguments.output, arguments.kind, arguments.overwrite)
    sets = made.division
    counts = {name: len(sets.rows(name)) for name in ("training", *on_demand.SETS)}
    rows = []
    for name in made.models:
        both = [(made.errors[name][part], made.inside[name][part]) for part in on_demand.SETS]
        missed = ("none" if isnan(error) else f"{1e3 * error:.1f} mm {100 * inside:.2f} %" for error, inside in both)
        rows.append([name, *missed])
    text = (
        f"{arguments.output}: {arguments.kind or made.best}; {counts['training']} clips learned, "
        f"{counts['validation']} for validation. Held out: {counts['new motion']} clips of the kind {sets.kind}, "
        f"{counts['new body']} on {len(sets.bodies)} bodies ({len(sets.left_out)} left out: their motion is known).\n"
        f"error (rms) and vertices inside the body:\n{text_table(['model', *on_demand.SETS], rows)}"
    )
    document = {"model": str(arguments.output), "kind": arguments.kind or made.best, "clips": counts}
    return Report({**document, "errors": made.errors, "inside": made.inside}, text)
