"""Reference from single and combined refinements, against made-up fields whose limit is known."""

import numpy as np
import pytest

from clothsim.study.reference_solution import Norm, large_parameters, limit, reference

RANDOM = np.random.default_rng(1)
EXACT, A, B, C = RANDOM.standard_normal((4, 7, 3))
NORM = Norm(np.full(7, 1 / 7))
ORDERS = {"cells": 2.0, "dt": 1.0, "d_hat": 1.0}


def field(h, dt=0.0):
    return EXACT + h**2 * A + dt * B + h**2 * dt * C


def two_parameters(levels=(-1, 0, 1)):
    h, dt = 0.5, 0.3
    sweeps = {
        "cells": {k: field(h / 2**k, dt) for k in levels if k},
        "dt": {k: field(h, dt / 2**k) for k in levels if k},
    }
    combined = {k: field(h / 2**k, dt / 2**k) for k in (-1, 1)}
    return field(h, dt), sweeps, combined


def estimated(base, sweeps, combined, noise=0.0):
    limits = {name: limit({0: base, **sweep}, 2, ORDERS[name], NORM) for name, sweep in sweeps.items()}
    return reference(base, sweeps, limits, combined, tuple(sweeps), dict.fromkeys(sweeps, 2), NORM, noise)


def test_two_parameters_and_what_they_add_together():
    found = estimated(*two_parameters())
    assert found.field == pytest.approx(EXACT, abs=1e-12)
    assert found.error < 1e-12
    assert found.interaction == pytest.approx(NORM(0.5**2 * 0.3 * C))


@pytest.mark.parametrize("kept", [(), (1,), (-1,)])
def test_without_both_joint_runs_the_stated_error_covers_what_is_missing(kept):
    base, sweeps, combined = two_parameters()
    found = estimated(base, sweeps, {k: combined[k] for k in kept})
    missing = NORM(found.field - EXACT)
    assert missing <= NORM(0.5**2 * 0.3 * C) * (1 + 1e-9)
    assert found.error > missing
    assert found.combined == sum(k > 0 for k in kept)


def test_noise_is_part_of_the_stated_error():
    assert estimated(*two_parameters(), noise=0.01).error == pytest.approx(0.01)


def pushed(finest):
    """A start inside d_hat: every parameter shows the same push, which the finest of them takes away."""
    return EXACT + 2.0 ** -float(finest) * B


def test_one_push_that_every_parameter_shows_is_counted_once():
    names, base = ("cells", "dt", "d_hat"), pushed(0)
    sweeps = {name: {-1: pushed(0), 1: pushed(1), 2: pushed(2)} for name in names}
    limits = {name: limit({0: base, 1: pushed(1), 2: pushed(2)}, 2, 1.0, NORM) for name in names}
    alone = reference(base, sweeps, limits, {}, names, dict.fromkeys(names, 2), NORM)
    together = reference(base, sweeps, limits, {1: pushed(1)}, names, dict.fromkeys(names, 2), NORM)
    true = NORM(base - EXACT)
    assert NORM(base - alone.field) == pytest.approx(3 * true)
    assert alone.error >= 2 * true  # so that no error is stated
    assert NORM(base - together.field) == pytest.approx(true)
    assert together.interaction == pytest.approx(2 * true)


def test_an_error_that_no_single_parameter_shows_is_found_together():
    """What the coarsest of two parameters sets stays where one alone is refined."""
    names, base = ("cells", "dt"), EXACT + B
    sweeps = {name: {1: base + 1e-3 * C} for name in names}
    limits = {name: limit({0: base, **sweeps[name]}, 2, 1.0, NORM) for name in names}
    together = reference(base, sweeps, limits, {1: EXACT + 0.5 * B}, names, dict.fromkeys(names, 2), NORM)
    assert 0.7 < NORM(base - together.field) / NORM(B) < 1.4
    assert together.error > 0.25 * NORM(B)


def test_the_parameters_to_refine_together():
    base = np.zeros((7, 3))
    moved = {"dt": 0.001 * A, "cells": A, "d_hat": 0.3 * B, "tolerance": 0.01 * C, "eps_v": 0 * C}
    limits = {name: limit({0: base, 1: each}, 2, None, NORM) for name, each in moved.items()}
    assert large_parameters(base, limits, ("dt", "cells"), NORM) == ("dt", "cells", "d_hat")
    assert large_parameters(base, {}, ("dt", "cells"), NORM) == ()


def test_joint_runs_that_fall_faster_than_expected_bound_the_error():
    """Three parameters show one push, and together nearly end it: the sum counts it thrice, runs of several once."""
    names, base = ("cells", "dt", "d_hat"), EXACT + B
    sweeps = {name: {1: EXACT + 0.5 * B + 0.3 * C, 2: EXACT + 0.25 * B - 0.3 * C} for name in names}
    limits = {name: limit({0: base, **sweeps[name]}, 2, 1.0, NORM) for name in names}
    combined = {1: EXACT + 0.05 * B, 2: EXACT + 0.005 * A}
    one, both = (
        reference(base, sweeps, limits, runs, names, dict.fromkeys(names, 2), NORM)
        for runs in ({1: combined[1]}, combined)
    )
    true = NORM(B)
    assert one.error > true
    assert NORM(both.field - EXACT) < 0.1 * true
    assert NORM(both.field - EXACT) < both.error < 0.7 * true
    assert both.error >= 0.99 * NORM(base - combined[1]) / 12  # what an order of 2 leaves of the first difference


def test_joint_runs_that_do_not_fall_are_no_limit():
    names, base = ("cells", "dt", "d_hat"), EXACT + B
    sweeps = {name: {1: EXACT + 0.5 * B + 0.3 * C, 2: EXACT + 0.25 * B - 0.3 * C} for name in names}
    limits = {name: limit({0: base, **sweeps[name]}, 2, 1.0, NORM) for name in names}
    combined = {1: base + 0.1 * A, 2: EXACT + 0.1 * B}
    assert reference(base, sweeps, limits, combined, names, dict.fromkeys(names, 2), NORM).error > NORM(B)
