"""The blocks of the README, of docs/start and of docs/howto run; commands and keys of all pages are those of today."""

import re
from functools import partial

import pytest

from clothsim.render import marks
from clothsim.run import pictures
from tests.docs_blocks import DOCS, PARSED, REASONS, RUN, blocks_of
from tests.docs_blocks.execution import PageRun, commands_of, parsed, stale_words

HOWTO = sorted((DOCS / "howto").glob("*.md"))
LONGEST = 700
"""Most words of a how-to."""
RUNNING = [page for page in RUN if any(not b.reason and b.language in {"sh", "python"} for b in blocks_of(page))]


def name(page):
    return f"{page.parent.name}/{page.stem}"


@pytest.mark.parametrize("page", PARSED, ids=name)
def test_commands_and_keys_are_those_of_today(page):
    for block in blocks_of(page):
        parsed(block)
    assert stale_words(page.read_text(encoding="utf-8")) == set()


def test_a_stale_flag_is_found():
    assert stale_words("`clothsim run SCENE --colour` `clothsim farm work DIR --stale 9` `clothsim rum x`") == {
        "run --colour",
        "rum",
    }


@pytest.mark.parametrize("page", RUN, ids=name)
def test_a_block_that_is_not_run_has_a_reason(page):
    assert {block.reason for block in blocks_of(page)} - {""} <= REASONS.keys()


@pytest.fixture
def _small_pictures(monkeypatch):
    """A picture whose size is not asked for takes .8 CPU s in its own size, and .3 in this one."""
    for module, draw in ((pictures, pictures.draw_frame), (marks, marks.draw_closeup)):
        monkeypatch.setattr(module, draw.__name__, partial(_sized, draw))


def _sized(draw, *given, **settings):
    return draw(*given, **{"size": (320, 240), **settings})


@pytest.mark.usefixtures("_small_pictures")
@pytest.mark.parametrize("page", RUNNING, ids=name)
def test_the_blocks_of_a_page_run(page, tmp_path):
    running = PageRun(tmp_path)
    assert sum(running.run(block) for block in blocks_of(page)) > 0


@pytest.mark.parametrize("page", HOWTO, ids=name)
def test_a_how_to_is_a_recipe(page):
    text = page.read_text(encoding="utf-8")
    assert len(text.split()) < LONGEST
    assert re.findall(r"\b\d{4}-\d\d-\d\d\b", text) == []  # measurements have dates: docs/results
    assert re.findall(r"(?<![\w./*\])])\.\d", text) == []  # 0.36


@pytest.mark.parametrize(
    ("text", "commands"),
    [
        ("a b  # c\nd \\\n  e", [["a", "b"], ["d", "e"]]),
        ("a && b --x=1; c", [["a"], ["b", "--x=1"], ["c"]]),
        ("a 'b c' e[0].x=1,2", [["a", "b c", "e[0].x=1,2"]]),
    ],
)
def test_the_commands_of_a_block(text, commands):
    assert list(commands_of(text)) == commands
