"""Files: meshes, characters and motion, sewing patterns, runs, exchange formats."""

from typing import TYPE_CHECKING

from clothsim.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from clothsim.files.meshes.mesh_file import read_mesh
    from clothsim.files.meshes.mhclo import read_clothes
    from clothsim.files.meshes.polygons import MeshFile
    from clothsim.files.meshes.readers.obj import moved_obj, write_obj
    from clothsim.files.patterns.pattern_file import read_pattern
    from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
    from clothsim.files.runs.trajectory import TRAJECTORY_NAME

__getattr__, __dir__, __all__ = lazy_names(__name__)
