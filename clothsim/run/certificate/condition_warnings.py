"""Warnings of a completed run in which contact held and the cloth is yet not as anybody would wear it."""

from collections.abc import Sequence

from clothsim.geometry.held_inside import HeldInside
from clothsim.run.certificate.certificate import Certificate

LARGEST_STRETCH = 2.0
"""Principal stretch from which a warning is given: knits break between that and three, woven cloth far below."""


def condition_warnings(certificate: Certificate, inside: Sequence[HeldInside]) -> list[str]:
    """One sentence each for cloth that is held inside a body, overstretched, or was pinched by bodies.

    Parameters
    ----------
    certificate : Certificate
        Of all steps.
    inside : sequence of HeldInside
        At the end.
    """
    sentences = [f"{each.cloth} is inside {each.body}, {each.where}: contact keeps it in." for each in inside]
    if certificate.stretch_max > LARGEST_STRETCH:
        sentences.append(
            f"A triangle was stretched to {certificate.stretch_max:.3g} times its rest length: no fabric bears that. "
            "Look for a rest shape of another size, or set effects.strain_limit."
        )
    pinched = certificate.pinched
    if pinched.first_time is not None:
        sentences.append(
            f"Bodies pinch the cloth in {pinched.frames:,} frame{'' if pinched.frames == 1 else 's'}, at most at "
            f"{pinched.most_vertices:,} of its vertices, first {pinched.first_vertex} at {pinched.first_time:g} s."
        )
    return sentences
