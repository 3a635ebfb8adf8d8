"""Measured errors of the presets on study scenes; `tests.benchmarks.measure_presets` writes this file."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Measured:
    """Error and cost of a preset on a scene.

    Parameters
    ----------
    preset, scene : str
        Names.
    error : float
        RMS error of the last frame [mm].
    relative_error : float
        The same as a fraction of the cloth's size.
    own : float
        Error of the reference itself [mm].
    seconds : float
        Processor time [s].
    """

    preset: str
    scene: str
    error: float
    relative_error: float
    own: float
    seconds: float


DATE = "2026-11-21"
MEASURED: tuple[Measured, ...] = (
    Measured("draft", "study_cantilever", 5.47, 0.0265, 0.0024, 0.19),
    Measured("draft", "study_over", 3.7, 0.0117, 0.13, 0.29),
    Measured("draft", "study_strip", 22.5, 0.0546, 0.28, 0.14),
    Measured("standard", "study_cantilever", 6.46, 0.0313, 0.0024, 0.55),
    Measured("standard", "study_over", 2.14, 0.00676, 0.13, 0.87),
    Measured("standard", "study_strip", 13.1, 0.0318, 0.28, 0.35),
    Measured("fine", "study_cantilever", 0.0984, 0.000477, 0.0024, 5.4),
    Measured("fine", "study_over", 1.36, 0.00431, 0.13, 9.2),
    Measured("fine", "study_strip", 2.03, 0.00492, 0.28, 3.3),
)


def measured(preset: str) -> list[str]:
    """One line for each scene on which a preset was measured."""
    return [
        f"{row.scene}: {row.error:.2g} mm ({100 * row.relative_error:.2g} % of its size) in {row.seconds:.2g} s"
        for row in MEASURED
        if row.preset == preset
    ]
