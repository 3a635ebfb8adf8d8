"""`clothsim fabrics`: the list, one fabric with its sources, the card of swatches, and refused input."""

import numpy as np
import pytest
from PIL import Image

from clothsim.cli import main
from clothsim.keys.fabric_table import FABRICS
from clothsim.run import swatches


def test_it_lists_every_fabric_with_numbers_and_source(capsys):
    assert main(["fabrics"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert {line.split()[0] for line in lines if line} >= set(FABRICS)
    denim = next(line for line in lines if line.startswith("denim"))
    assert denim.split()[1:7] == ["324", "0.62", "2,027", "410", "122", "26.6"]
    assert "Wang 2011" in denim
    assert "thickness" in denim
    assert max(len(line) for line in lines) <= 120


def test_it_shows_all_values_of_one_with_their_sources(capsys):
    assert main(["fabrics", "denim"]) == 0
    output = capsys.readouterr().out
    for word in ("warp_stiffness", "2027", "4614168", "estimated", "friction", "ACM Trans"):
        assert word in output
    assert main(["fabrics", "wool"]) == 0
    assert "warp_stiffness" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "output"),
    [
        (["fabrics", "denin"], "Did you mean 'denim'"),
        (["fabrics", "--swatches", "card.jpg"], ".png"),
        (["fabrics", "--swatches", "nowhere/card.png"], "no directory nowhere"),
    ],
)
def test_bad_input_is_reported_in_two_lines(words, output, capsys):
    assert main(words) == 2
    reported = capsys.readouterr().err
    assert output in reported
    assert len(reported.splitlines()) == 2


def test_a_card_of_swatches_tells_fabrics_apart(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(swatches, "RINGS", 5)
    monkeypatch.setattr(swatches, "SIZE", (96, 80))
    monkeypatch.setattr(swatches, "COLUMNS", 2)
    received = []
    swatches.draw_swatches(["interlock", "trousers", "cotton"], tmp_path / "card.png", received.append)
    picture = np.asarray(Image.open(tmp_path / "card.png"))
    assert picture.shape == (160, 192, 3)
    soft, stiff = picture[:80, :96], picture[:80, 96:]
    assert np.abs(soft.astype(float) - stiff).max() > 50
    shares = [int(line.split()[-2]) for line in received]
    assert shares[1] > max(shares[0], shares[2])
    assert all("completed" in line for line in received)


def test_the_drape_coefficient_of_a_flat_disc_is_one_and_of_a_folded_one_nothing():
    from clothsim.mesh.generators.shapes import disk

    positions, triangles = disk(swatches.RADIUS, 40)
    assert swatches.drape_coefficient(positions, triangles) == pytest.approx(1, abs=1e-3)
    distance = np.linalg.norm(positions, axis=1, keepdims=True)
    hanging = positions * np.minimum(1, swatches.HELD / np.maximum(distance, 1e-9))
    assert swatches.drape_coefficient(hanging, triangles) == pytest.approx(0, abs=1e-3)
