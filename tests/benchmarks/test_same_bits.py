"""Same bits at each number of threads: the verdict over runs, and one run of a few steps."""

import json
from dataclasses import asdict, replace

import pytest

from tests.benchmarks import same_bits
from tests.benchmarks.same_bits import THREADS, Comparison, Trace, cells_of, main, trace

ONE = Trace(vertices=4, steps=("a", "b", "c"), in_contact=1, iterations=9, patch_iterations=2, seconds=1.0)


@pytest.mark.parametrize(
    ("other", "same", "first"),
    [
        (replace(ONE, seconds=7.0), True, 0),
        (replace(ONE, steps=("a", "x", "c")), False, 2),
        (replace(ONE, steps=("a", "b")), False, 0),
        (replace(ONE, iterations=8), False, 0),
        (replace(ONE, patch_iterations=3), False, 0),
    ],
)
def test_a_scene_has_the_same_bits_where_steps_and_iterations_agree(other, same, first):
    comparison = Comparison("sheet", (ONE, ONE, other))
    assert comparison.same is same
    assert comparison.first_difference == first
    assert cells_of(comparison)[4].startswith("yes" if same else "no")


def test_a_trace_holds_the_bits_of_each_step(tmp_path):
    scene = tmp_path / "sheet.toml"
    scene.write_text(
        '[cloth]\nmesh = "rectangle"\nsize = [0.1, 0.1]\ncells = [2, 2]\n'
        "[effects.inertia]\n[effects.membrane]\n[effects.gravity]\n[solver]\ndt = 0.02\n[run]\nduration = 0.08\n"
    )
    first = trace(scene, 1, steps=2, repeatable=False)
    whole = trace(scene, 1, steps=0, repeatable=False)
    lighter = trace(scene, 1, steps=2, repeatable=False, overrides=["effects.gravity.acceleration=[0.0, 0.0, -1.0]"])
    assert (first.vertices, len(first.steps), len(whole.steps), first.in_contact) == (9, 2, 4, 0)
    assert whole.steps[:2] == first.steps
    assert lighter.steps[0] != first.steps[0]


def test_each_number_of_threads_has_a_process_of_its_own_and_a_difference_is_the_exit_status(tmp_path, monkeypatch):
    asked = []

    def run(command, **options):
        work = json.loads(command[-1])
        asked.append((work["threads"], work["repeatable"]))
        other = {"steps": ("a", "b", "x")} if len(asked) > len(THREADS) and work["threads"] == 2 else {}
        printed = json.dumps(asdict(replace(ONE, **other)))
        return same_bits.subprocess.CompletedProcess(command, 0, stdout=f"warning\n{printed}\n", stderr="")

    monkeypatch.setattr(same_bits.subprocess, "run", run)
    page = tmp_path / "page.md"
    page.write_text("<!-- same-bits -->\n<!-- /same-bits -->\n")
    assert main(["sheet.toml", "--page", str(page)]) == 0
    assert main(["sheet.toml", "--any-order"]) == 1
    assert asked == [*((n, True) for n in THREADS), *((n, False) for n in THREADS)]
    assert "| sheet | 4 | 3, 1 | 9 + 2 | yes | 1.0, 1.0, 1.0 |" in page.read_text()
