"""A motion with one solution, for orders in time: the same masses and membrane integrated by an explicit method."""

from tests.known_answers.a4_time import ringing

__all__ = ["ringing"]
