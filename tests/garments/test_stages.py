"""Stages: contents and callback."""

from dataclasses import dataclass, replace
from time import process_time

import numpy as np
from fitting_cases import capsule_figure, tube_garment

from clothsim.garments.penetration import Counts
from clothsim.garments.stages import PlannedStage, Stage, best_stage, run_stages, staged
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
    began = process_time() - 5.0
    stage = staged("untangle", garment.triangles, BODY, lambda: (garment.positions, ""), lambda stage: None, began)
    assert stage.seconds > 5
    assert stage.counts.clean


def test_the_best_stage_has_the_fewest_intersections_with_the_body_then_with_itself():
    def stage(name, inside, pairs, own):
        return Stage(name, 0.0, np.zeros((0, 3)), Counts(inside, 0.0, pairs, own, None))

    stages = [
        stage("garment", 0, 0, 0),  # counted on the body that it was made for
        stage("transfer", 5, 3, 0),
        stage("refine", 1, 0, 90),
        stage("refine", 0, 1, 80),
        stage("grow", 300, 400, 0),
        stage("untangle", 0, 1, 80),
    ]
    assert best_stage(stages, 1) == 3
    assert best_stage(stages, 0) == 0
    assert best_stage(stages[:2], 1) == 1


@dataclass(frozen=True)
class Count:
    """State of a pipeline: stages run so far."""

    ran: tuple[str, ...] = ()
    failure: str = ""


def test_a_pipeline_leaves_out_what_is_not_needed_and_ends_at_a_failure():
    def ran(name, failure=""):
        return lambda task, state: replace(state, ran=(*state.ran, name), failure=failure)

    stages = (
        PlannedStage("a", ran("a")),
        PlannedStage("b", ran("b"), lambda task, state: task == "with b"),
        PlannedStage("c", ran("c", "stopped")),
        PlannedStage("d", ran("d")),
    )
    assert run_stages(stages, "plain", Count()) == Count(("a", "c"), "stopped")
    assert run_stages(stages, "with b", Count()).ran == ("a", "b", "c")
