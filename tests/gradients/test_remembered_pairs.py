"""Contact pairs of recorded states: those of a search, without one."""

import numpy as np
import pytest
from adjoint_cases import Chain, stacked_scene
from small_scenes import BALL

from clothsim.gradients import backward_pass as module
from clothsim.gradients.backward_pass import RememberedPairs, remember, with_remembered_pairs
from clothsim.physics.contact.candidates import Candidates
from clothsim.physics.contact.pair_list import ARRAY_FIELDS


@pytest.fixture(scope="module", params=[(), ({**BALL, "position": [0.0, 0.0, -5.0]},)], ids=["alone", "far body"])
def chain(request):
    return Chain(stacked_scene(body=request.param), (0.01,) * 4)


def test_pairs_are_those_of_a_search(chain):
    integrator = with_remembered_pairs(chain.integrator)
    counts = []
    for record in chain.records:
        remember(integrator, record)
        for name in record.pairs:
            known = integrator.potential.energies[name].candidates
            searched = Candidates(known.surface, known.activation_distance, known.skin, known.offset)
            wanted, found = searched.active(record.solution), known.active(record.solution)
            assert (known.builds, searched.builds) == (0, 1)
            assert wanted.n_points == found.n_points
            for field in ARRAY_FIELDS:
                assert np.array_equal(getattr(wanted, field), getattr(found, field)), field
            counts.append((found.n_points, len(found) - found.n_points))
    assert min(map(max, zip(*counts, strict=True))) > 3  # of points and of edges


def test_a_backward_pass_searches_at_the_start_of_the_run_alone(chain, monkeypatch):
    made = []

    def noted(integrator):
        made.append(with_remembered_pairs(integrator))
        return made[-1]

    monkeypatch.setattr(module, "with_remembered_pairs", noted)
    adjoints = chain.adjoints()
    candidates = [getattr(each, "candidates", None) for each in made[0].potential.energies.values()]
    contacts = [each for each in candidates if isinstance(each, RememberedPairs)]
    assert {each.builds for each in contacts} == {1}
    monkeypatch.setattr(module, "with_remembered_pairs", lambda given: given)
    for name in ("start", "velocities", "forces"):
        one, other = getattr(adjoints, name), getattr(chain.adjoints(), name)
        assert np.abs(one - other).max() < 1e-9 * np.abs(one).max()
