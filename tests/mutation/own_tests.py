"""Tests of each file: the test that mirrors it, and those named here, the cheapest first."""

from pathlib import Path

ROOMS = ("physics/energies", "physics/contact", "solve", "gradients")

FORMULAS = ("physics/energies/test_table", "physics/contact/test_examples", "gradients/test_past_differences")
"""Derivatives of every energy by x and by the past against differences, rigid motions, balance of forces."""

TRIANGLES = ("physics/energies/test_triangle_kernels", "physics/energies/test_membrane", "physics/test_membrane_patch")
BENDING = ("physics/energies/test_bending", "physics/energies/test_rest_angle", "physics/test_bending_plates")
BARRIER = ("physics/contact/test_psd_projection", "physics/contact/test_barrier_oracle", "physics/test_contact_gap")
SEARCH = ("physics/contact/test_search", "physics/contact/test_culling", "physics/contact/test_candidates")
FRICTION = ("gradients/test_past_differences", "physics/contact/test_friction_against_ipctk", "physics/test_friction")
STEPS = ("solve/stepping/test_stepping", "solve/stepping/test_rest", "physics/test_time")
NEWTON = ("solve/newton/test_newton", "solve/linear/test_linear_system")
FACTORS = ("solve/linear/test_linear_solvers", "solve/linear/test_dissected_factor")
HISTORIES = ("gradients/test_past_differences", "gradients/test_histories")
ADJOINT = ("gradients/test_exact_system", "gradients/test_past_differences", "gradients/test_backward_pass")

