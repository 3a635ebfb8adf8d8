"""Streams of a command that are full, closed or end early: a sentence at most, and never a traceback."""

import subprocess
import sys
from pathlib import Path

import pytest

from clothsim.cli import main

FULL = Path("/dev/full")


def shell(line):
    """Exit code and standard error of a line of a shell, in which $0 is Python."""
    done = subprocess.run(["bash", "-c", line, sys.executable], check=False, capture_output=True, text=True)
    return done.returncode, done.stderr


@pytest.mark.skipif(not FULL.exists(), reason="no device that is always full")
def test_a_full_disk_behind_the_output_is_one_sentence():
    code, said = shell('"$0" -m clothsim keys solver > /dev/full')
    assert code == 2
    assert len(said.strip().splitlines()) == 2
    assert said.startswith("No space is left")


@pytest.mark.skipif(not FULL.exists(), reason="no device that is always full")
@pytest.mark.parametrize("words", ["run missing", "keys nothing"])
def test_a_full_disk_behind_the_errors_does_not_change_the_exit_code(words):
    assert shell(f'"$0" -m clothsim {words} 2> /dev/full') == (2, "")


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_stream_that_is_closed_takes_nothing(closed):
    assert shell(f'"$0" -m clothsim keys solver {closed}') == (0, "")


def test_the_sentence_of_a_long_word_is_short(capsys):
    assert main(["farm", "work", "a" * 5000]) == 2
    said = capsys.readouterr().err
    assert len(said) < 300
    assert "(5,0" in said
