"""Convergence reference in time: the same masses and membrane with an explicit integrator."""

from tests.known_answers.a4_time import ringing

__all__ = ["ringing"]
