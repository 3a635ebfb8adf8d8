"""A shirt on a mannequin that raises its arms, and models of it without a farm."""

import numpy as np

from clothsim import Scene
from clothsim.engine import MovingGarment
from transfer.drape_autoencoder import DistanceGrid
from transfer.motion_model import MotionModel
from transfer.subspace import Subspace


def moving_scene(**sections):
    usual = {
        "cloth": {"name": "shirt", "mesh": "shirt", "edge": 0.04, "ease": 0.03},
        "body": {"name": "mannequin", "model": "mannequin", "motion": {"clip": "arms:1", "lead_in": 0.1}},
        "effects": {"inertia": {}, "membrane": {}, "gravity": {}, "body_contact": {}, "self_contact": {}},
        "solver": {"dt": 0.04},
        "run": {"duration": 0.08},
    }
    return Scene(**{**usual, **sections})


def skinned_model(garment: MovingGarment, moved=(0.0, 0.0, 0.0)) -> MotionModel:
    """The garment as it is placed, skinned; moved: by so much in the rest pose [m]."""
    rest = garment.unposed(garment.start, 0.0, garment.reference) + moved
    count = garment.inputs([0.0]).shape[1]
    none = np.zeros((rest.size, 1))
    return MotionModel(
        kind="skinned",
        family=garment.family([]),
        free=(),
        same=(),
        same_as=(),
        rate=25.0,
        space=Subspace(rest.ravel(), none, none, np.zeros(1)),
        centre=np.zeros(count),
        scale=np.ones(count),
        low=np.full(count, -99.0),
        high=np.full(count, 99.0),
        reference=garment.reference,
        grid=DistanceGrid(np.zeros(3), 1.0, np.full((2, 2, 2), 9.0)),
        parts={"components": np.array(1)},
    )
