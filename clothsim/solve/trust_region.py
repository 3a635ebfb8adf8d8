"""How far the exact Hessian is trusted from one Newton iteration to the next."""

from dataclasses import dataclass, replace

MIN_RADIUS, MAX_RADIUS = 3.0, 1000.0
"""The radius, in lengths of the projected Hessian's step. A nearly flat valley says little about its far end, so it
starts small; through a long curved one it must grow, or each iteration goes three steps of a thousand (a sheet squeezed
to a millionth: 4,771 iterations with the radius held at 3, 329 with one that grows, and never more elsewhere)."""


@dataclass(frozen=True)
class Trust:
    """radius: how many times longer than the projected Hessian's step a step of negative curvature may be.

    projected: for so many iterations the projected Hessian is used alone; pause: the next such number.
    """

    radius: float = MIN_RADIUS
    projected: int = 1  # the first step from a start that may be far off
    pause: int = 1

    @property
    def exact(self) -> bool:
        """Whether the next step is the exact Hessian's."""
        return self.projected == 0

    def after(self, fraction: float, negative_curvature: bool, noise: bool) -> "Trust":
        """After a step of which the line search took `fraction`; bends: it ended on the radius; noise: at round-off.

        At round-off the exact Hessian curves down for nothing, and its long steps cycle; the projected one alone may
        crawl. So the exact one rests for a pause that doubles.
        """
        if noise:
            return Trust(MIN_RADIUS, 2 * self.pause, 2 * self.pause)
        if not self.exact:
            return replace(self, projected=self.projected - 1)
        grows = negative_curvature and fraction >= 1.0
        return replace(self, radius=min(2.0 * self.radius, MAX_RADIUS) if grows else max(0.5 * self.radius, MIN_RADIUS))


PROJECTED = Trust()
"""As at the start of a solve: not at all."""

TRUSTED = Trust(projected=0)
"""From the first step, where a solve begins near its end."""
