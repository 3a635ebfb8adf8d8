"""Hostile inputs: a counted list, each with the class of answer that it must get."""
