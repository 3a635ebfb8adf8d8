"""Arguments of `clothsim dress`: lengths, fabrics of panels and factors of grading."""

import pytest

from clothsim.base.errors import InputError
from clothsim.cli.garment_command import as_fabrics, as_factors, as_length


def test_lengths_with_their_units():
    lengths = [as_length("--size", text) for text in ("2cm", "15 mm", ".02", "1m")]
    assert lengths == pytest.approx([0.02, 0.015, 0.02, 1.0])


def test_fabrics_of_panels():
    assert as_fabrics(["collar=denim", "*cuff*=wool"]) == {"collar": "denim", "*cuff*": "wool"}
    assert as_fabrics([]) == {}


@pytest.mark.parametrize("given", [["collar"], ["=denim"], ["collar="], ["a=denim", "a=wool"]])
def test_what_is_no_fabric_of_a_panel(given):
    with pytest.raises(InputError):
        as_fabrics(given)


def test_factors_by_name():
    assert as_factors(["waist=1.05", "arm_length=.9"]) == {"waist": 1.05, "arm_length": 0.9}


@pytest.mark.parametrize("given", [["waist"], ["=1"], ["waist=wide"], ["waist=0"], ["waist=1", "waist=2"]])
def test_what_is_no_factor(given):
    with pytest.raises(InputError):
        as_factors(given)
