"""Dressed garment: what `dress` returns."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from clothsim import Run
from clothsim.base.arrays import Floats
from clothsim.engine import Fabric
from clothsim.garments.dress.closing import stretch_range
from clothsim.garments.dress.grading import Grading
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.fit.stage import Stage
from clothsim.garments.inputs import Figure
from clothsim.garments.penetration import Counts
from clothsim.patterns import Pattern


@dataclass(frozen=True)
class Dress:
    """Result of `dress`.

    Attributes
    ----------
    directory : Path
        Output directory.
    status : str
        "completed" (every seam is closed and the garment rests on the body, free of intersections), "sewn" (closed and
        free of intersections, but its drape did not complete) or "failed".
    reason : str
        Reason for the status, one sentence.
    pattern : Pattern
        Pattern as sewn: as read, or graded.
    placed : SewingState
        Panels as placed.
    state : SewingState
        Garment at the end: positions, triangles, welded seams.
    body : Figure
        Body that wears it.
    stages : tuple of Stage
        Stages in order, each with positions and penetration counts.
    run : Run or None
        Drape; None where none was started.
    notes : tuple of str
        Defaults used in reading and dressing.
    closing : tuple of Run
        Rounds in which the seams were closed.
    fabrics : mapping of str to Fabric
        Fabric of each panel.
    grading : Grading or None
        Factors by which the pattern was graded; None: it is as it was cut.

    Examples
    --------
    >>> import clothsim
    >>> worn = clothsim.dress("shirt_specification.json", on="body.obj")  # doctest: +SKIP
    >>> worn.status, worn.counts.clean  # doctest: +SKIP
    ('completed', True)
    """

    directory: Path
    status: str
    reason: str
    pattern: Pattern
    placed: SewingState
    state: SewingState
    body: Figure
    stages: tuple[Stage, ...]
    run: Run | None
    notes: tuple[str, ...]
    closing: tuple[Run, ...] = ()
    fabrics: Mapping[str, Fabric] = field(default_factory=dict)
    grading: Grading | None = None

    @property
    def positions(self) -> Floats:
        """Positions of the garment at its end, (n, 3) [m]."""
        return self.state.positions

    @property
    def counts(self) -> Counts:
        """Penetration counts of the last stage by the exact check."""
        return self.stages[-1].counts

    @property
    def stretch(self) -> tuple[float, float]:
        """1st and 99th percentile of the principal stretches against the pattern."""
        return stretch_range(self.state.stretches())
