"""Stages: contents and callback."""

from time import perf_counter

from fitting_cases import capsule_figure, tube_garment

from clothsim.fitting.stage import staged
from transfer.signed_distance import body_surface

FIGURE = capsule_figure()
BODY = body_surface(FIGURE.positions, FIGURE.triangles)


def test_a_stage_is_counted_timed_and_reported():
    garment, on_stage = tube_garment(0.095), []
    stage = staged("refine", garment.triangles, BODY, lambda: (garment.positions, "said"), on_stage.append)
    assert on_stage == [stage]
    kept = stage.as_dict()
    assert {"name", "seconds", "penetrating_vertices", "intersecting_pairs"} <= set(kept)
    assert kept["name"] == "refine"
    assert kept["penetrating_vertices"] == stage.counts.penetrating_vertices == len(garment.positions)
    assert kept["intersecting_pairs"] == stage.counts.body_pairs
    assert kept["said"] == "said"
    assert kept["seconds"] == stage.seconds >= 0


def test_a_stage_may_have_begun_before():
    garment = tube_garment(0.11)
    began = perf_counter() - 5.0
    stage = staged("untangle", garment.triangles, BODY, lambda: (garment.positions, ""), lambda stage: None, began)
    assert stage.seconds > 5
    assert stage.counts.clean
