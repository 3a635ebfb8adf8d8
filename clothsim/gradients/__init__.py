"""Gradients of what a run does with respect to what it was given."""

from typing import TYPE_CHECKING

from clothsim.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from clothsim.gradients.design import Design, DesignRun
    from clothsim.gradients.design_aims import HemAt, Measured, StretchBelow
    from clothsim.gradients.gradient import Gradient
    from clothsim.gradients.hem import hem_of
    from clothsim.gradients.losses import Girth, Height, Loss, Silhouette
    from clothsim.gradients.recover import Recovery
    from clothsim.gradients.recovery_problem import Evaluation, full_path
    from clothsim.gradients.run import traced
    from clothsim.gradients.scene_of_pattern import ShapedScene, shaped_scene
    from clothsim.gradients.state_at_rest import StateAtRest
    from clothsim.gradients.targets import target_loss

__getattr__, __dir__, __all__ = lazy_names(__name__)
