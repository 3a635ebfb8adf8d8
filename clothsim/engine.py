"""The engine door: what other programs and the applications of this package use, imported when it is used."""

from typing import TYPE_CHECKING

from clothsim.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from clothsim.geometry.intersection.crossings import Crossing, crossings
    from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs, intersection_points
    from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients
    from clothsim.geometry.kinematics.stretch import principal_stretches
    from clothsim.geometry.untangling.untangle import untangle
    from clothsim.keys.fabric import Fabric
    from clothsim.keys.fabric_table import TABLE, NamedFabric
    from clothsim.keys.fabrics import fabric_named, fabrics_of
    from clothsim.keys.keys import nearest, refuse_unknown, shown, table
    from clothsim.keys.mesh_keys import check_body, check_cloth
    from clothsim.mesh.checks import examine, refuse
    from clothsim.mesh.cloth import triangle_planes
    from clothsim.mesh.generators.mannequin.skeleton import JOINTS
    from clothsim.mesh.generators.mannequin.template import template
    from clothsim.mesh.topology import border_edges, components
    from clothsim.mesh.weld import mean_of_parts
    from clothsim.mesh.winding import facing_away
    from clothsim.mesh.world import World
    from clothsim.physics.energies.base import Energy, Off
    from clothsim.physics.energies.constraint import Constraint, Prescribed
    from clothsim.physics.energies.elementwise import Elementwise
    from clothsim.physics.energies.hessians import ElementHessian
    from clothsim.physics.energies.protocols import AdaptiveStiffness, DividedForce, History, Lagged
    from clothsim.run.archive import unpack_bundle, write_bundle
    from clothsim.run.callbacks import refuse_uncallable
    from clothsim.run.certificate_text import certificate_rows, length, many
    from clothsim.run.check import Examination, examined
    from clothsim.run.example_scenes import (
        example_scenes,
        installed_pattern,
        installed_scene,
        refuse_ending_of_installed,
        scene_file,
    )
    from clothsim.run.export import export
    from clothsim.run.field_pictures import field_settings
    from clothsim.run.fields import FIELDS
    from clothsim.run.interruption import interruption
    from clothsim.run.iterate_log import iterates_name
    from clothsim.run.output_directory import make_directory, refuse_earlier_run
    from clothsim.run.pictures import (
        FAILURE_NAME,
        GIF_NAME,
        MOVIE_NAME,
        PICTURE_NAME,
        draw_failure,
        draw_frame,
        draw_movie,
        upright,
    )
    from clothsim.run.precompile import kernels_are_compiled, let_finish, start_precompiling
    from clothsim.run.receipt import Receipt, explain, summary_of_effect
    from clothsim.run.recorded_run import Announcement, Listener
    from clothsim.run.remaining_kernels import compile_remaining_kernels
    from clothsim.run.session import Session, prepare
    from clothsim.run.summary import Progress
    from clothsim.run.swatches import draw_swatches
    from clothsim.scene.assembly.drape_model import DrapeModel, family, predicted, read_model, write_model
    from clothsim.scene.assembly.explicit_lengths import d_hats, fixed, steps_per_frame
    from clothsim.scene.assembly.initial_positions import initial_positions
    from clothsim.scene.assembly.meshes import body_of, cloth_of, cloth_shape, mesh_shape
    from clothsim.scene.assembly.model_body import PlacedCharacter, placed_character
    from clothsim.scene.assembly.placement import PART, placed
    from clothsim.scene.assembly.presets import PRESETS, with_preset
    from clothsim.scene.assembly.refinement import cells_of, with_cells
    from clothsim.scene.assembly.scene_world import Built, build, world_of
    from clothsim.scene.assembly.worn_shape import worn_shape
    from clothsim.scene.content import by_content
    from clothsim.scene.effects import CONTACTS
    from clothsim.scene.json_schema import json_schema
    from clothsim.scene.overrides import override
    from clothsim.scene.paths import replace
    from clothsim.scene.reference import markdown
    from clothsim.scene.reference_search import reference
    from clothsim.scene.scene import scene_from_text
    from clothsim.solve.linear.direct_solver import NotPositiveDefiniteError
    from clothsim.solve.linear.linear_system import System
    from clothsim.solve.linear.threads import available_cores
    from clothsim.solve.newton.potential import Potential
    from clothsim.solve.problem import Problem, step
    from clothsim.solve.stepping.integrators import BACKWARD_EULER, BDF2, formula_of
    from clothsim.solve.stepping.prescribed import prescribed
    from clothsim.solve.stepping.state import State, first_state
    from clothsim.solve.stepping.stepping import StepReport, step_of
    from clothsim.solve.stepping.time_loop import steps

__getattr__, __dir__, __all__ = lazy_names(__name__)
