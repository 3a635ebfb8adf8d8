"""Gradients of what a run does with respect to what it was given."""

from typing import TYPE_CHECKING

from clothsim.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from clothsim.gradients.design_aims import aims
    from clothsim.gradients.losses import Girth, Height, named_loss
    from clothsim.gradients.pixel_losses import Normals
    from clothsim.gradients.recover import bending_prior
    from clothsim.gradients.run import traced
    from clothsim.gradients.state_at_rest import StateAtRest
    from clothsim.gradients.views import View

__getattr__, __dir__, __all__ = lazy_names(__name__)
