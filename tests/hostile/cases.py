"""The counted list, room by room."""

from tests.hostile import farms, features, machine, meshes, motions, places, runs, scenes, sewing, words
from tests.hostile.case import Case

ROOMS = (meshes, motions, sewing, runs, farms, scenes, words, machine, features, places)


def all_cases() -> list[Case]:
    """All cases; their names are unique."""
    found = [case for room in ROOMS for case in room.cases()]
    names = [case.name for case in found]
    assert len({*names}) == len(names), {name for name in names if names.count(name) > 1}
    return found
