"""Trust region: growth with successful steps of negative curvature, pauses of the exact Hessian at round-off."""

from clothsim.solve.newton.trust_region import MAX_RADIUS, MIN_RADIUS, PROJECTED, Trust


def test_the_first_step_is_the_projected_hessian_s_and_the_second_the_exact_one_s():
    assert not PROJECTED.exact
    assert PROJECTED.after(1.0, negative_curvature=False, noise=False).exact


def test_the_radius_doubles_while_bending_steps_are_taken_whole_up_to_its_bound():
    trust = Trust(projected=0)
    for _ in range(20):
        grown = trust.after(1.0, negative_curvature=True, noise=False)
        assert grown.radius == min(2 * trust.radius, MAX_RADIUS)
        trust = grown
    assert trust.radius == MAX_RADIUS


def test_a_step_that_was_cut_or_did_not_bend_halves_it_down_to_its_least():
    assert Trust(24.0, projected=0).after(0.5, negative_curvature=True, noise=False).radius == 12.0
    assert Trust(24.0, projected=0).after(1.0, negative_curvature=False, noise=False).radius == 12.0
    assert Trust(MIN_RADIUS, projected=0).after(0.5, negative_curvature=True, noise=False).radius == MIN_RADIUS


def test_after_round_off_the_pause_doubles_and_ends():
    trust, pauses = Trust(projected=0), []
    for _ in range(3):
        trust = trust.after(1.0, negative_curvature=True, noise=True)
        steps = 0
        while not trust.exact:
            trust, steps = trust.after(1.0, negative_curvature=False, noise=False), steps + 1
        pauses.append(steps)
    assert pauses == [2, 4, 8]
