"""A motion with one solution, for orders in time: the same masses and membrane integrated by an explicit method."""

from clothsim.study.validation.time import ringing

__all__ = ["ringing"]
