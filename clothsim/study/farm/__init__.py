"""Farms: many drapes of one recipe, each published once, by processes that may be killed at any time."""