MORE: dict[str, tuple[str, ...]] = {
    "physics/energies/bending": BENDING,
    "physics/energies/closures": FORMULAS,
    "physics/energies/cords": FORMULAS,
    "physics/energies/damping": FORMULAS,
    "physics/energies/edge_curves": ("physics/energies/test_elastic_bands", "physics/energies/test_stiffeners"),
    "physics/energies/elastic_bands": FORMULAS,
    "physics/energies/fibre_kernels": ("physics/energies/test_fibres", *FORMULAS),
    "physics/energies/gravity": (*FORMULAS, "physics/test_time"),
    "physics/energies/hessians": ("physics/energies/test_hessians", *FORMULAS),
    "physics/energies/hinge_bending": (*BENDING, *FORMULAS),
    "physics/energies/hinge_kernels": (*BENDING, "physics/energies/test_midedge_softening", *FORMULAS),
    "physics/energies/hinge_moments": ("physics/energies/test_plastic_bending", *BENDING),
    "physics/energies/inertia": (*FORMULAS, "physics/test_time"),
    "physics/energies/key_values": ("physics/energies/test_pins",),
    "physics/energies/links": ("physics/energies/test_springs", "physics/energies/test_seams", *FORMULAS),
    "physics/energies/measured_membrane": FORMULAS,
    "physics/energies/membrane": TRIANGLES,
    "physics/energies/membrane_kernels": (*TRIANGLES, *FORMULAS),
    "physics/energies/midedge_bending": (*BENDING, "physics/energies/test_midedge_softening", *FORMULAS),
    "physics/energies/midedge_softening": FORMULAS,
    "physics/energies/paired_kernels": ("physics/energies/test_paired_membrane", *FORMULAS),
    "physics/energies/plastic_bending": (*FORMULAS, "gradients/test_histories"),
    "physics/energies/pressure": FORMULAS,
    "physics/energies/protocols": ("scene/assembly/test_material_over_time", *FORMULAS),
    "physics/energies/quadratic_bending": (*BENDING, *FORMULAS),
    "physics/energies/rigid_bodies": ("physics/test_rigid", *FORMULAS),
    "physics/energies/seams": FORMULAS,
    "physics/energies/stiffeners": FORMULAS,
    "physics/energies/targets": FORMULAS,
    "physics/energies/tension_field": FORMULAS,
    "physics/energies/triangle_kernels": (*TRIANGLES, *FORMULAS),
    "physics/energies/triangle_pairs": ("physics/energies/test_paired_membrane",),
    "physics/energies/woven_membrane": ("physics/energies/test_fibres", "physics/energies/test_measured_membrane"),
    "physics/contact/anchors": ("physics/contact/test_rigid_motion", "physics/test_static_friction", *HISTORIES),
    "physics/contact/barrier": ("physics/contact/test_stiffness", "physics/contact/test_effects", *BARRIER),
    "physics/contact/barrier_kernels": (
        "physics/contact/test_barrier",
        "physics/contact/test_effects",
        *BARRIER,
        *HISTORIES,
    ),
    "physics/contact/bvh": SEARCH,
    "physics/contact/candidates": ("physics/contact/test_effects", *BARRIER),
    "physics/contact/ccd": ("physics/contact/test_candidates", "physics/contact/test_step_against_ipctk"),
    "physics/contact/distance": ("physics/contact/test_barrier_oracle", "physics/contact/test_friction_against_ipctk"),
    "physics/contact/filter": SEARCH,
    "physics/contact/friction": (*FRICTION, *HISTORIES),
    "physics/contact/friction_coefficients": ("physics/contact/test_effects", *FRICTION),
    "physics/contact/pair_list": ("physics/contact/test_barrier_oracle",),
    "physics/contact/search": SEARCH,
    "physics/contact/setup": ("physics/contact/test_body_contact", "physics/contact/test_effects"),
    "physics/contact/stiffness": ("physics/contact/test_effects", "physics/test_rigid"),
    "physics/contact/surface": ("physics/contact/test_barrier_oracle",),
    "solve/linear/assembly": ("solve/linear/test_linear_system",),
    "solve/linear/linear_system": ("solve/linear/test_nonlinear_elimination",),
    "solve/linear/pardiso": FACTORS,
    "solve/linear/pardiso_factor": FACTORS,
    "solve/linear/sparsity": ("solve/linear/test_linear_system",),
    "solve/newton/convergence": ("solve/newton/test_force_balance",),
    "solve/newton/direction": NEWTON,
    "solve/newton/newton": NEWTON,
    "solve/newton/stability": ("solve/stepping/test_rest",),
    "solve/pinch/flypaper": ("solve/pinch/test_pinch",),
    "solve/pinch/pinch_gaps": ("solve/pinch/test_pinch",),
    "solve/problem": STEPS,
    "solve/stepping/integrators": ("physics/energies/test_rigid_bodies", "physics/test_bdf2", "physics/test_time"),
    "solve/stepping/local_error": ("physics/test_asked_error",),
    "solve/stepping/stepping": ("solve/stepping/test_rest", "physics/test_time", "physics/test_bdf2"),
    "solve/stepping/time_loop": (
        "solve/stepping/test_branch_switching",
        *STEPS,
        "solve/stepping/test_local_error",
    ),
    "gradients/backward_pass": ADJOINT,
    "gradients/design_aims": ("gradients/test_design",),
    "gradients/differentiable_session": ADJOINT,
    "gradients/exact_system": ADJOINT,
    "gradients/gradient": ("gradients/test_run", "gradients/test_parameters"),
    "gradients/parameters": ("gradients/test_run", "gradients/test_histories"),
    "gradients/pattern_numbers": ("gradients/test_design",),
    "gradients/placed_drape": ("gradients/test_pulled_drape",),
    "gradients/run": ("gradients/test_parameters",),
    "gradients/recover_views": ("gradients/test_pulled_drape",),
    "gradients/scene_of_pattern": ("gradients/test_design",),
    "gradients/state_at_rest": ("study/test_goal_error",),
}


def own_tests(root: Path, file: str) -> list[str]:
    """Test files of a source file, below root."""
    module = file.removeprefix("clothsim/").removesuffix(".py")
    folder, _, name = module.rpartition("/")
    files = [f"tests/{each}.py" for each in (f"{folder}/test_{name}", *MORE.get(module, ()))]
    return [each for each in dict.fromkeys(files) if (root / each).is_file()]
