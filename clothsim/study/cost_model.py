"""Cost model: predicted seconds of a run from completed ones."""

from collections.abc import Mapping

from clothsim.study.parameters import Parameter, any_parameter
from clothsim.study.points import BASE, Point, point


def predicted_seconds(where: Point, done: Mapping[Point, float], parameters: Mapping[str, Parameter]) -> float:
    """Seconds of a point: those of the base times a factor for each parameter (the parameters' costs multiply).

    A parameter's factor is measured where a run has it alone at that level; else the growth between its two nearest
    levels goes on, or the parameter's own first guess where none is measured. The base must be done.
    """
    seconds = done[BASE]
    for name, level in where.levels:
        seconds *= _factor(parameters.get(name) or any_parameter(name), level, done)
    return seconds


def _factor(parameter: Parameter, level: int, done: Mapping[Point, float]) -> float:
    measured = {0: done[BASE]}
    alone = {each: point({parameter.name: each}) for each in range(-4, 5)}
    measured.update((each, done[where]) for each, where in alone.items() if where in done)
    if level in measured:
        return measured[level] / measured[0]
    nearest = min(measured, key=lambda each: abs(each - level))
    towards = 1 if level > nearest else -1
    inner = nearest - towards
    growth = parameter.growth
    if inner in measured:
        growth = max(1.0, (measured[nearest] / measured[inner]) ** towards)
    return measured[nearest] / measured[0] * growth ** (level - nearest)
