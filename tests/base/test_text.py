"""Text of reports: lengths in a fitting unit."""

import pytest

from clothsim.base.text import length_text


@pytest.mark.parametrize(
    ("metres", "text"),
    [(1.0, "1 m"), (0.9996, "1 m"), (0.999, "999 mm"), (0.9996e-3, "1 mm"), (0.999e-3, "999 um"), (2.5, "2.5 m")],
)
def test_a_length_is_below_a_thousand_of_its_unit(metres, text):
    assert length_text(metres) == text
