"""A run on several threads: the bits of one thread, errors of tasks, and no thread left."""

import threading

import numpy as np
import pytest
from small_scenes import EFFECTS, SHEET, small_scene

from clothsim import ClothsimError, simulate
from clothsim.physics.contact import search
from clothsim.solve.linear import linear_system, pardiso
from clothsim.solve.linear.pardiso import make_factor as domains
from clothsim.solve.linear.pardiso_factor import load_library
from clothsim.solve.newton import direction

CONTACT = EFFECTS | {"bending": {}, "self_contact": {}, "friction": {}}


@pytest.fixture(autouse=True)
def _any_size(monkeypatch):
    """All tasks on threads, and factors in domains, however small the cloth."""
    monkeypatch.setattr(pardiso, "MIN_VERTICES", 1)
    monkeypatch.setattr(pardiso, "MIN_TOGETHER", 1)
    monkeypatch.setattr(linear_system, "MIN_TOGETHER", 1)
    monkeypatch.setattr(direction, "MIN_VERTICES", 1)
    monkeypatch.setattr("clothsim.solve.linear.pardiso.LARGEST_SEPARATOR", 0.3)


def positions(tmp_path, name, **solver):
    """Last positions of a sheet of 9 x 9 cells that falls on a ball, with self contact and friction."""
    scene = small_scene(
        cloth=SHEET | {"cells": [9, 9]},
        effects=CONTACT,
        solver={"dt": 0.02, **solver},
        run={"duration": 0.08, "frames_per_second": 25},
    )
    return simulate(scene, tmp_path / name).positions(-1)


def helpers():
    return [thread for thread in threading.enumerate() if thread.name.startswith("clothsim")]


@pytest.mark.parametrize("linear", ["superlu", "mixed"])
def test_the_bits_are_the_same_at_each_number_of_threads(tmp_path, monkeypatch, linear):
    """With PARDISO those of factors in domains, which repeatable = true takes on one thread too."""
    try:
        load_library()
    except (ImportError, OSError):
        if linear == "mixed":
            pytest.skip("PARDISO is not installed")
    monkeypatch.setattr(pardiso, "make_factor", lambda pattern, count, kind, _: domains(pattern, count, kind, True))
    one, *others = (positions(tmp_path, str(count), threads=count, linear=linear) for count in (1, 2, 3))
    assert np.isfinite(one).all()
    for other in others:
        np.testing.assert_array_equal(other, one)
    assert helpers() == []


def test_all_sites_are_reached_on_two_threads(tmp_path, monkeypatch):
    """Else the comparison of bits would show nothing."""
    seen = set()

    def noted(module):
        together = module.together

        def recorded(*tasks, long=True):
            if long and len(tasks) > 1:
                seen.add(module)
            return together(*tasks, long=long)

        monkeypatch.setattr(module, "together", recorded)

    sites = {search, linear_system, direction}
    for module in sites:
        noted(module)
    positions(tmp_path, "run", threads=2, linear="superlu")
    assert seen == sites


def test_an_error_in_a_task_ends_the_run_with_its_sentence(tmp_path, monkeypatch):
    def fails(*_, **__):
        raise ClothsimError("The task failed.", "Try again.")

    monkeypatch.setattr(search, "candidate_pairs", fails)
    with pytest.raises(ClothsimError, match="The task failed"):
        positions(tmp_path, "run", threads=2, linear="superlu")
    assert helpers() == []
