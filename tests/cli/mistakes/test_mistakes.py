"""Typical mistakes: a part of the list gets good answers (`python -m tests.cli.mistakes`: all of them)."""

import pytest

from tests.cli.mistakes import checked, mistakes, prepare

LIST = mistakes()
FEW = 30
"""Those that are answered before anything is built, and every tenth of the others."""
CHOSEN = [each for number, each in enumerate(LIST) if number < FEW or number % 10 == 0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("mistakes")
    prepare(made)
    return made


def test_the_list_is_long_enough():
    assert len(LIST) >= 66
    assert len({each.label for each in LIST}) == len(LIST)


@pytest.mark.parametrize("mistake", CHOSEN, ids=lambda each: each.label[:60])
def test_the_answer_names_what_is_wrong_and_what_to_do(folder, mistake):
    answer = checked(mistake, folder)
    assert answer.kind == "good", (answer.missing, answer.text)
