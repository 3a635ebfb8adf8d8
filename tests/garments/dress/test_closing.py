"""Rounds of closing: the distance at which the cloth begins to touch itself."""

import pytest

from clothsim import Scene
from clothsim.engine import build
from clothsim.garments.dress.closing import contact_gap


@pytest.mark.parametrize("keys", [{}, {"d_hat": 2e-3}], ids=["of the mesh", "given"])
def test_the_gap_is_that_of_the_scene_with_its_body(keys):
    effects = {"gravity": {}, "membrane": {}, "self_contact": keys, "body_contact": {}}
    cloth = {"mesh": "rectangle", "size": [0.3, 0.2], "cells": [6, 4], "position": [0.0, 0.0, 0.5]}
    scene = Scene(cloth=cloth, body={"mesh": "sphere", "radius": 0.1}, effects=effects)
    assert contact_gap(scene) == build(scene).energies["self_contact"].activation_distance
    if keys:
        assert contact_gap(scene) == pytest.approx(2e-3)
