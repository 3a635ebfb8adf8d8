"""Seconds since a moment: wall-clock time, and the CPU time of this process."""

from dataclasses import dataclass, field
from time import perf_counter, process_time


@dataclass(frozen=True)
class Stopwatch:
    """The moment at which it was made; CPU seconds are of all threads of this process, not of its children.

    Examples
    --------
    >>> watch = Stopwatch()
    >>> watch.wall_seconds() >= 0.0, watch.cpu_seconds() >= 0.0
    (True, True)
    """

    wall: float = field(default_factory=perf_counter)
    cpu: float = field(default_factory=process_time)

    def wall_seconds(self) -> float:
        """Wall-clock time since the moment [s]."""
        return perf_counter() - self.wall

    def cpu_seconds(self) -> float:
        """CPU time of this process since the moment [s]."""
        return process_time() - self.cpu
