"""`clothsim check PATTERN`: panels, edges and seams of a sewing pattern."""

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

import clothsim
from clothsim import engine, files, patterns, render
from clothsim.base.errors import InputError

if TYPE_CHECKING:
    from clothsim import Pattern

PATTERNS = (".dxf", ".json")
SPACING = 0.02
"""Size of the mesh that a pattern is tried with [m]."""


def examined_pattern(arguments: argparse.Namespace) -> "engine.Examination":
    """The panels, edges and seams of a pattern, drawn with -o; an error where it cannot be meshed."""
    others = ("body", "scale", "group", "component", "body_group", "body_scale", "part", "weld", "motion")
    wrong = [f"--{name.replace('_', '-')}" for name in others if getattr(arguments, name)]
    if wrong:
        raise InputError(f"{arguments.target} is a sewing pattern: {wrong[0]} is not for those.", "--seams and -o are.")
    notes: list[str] = []
    findings: list[clothsim.Finding] = []
    try:
        pattern = _read(arguments)
        notes += _lines(pattern)
        if arguments.output is not None:
            drawn = render.draw_pattern(arguments.output, pattern, arguments.target.name, edge_numbers=True)
            notes.append(f"drawn: {drawn}")
        _refuse_unmeshed(pattern)
    except InputError as error:
        findings.append(clothsim.Finding("error", "pattern", error.sentence, error.remedy, np.zeros(0, np.int64)))
    return engine.Examination(f"{arguments.target}, as a sewing pattern", tuple(notes), tuple(findings))


def _read(arguments: argparse.Namespace) -> "Pattern":
    """The pattern; a drawing without its sewing file too."""
    if arguments.target.suffix.lower() == ".dxf":
        return files.read_dxf_pattern(arguments.target, arguments.seams, sewn=False)

    return files.read_pattern(arguments.target, seams=arguments.seams)


def _lines(pattern: "Pattern") -> Iterator[str]:
    """Panels with the lengths of their edges, seams with those of both sides, and notes."""
    for name, panel in pattern.panels.items():
        edges = range(len(panel.edges))
        points = np.concatenate([panel.edge_points(edge, np.linspace(0, 1, 33)) for edge in edges])
        width, height = 100 * np.ptp(points, axis=0)
        lengths = ", ".join(f"{edge}: {100 * panel.edge_length(edge):.1f}" for edge in edges)
        yield f"{name}: {width:.1f} x {height:.1f} cm; edges [cm] {lengths}"
    for number, stitch in enumerate(pattern.stitches):
        first, second = (100 * pattern.panels[side.panel].edge_length(side.edge) for side in stitch.sides)
        yield f"seam {number}: {stitch.first} to {stitch.second}, {first:.1f} and {second:.1f} cm"
    yield from pattern.notes


def _refuse_unmeshed(pattern: "Pattern") -> None:
    """InputError for a panel that crosses itself, and for seams that give the garment one side."""
    mesh = patterns.mesh_pattern(pattern, SPACING)
    patterns.sewn_vertices(mesh, mesh.seams)
