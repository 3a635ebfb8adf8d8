"""Lines of a command that is at work: none once it waits for a person."""

import sys

import pytest

from clothsim.cli.report import end_watch, never_silent


@pytest.mark.parametrize("words", [["view"], ["view", "--json"]])
def test_a_command_that_serves_is_watched_no_longer(words):
    with never_silent(words):
        watched = sys.stdout
        assert not watched.over.is_set()
        end_watch()
        assert watched.over.is_set()
    end_watch()  # not watched: nothing happens
