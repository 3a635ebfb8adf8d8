"""`clothsim check GARMENT --on BODY`: penetration report."""

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

import clothsim
from clothsim import engine
from clothsim.base.errors import InputError
from clothsim.base.quantity_text import length
from clothsim.cli import on_demand
from clothsim.cli.arguments import as_positive_number, as_range

if TYPE_CHECKING:
    from clothsim.base.arrays import Floats
    from clothsim.garments.penetration_report import PenetrationReport

WORN = 0.1
"""A garment farther from the body than this fraction of its size is not worn."""


def examined_penetration(arguments: argparse.Namespace) -> "engine.Examination":
    """The examination of a garment on a body: an error where a vertex is inside or triangles intersect."""

    def number(option: str, text: str | None) -> float | None:
        return None if text is None else as_positive_number(option, text)

    if not arguments.on.exists():
        raise InputError(f"There is no {arguments.on}.", "Name the file of a body.")
    if arguments.output is not None and arguments.output.is_dir():
        raise InputError(f"{arguments.output} is a directory.", "Name a picture in it with -o.")
    if arguments.output is not None and not arguments.output.resolve().parent.is_dir():
        raise InputError(
            f"There is no directory {arguments.output.parent}.", "Make it first, or choose another with -o."
        )
    report = on_demand.read_penetration_report(
        arguments.target,
        arguments.on,
        scale=number("--scale", arguments.scale),
        body_scale=number("--body-scale", arguments.body_scale),
        body_group=arguments.body_group,
        part=None if arguments.part is None else as_range("--part", arguments.part),
        weld=number("--weld", arguments.weld) or 0.0,
    )
    entries = list(_entries(report))
    notes = [*report.notes, *(entry for entry in entries if isinstance(entry, str))]
    findings = [entry for entry in entries if not isinstance(entry, str)]
    if arguments.output is not None:
        try:
            notes.append(f"{arguments.output}: {on_demand.draw_penetrations(report, arguments.output)}")
        except OSError as error:
            raise InputError(
                f"{arguments.output} cannot be written ({error.strerror}).", "Choose another with -o."
            ) from error
    where = "" if report.counts.position is None else f", worst {report.counts.where}"
    verdict = f"Not clean: {report.counts}{where}."
    if report.counts.clean:
        nearest = float(report.closest.signed_distance.min())
        far = f"Nothing intersects, but the garment is {length(nearest)} away from the body: give their units, --scale."
        verdict = "" if nearest <= WORN * report.body.size else far
    return engine.Examination(f"{arguments.target} on {arguments.on}", tuple(notes), tuple(findings), verdict)


def _entries(report: "PenetrationReport") -> "Iterator[clothsim.Finding | str]":
    """Findings and notes on each kind of penetration."""
    counts, n = report.counts, len(report.garment.positions)
    if counts.penetrating_vertices:
        percent = 100 * counts.penetrating_vertices / n
        sentence = f"{counts.penetrating_vertices:,} of {n:,} vertices ({percent:.1f} %) are inside the body"
        yield clothsim.Finding("error", "penetration", sentence, "", np.asarray(report.inside))
        for vertex, depth, position in on_demand.deepest_vertices(report):
            yield f"vertex {vertex} is {1e3 * depth:.3g} mm deep, at {_at(position)}"
    else:
        nearest = float(report.closest.signed_distance.min())
        yield f"none of {n:,} vertices is inside the body; the nearest is {length(nearest)} away"
    x, own = report.garment.positions, report.garment.triangles
    for who, pairs, other in (
        ("the garment and the body", report.body_pairs, report.body.triangles + n),
        ("the garment and itself", report.self_pairs, own),
    ):
        if len(pairs):
            position = engine.intersection_points(np.concatenate([x, report.body.positions]), own, other, pairs[:1])[0]
            sentence = f"{who} intersect in {len(pairs):,} pairs of triangles, the first near {_at(position)}"
            yield clothsim.Finding("error", "intersection", sentence, "", pairs)
        else:
            yield f"{who} do not intersect"


def _at(position: "Floats") -> str:
    return f"({', '.join(f'{value:.3g}' for value in position)}) m"
