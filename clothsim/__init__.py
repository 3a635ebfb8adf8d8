"""clothsim: finite-element cloth with intersection-free contact.

    import clothsim
    run = clothsim.simulate(clothsim.load_scene("scenes/sphere.toml"), output="drape")
    run.positions(-1)      # (n, 3) [m]

Names are loaded when they are used, so that `import clothsim` costs nothing.
"""

from typing import TYPE_CHECKING

from clothsim.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from clothsim.base.errors import ClothsimError, InputError, IntersectionWarning
    from clothsim.garments.author import Authored, author
    from clothsim.garments.dressed import Dress, dress
    from clothsim.garments.fitted import Fit, fit
    from clothsim.garments.outfit import Outfit, outfit
    from clothsim.gradients.camera import Camera
    from clothsim.gradients.design import Design, design
    from clothsim.gradients.gradient import Gradient
    from clothsim.gradients.layer import Layer, layer
    from clothsim.gradients.losses import Loss
    from clothsim.gradients.recover import Recovery, recover
    from clothsim.gradients.recover_clip import ClipRecovery, recover_clip
    from clothsim.gradients.recover_views import recover_views
    from clothsim.gradients.view_recovery import ViewRecovery
    from clothsim.keys.effect_tables import (
        Band,
        Buttons,
        Cord,
        Crease,
        Gust,
        Motion,
        PinGroup,
        Seam,
        SeamLine,
        Spring,
        Stiffener,
        Vortex,
        Zip,
    )
    from clothsim.keys.settings import Contact, RunSettings, Seed, Solver
    from clothsim.keys.typed_effects import (
        Air,
        Bending,
        BodyContact,
        Closures,
        Cords,
        Damping,
        ElasticBands,
        Fibres,
        Friction,
        Gravity,
        Inertia,
        Membrane,
        Pins,
        PlasticBending,
        Pressure,
        RestAngle,
        Seams,
        SelfContact,
        Springs,
        Stiffeners,
        StrainLimit,
        Targets,
    )
    from clothsim.mesh.checks import Finding
    from clothsim.mesh.generators.mannequin.measures import MeasuredBody, measured_body
    from clothsim.patterns.pattern import Pattern
    from clothsim.run.check import check
    from clothsim.run.mesh_objects import to_pyvista, to_trimesh
    from clothsim.run.results import Run, open_run
    from clothsim.run.resume import resume
    from clothsim.run.simulate import simulate
    from clothsim.run.simulation import Simulation
    from clothsim.run.step_reports import Progress, SimulationError, SimulationState
    from clothsim.scene.cloth_arrays import Body, Cloth, Rigid
    from clothsim.scene.effects import register_effect
    from clothsim.scene.scene import Scene
    from clothsim.scene.toml_file import examples, load_scene
    from clothsim.study.study import Study, study_accuracy
    from clothsim.viewer.page import view

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_names(__name__, "__version__")
