"""Frames of a run as coloured meshes: vertices, triangles and colours of the cloths, and their legend."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.render.colour_scale import Quantity, Scale
from clothsim.render.picture import scale_of
from clothsim.render.run_frames import frame_surfaces
from clothsim.render.surface_look import FABRICS, Surface, vertex_values
from clothsim.run.field_pictures import field_settings
from clothsim.run.fields import FIELDS
from clothsim.run.results import Run

PLAIN, STRETCH = "plain", "stretch"
STROKES = "principal_directions"
"""A field that is drawn as strokes, not as colours."""
RANGE_FRAMES = 9
"""Frames, evenly spaced, from which the range of the colours is taken: one range for the whole run."""


@dataclass(frozen=True)
class ColouredMesh:
    """Surface with a colour at each vertex.

    positions: (n, 3) [m]; triangles: (m, 3); colours: (n, 3) sRGB in [0, 1]; values: (n,) their numbers, or none.
    """

    positions: Floats
    triangles: Ints
    colours: Floats
    values: Floats


@dataclass(frozen=True)
class Colouring:
    """Colours of the cloths of a run by one quantity.

    Attributes
    ----------
    name : str
        "plain", "stretch" or the name of a field.
    scale : Scale or None
        Colours of the numbers, the same in all frames; None where the cloth is plain.
    log_stretch : bool
        True where the numbers are logarithms of a stretch.
    surfaces_of : callable
        Surfaces of a frame, with their values.
    """

    name: str
    scale: Scale | None
    log_stretch: bool
    surfaces_of: Callable[[int], Sequence[Surface]]

    @classmethod
    def of_run(cls, run: Run, name: str) -> "Colouring":
        """Colours of a run by a quantity. InputError for one that the run cannot show."""
        settings: dict[str, Any] = {"colour": name} if name in (PLAIN, STRETCH) else field_settings(run, name)
        drawn = settings.get("surfaces_of", frame_surfaces)

        def surfaces_of(frame: int) -> Sequence[Surface]:
            return drawn(run.trajectory, frame)

        if name == PLAIN:
            return cls(name, None, False, surfaces_of)
        frames = np.unique(np.linspace(0, len(run) - 1, min(RANGE_FRAMES, len(run))).astype(int))
        cloths = [each for k in frames for each in surfaces_of(int(k)) if each.role == "cloth"]
        colour = settings["colour"]
        logarithms = colour == STRETCH or (isinstance(colour, Quantity) and colour.log_stretch)
        return cls(name, scale_of(colour, cloths), logarithms, surfaces_of)

    @staticmethod
    def names(run: Run) -> list[str]:
        """Quantities that colour this run: plain, stretch, fields that it wrote and those that its positions give."""
        names = [PLAIN]
        if "principal_stretches" in run.trajectory.fields:
            names.append(STRETCH)
        written = [name for name in run.trajectory.fields if name in FIELDS]
        computed = [name for name, field in FIELDS.items() if not field.in_step]
        for name in dict.fromkeys([*written, *computed]):
            if name in ("principal_stretches", STROKES):
                continue
            try:
                run.field(name, 0)
            except InputError:  # the scene has no membrane, or is not there any more
                continue
            names.append(name)
        return names

    @property
    def of_bodies(self) -> bool:
        """True where the colours lie on the bodies, whose cloths are then not drawn."""
        return self.name in FIELDS and FIELDS[self.name].location == "body"

    def mesh(self, frame: int) -> ColouredMesh:
        """The coloured surfaces of a frame, as one mesh: the cloths, or of a field of the bodies these."""
        surfaces = [each for each in self.surfaces_of(frame) if each.role == "cloth"]
        starts = np.cumsum([0, *(len(each.positions) for each in surfaces)])
        values = [vertex_values(each) for each in surfaces]
        return ColouredMesh(
            np.concatenate([each.positions for each in surfaces]),
            np.concatenate([each.triangles + start for each, start in zip(surfaces, starts[:-1], strict=True)]),
            np.concatenate([self._colours(k, surfaces[k], own) for k, own in enumerate(values)]),
            np.concatenate(values),
        )

    def positions(self, run: Run, frame: int) -> Floats:
        """Vertices of what is coloured in a frame, (n, 3) [m]."""
        if self.of_bodies:
            return np.concatenate([points for _, points, _ in run.bodies(frame)])
        return run.positions(frame)

    def value_at(self, mesh: ColouredMesh, vertex: int) -> str:
        """The number behind the colour at a vertex, in SI units; "-" where the cloth is plain."""
        if self.scale is None:
            return "-"
        value = float(mesh.values[vertex])
        unit = FIELDS[self.name].unit if self.name in FIELDS and not self.log_stretch else ""
        return f"{np.exp(value) if self.log_stretch else value:.4g} {unit}".strip()

    def _colours(self, number: int, surface: Surface, values: Floats) -> Floats:
        if self.scale is None or not len(values):
            return np.broadcast_to(FABRICS[number % len(FABRICS)], surface.positions.shape)
        return self.scale.colours(values)
