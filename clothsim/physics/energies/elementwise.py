"""Sums over elements: energies whose arrays have one row an element."""

from dataclasses import replace
from typing import Any, ClassVar, Self, cast

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.physics.energies.protocols import Restrictable


class Elementwise(Restrictable):
    """Restriction by dropping the elements without a moving vertex. For frozen dataclasses."""

    per_element: ClassVar[tuple[str, ...]]
    """Names of the arrays with one row an element; the first holds the rows of x of each element, (m, k)."""

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """The elements with a vertex that moves."""
        selected = np.flatnonzero(moving[getattr(self, self.per_element[0])].any(axis=1))
        return replace(cast("Any", self), **{name: getattr(self, name)[selected] for name in self.per_element})
