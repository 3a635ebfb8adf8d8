"""The engine door: what other programs and the applications of this package use, imported when it is used."""

from typing import TYPE_CHECKING

from clothsim.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from clothsim.geometry.intersection.crossings import crossings
    from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs, intersection_points
    from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients
    from clothsim.geometry.kinematics.stretch import principal_stretches
    from clothsim.geometry.untangling.untangle import untangle
    from clothsim.keys.fabric import Fabric
    from clothsim.keys.fabric_table import TABLE as FABRICS
    from clothsim.keys.fabric_table import fabric_named, fabrics_of
    from clothsim.mesh.cloth import triangle_planes
    from clothsim.mesh.topology import border_edges, components
    from clothsim.mesh.weld import mean_of_parts
    from clothsim.mesh.winding import facing_away
    from clothsim.mesh.world import World
    from clothsim.physics.energies.base import Constraint, Energy, Off, Prescribed
    from clothsim.physics.energies.hessians import ElementHessian
    from clothsim.run.check import Examination, examined
    from clothsim.run.checked_motion import checked_motion
    from clothsim.run.export import unpack_bundle, write_bundle
    from clothsim.run.frames import Colouring
    from clothsim.run.pictures import draw_pictures, draw_run
    from clothsim.run.precompile import kernels_are_compiled, start_precompiling
    from clothsim.run.receipt import Receipt, explain
    from clothsim.run.remaining_kernels import compile_remaining_kernels
    from clothsim.run.resume import refuse_earlier_run
    from clothsim.run.session import Session, last_positions
    from clothsim.run.swatches import draw_swatches
    from clothsim.scene.assembly.drape_model import DrapeModel, Predictor
    from clothsim.scene.assembly.initial_positions import cloths_at_start
    from clothsim.scene.assembly.meshes import body_mesh, cloth_mesh
    from clothsim.scene.assembly.model_body import character_of_scene
    from clothsim.scene.assembly.moving_garment import MovingGarment
    from clothsim.scene.assembly.refinement import with_cells
    from clothsim.scene.assembly.scene_world import build
    from clothsim.scene.assembly.shapes import refuse_unwearable, worn_shape
    from clothsim.scene.named_files import by_content
    from clothsim.scene.paths import override, replace
    from clothsim.scene.reference import reference, reference_text
    from clothsim.scene.toml_file import example_file, example_scenes
    from clothsim.solve.problem import Problem, step
    from clothsim.solve.stepping.state import State
    from clothsim.solve.stepping.stepping import StepReport

__getattr__, __dir__, __all__ = lazy_names(__name__)
