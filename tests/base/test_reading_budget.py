import pytest

from clothsim import InputError
from clothsim.base.file_reading import MOST, Budget


def test_promises_add_up_to_the_bound():
    budget = Budget("walk.bvh")
    budget.spend("nodes", MOST["nodes"] // 2)
    budget.spend("nodes", MOST["nodes"] // 2)
    budget.spend("numbers", 1)
    with pytest.raises(InputError, match=r"walk\.bvh .*nodes"):
        budget.spend("nodes", 1)


def test_endless_items_are_not_built():
    def endless():
        while True:
            yield 0

    budget = Budget("bomb.dxf")
    with pytest.raises(InputError, match=r"bomb\.dxf"):
        list(budget.counted(endless(), "points", "points of a piece"))
    assert budget.spent["points"] == MOST["points of a piece"] + 1
    budget.spent["points of a piece"] = 0
    assert list(budget.counted("abc", "points of a piece")) == ["a", "b", "c"]


def test_sizes_beyond_any_memory_are_counted_exactly():
    with pytest.raises(InputError):
        Budget("x").spend("numbers", 1 << 40, 1 << 40, 4)
