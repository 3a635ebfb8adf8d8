"""Cost ladder: a rung or a reason for every effect of the table, and the page with the table."""

import numpy as np
import pytest
from PIL import Image

from clothsim.scene.effects import EFFECTS
from tests.benchmarks import ladder
from tests.benchmarks.ladder_picture import draw


@pytest.fixture(scope="module")
def climbed():
    return ladder.climb(cells=6, steps=1, lead=2, repeats=1)


def test_every_effect_is_a_rung_or_has_a_reason(climbed):
    first, *rest = climbed.rungs
    assert first.name == "inertia + membrane"
    names = [*ladder.GROUND, *(rung.name for rung in rest)]
    assert sorted([*names, *climbed.left_out]) == sorted(EFFECTS)
    assert names[2 : 2 + len(ladder.ORDER)] == list(ladder.ORDER)
    assert all(climbed.left_out.values())


def test_each_rung_has_the_effects_of_those_below_and_parts_that_add_up(climbed):
    on = set(ladder.GROUND)
    for rung in climbed.rungs:
        on |= {rung.name} & set(EFFECTS)
        assert set(rung.parts) == on | set(ladder.PHASES)
        assert sum(rung.parts.values()) == pytest.approx(rung.milliseconds)
        assert rung.iterations >= 1
    counts = {rung.name: rung.nonzeros for rung in climbed.rungs}
    assert counts["inertia + membrane"] < counts["bending"] == counts["gravity"] <= counts["self_contact"]


def test_the_table_and_the_picture_are_kept(climbed, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(ladder, "climb", lambda cells: climbed)
    page, picture = tmp_path / "page.md", tmp_path / "ladder.png"
    page.write_text("head\n<!-- ladder -->\nstale\n<!-- /ladder -->\ntail\n")
    assert ladder.main(["--page", str(page), "--picture", str(picture)]) == 0
    text = page.read_text()
    assert text.startswith("head\n<!-- ladder -->\n<details>")
    assert text.endswith("</details>\n<!-- /ladder -->\ntail\n")
    assert "stale" not in text
    assert f"]({picture.as_posix()})" in text
    assert all(f"| + {rung.name} |" in text for rung in climbed.rungs[1:])
    assert "+ friction" in capsys.readouterr().out
    assert np.asarray(Image.open(picture).convert("L")).std() > 20


def test_the_picture_takes_one_rung(climbed, tmp_path):
    draw(ladder.Ladder(climbed.rungs[:1], 6, climbed.day, {}), tmp_path / "one.png")
    assert Image.open(tmp_path / "one.png").size[0] > 1000
