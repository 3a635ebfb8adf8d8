"""The end of a search of pictures, on a cloth with four triangles for one."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, eye_array, kron

from clothsim.base.arrays import Floats
from clothsim.gradients.finer_cloth import halved
from clothsim.gradients.mask_border import MaskBorder
from clothsim.gradients.picture_loss import PictureLoss
from clothsim.gradients.view_fit import ViewFit


def finer_fit(fit: ViewFit, at: Floats) -> tuple[ViewFit, csr_array]:
    """Return the pictures for the finer cloth, and its vertices as combinations of those of the cloth.

    InputError where the cloth cannot be meshed more finely.
    """
    _, weights, triangles = halved(fit.scene_at(at))
    views = [replace(view, losses={what: _of_fine(loss) for what, loss in view.losses.items()}) for view in fit.views]
    return replace(fit, views=tuple(views), triangles=triangles, halvings=fit.halvings + 1), weights


def of_finer_cloth(weights: csr_array, moves: Floats) -> Floats:
    """Return derivatives (3 m, k) of the finer cloth's vertices from those of the cloth's, (3 n, k)."""
    return np.asarray(csr_array(kron(weights, eye_array(3))) @ moves)


def _of_fine(loss: PictureLoss) -> PictureLoss:
    """The loss of a picture for the finer cloth."""
    if not isinstance(loss, MaskBorder):
        return loss
    return replace(loss, label=(4 * np.asarray(loss.label, np.int64)[:, None] + np.arange(4)).ravel())
