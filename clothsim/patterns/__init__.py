"""Sewing patterns: panels of curved edges, their seams, and their meshes."""

from typing import TYPE_CHECKING

from clothsim.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from clothsim.patterns.graded import PlaneMap, seams_alike
    from clothsim.patterns.pattern import Panel
    from clothsim.patterns.pattern_mesh import TOUCHING, MeshedSeam, PatternMesh, joined_vertices, mesh_pattern
    from clothsim.patterns.specification import read_specification, write_specification

__getattr__, __dir__, __all__ = lazy_names(__name__, earlier={"Seam": "MeshedSeam"})
