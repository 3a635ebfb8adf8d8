"""Trust region of the exact Hessian: its radius, and when the projected Hessian is used instead."""

from dataclasses import dataclass, replace

MIN_RADIUS, MAX_RADIUS = 3.0, 1000.0
"""The radius, in lengths of the projected Hessian's step. A nearly flat valley gives little information about its far
end, so it starts small; along a long curved one it must grow, or each iteration takes three steps of a thousand (a
sheet squeezed to a millionth: 4,771 iterations with the radius fixed at 3, 329 with one that grows, and never more
elsewhere).
"""


@dataclass(frozen=True)
class Trust:
    """State of the trust region.

    Parameters
    ----------
    radius : float
        Bound on a step of negative curvature, in lengths of the projected Hessian's step.
    projected : int
        Number of coming iterations that use the projected Hessian alone.
    pause : int
        Length of the next such pause.
    """

    radius: float = MIN_RADIUS
    projected: int = 1  # the first step from a start that may be far off
    pause: int = 1

    @property
    def exact(self) -> bool:
        """True where the next step uses the exact Hessian."""
        return self.projected == 0

    def after(self, fraction: float, negative_curvature: bool, noise: bool) -> "Trust":
        """Return the state after a step of which the line search took `fraction`.

        negative_curvature: the step ended on the radius; noise: it was at the round-off of E, where the exact Hessian
        shows spurious negative curvature and its long steps cycle, while the projected one alone may crawl. So the
        exact one pauses for a number of iterations that doubles.
        """
        if noise:
            return Trust(MIN_RADIUS, 2 * self.pause, 2 * self.pause)
        if not self.exact:
            return replace(self, projected=self.projected - 1)
        grows = negative_curvature and fraction >= 1.0
        return replace(self, radius=min(2.0 * self.radius, MAX_RADIUS) if grows else max(0.5 * self.radius, MIN_RADIUS))


PROJECTED = Trust()
"""State at the start of a solve: projected Hessian first."""

TRUSTED = Trust(projected=0)
"""State that uses the exact Hessian from the first step, where a solve starts near its minimiser."""
