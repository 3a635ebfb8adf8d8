"""Blocks parsed, read as scenes, and run."""

import argparse
import ast
import contextlib
import inspect
import io
import os
import re
import shlex
import tomllib
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import clothsim
from clothsim.base.errors import InputError
from clothsim.base.inputs import refuse_unknown
from clothsim.cli import COMMANDS, GROUPS, main, parser_of_all, without_group
from clothsim.cli.arguments import join_vectors
from clothsim.gradients.views import KEYS, NOISE
from clothsim.scene.scene import make_scene
from clothsim.study.farm.recipe import load_recipe
from tests.docs_blocks import LATER, Block

OPERATORS = {"&&", "|", "||", ";", "&"}
REST: dict[str, dict[str, Any]] = {
    "cloth": {"mesh": "rectangle", "size": [1.0, 1.0], "cells": [2, 2]},
    "effects": {"inertia": {}, "membrane": {}},
}
"""What a scene has where a block shows a part of one."""


def commands_of(text: str) -> Iterator[list[str]]:
    """The words of each command of a shell block, without comments."""
    for line in text.replace("\\\n", " ").splitlines():
        words: list[str] = []
        lexer = shlex.shlex(line, posix=True, punctuation_chars="&|;<>")
        lexer.whitespace_split = True
        for word in [*lexer, ";"]:
            if word not in OPERATORS:
                words.append(word)
                continue
            if words:
                yield words
            words = []


def clothsim_words(words: Sequence[str]) -> list[str] | None:
    """The words after `clothsim`, also in an environment's folder, without redirections; None for another program."""
    if words[0].rpartition("/")[2] != "clothsim":
        return None
    end = next((k for k, word in enumerate(words) if word in {"<", ">", "2"}), len(words))
    return list(words[1:end])


def parsed(block: Block) -> int:
    """Parse a block without running it, by the readers that a user meets: the number of its commands, calls or tables.

    InputError for a flag, a command or a key that is none; AssertionError for a word of a function that is none.
    """
    if block.reason == "shown":
        return 0
    if block.language == "python":
        return checked_calls(block.text)
    if block.language == "toml":
        return read_toml(block.text)
    number = 0
    for own in map(clothsim_words, commands_of(block.text) if block.language == "sh" else ()):
        if own and not own[0].startswith("-"):
            words = without_group(join_vectors(own))
            if words[0] not in COMMANDS:
                raise InputError(f"{block}: there is no command {words[0]!r}.")
            parser_of_all().parse_args(words)
            number += 1
    return number


def stale_words(text: str) -> set[str]:
    """Commands and flags in running text, as `clothsim run SCENE --estimate`, that the command line does not have."""
    flags, stale = _flags_of_commands(), set()
    for command, rest in re.findall(r"`clothsim (\w+)([^`]*)`", text):
        word, *more = without_group([command, *rest.split()])
        if word not in COMMANDS and word not in GROUPS:
            stale.add(word)
        given = re.findall(r"(?<!\S)--[a-z][a-z-]*", " ".join(more))
        stale |= {f"{word} {flag}" for flag in given if word in flags and flag not in flags[word]}
    return stale


@cache
def _flags_of_commands() -> dict[str, set[str]]:
    """The flags of each command, of its actions too."""

    def parsers_in(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
        choices = [action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
        return dict(choices[0]) if choices else {}

    def flags(parser: argparse.ArgumentParser) -> set[str]:
        return {*parser._option_string_actions, *(flag for own in parsers_in(parser).values() for flag in flags(own))}

    return {command: flags(parser) for command, parser in parsers_in(parser_of_all()).items()}


def checked_calls(text: str) -> int:
    """Check names and keywords of the calls `clothsim.NAME(...)` of a program: the number of calls."""
    calls = 0
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            owner, name = node.func.value, node.func.attr
            if isinstance(owner, ast.Name) and owner.id == "clothsim":
                known = inspect.signature(getattr(clothsim, name)).parameters
                given = {word.arg for word in node.keywords if word.arg}
                free = any(each.kind is inspect.Parameter.VAR_KEYWORD for each in known.values())
                assert free or given <= known.keys(), f"clothsim.{name}: {given - known.keys()}"
                calls += 1
    return calls


def read_toml(text: str) -> int:
    """Read a scene, or a part of one completed by REST, by the reader of scenes: the number of its tables.

    Recipes of farms have a reader of their own; seams of a drawing are read with it alone, views with their pictures.
    """
    data = tomllib.loads(text)
    if "farm" in data:
        with TemporaryDirectory() as folder:
            file = Path(folder, "recipe.toml")
            file.write_text(text, encoding="utf-8")
            load_recipe(file)
        return len(data)
    if "panels" in data:
        return len(data)
    if "view" in data:
        refuse_unknown("views", data, ("view", "noise", "labels"))
        refuse_unknown("noise", data.get("noise", {}), NOISE)
        for keys in data["view"]:
            refuse_unknown("view", keys, KEYS)
        return len(data)
    whole: dict[str, Any] = {**REST, **data, "effects": {**REST["effects"], **data.get("effects", {})}}
    if isinstance(whole["cloth"], dict) and "mesh" not in whole["cloth"]:
        whole["cloth"] = {**REST["cloth"], **whole["cloth"]}
    make_scene(whole, Path())
    return len(data)


class PageRun:
    """The blocks of a page, run one after the other in a folder; the names of its programs are kept."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names: dict[str, Any] = {"__name__": "__main__"}
        os.environ.setdefault("MPLBACKEND", "Agg")

    def run(self, block: Block, everything: bool = False) -> bool:
        """Run a block, or write the file that it is: False where its reason speaks against that.

        AssertionError where a command ends with another code than 0; the error of a program.
        """
        if block.reason and not (everything and block.reason in LATER):
            return False
        if block.language == "toml" and block.file:
            (self.folder / block.file).write_text(block.text, encoding="utf-8")
        if block.language not in {"sh", "python"}:
            return False
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(io.StringIO()) as out:
            if block.language == "python":
                exec(compile(block.text, str(block), "exec"), self.names)
                return True
            for words in commands_of(block.text):
                own = clothsim_words(words)
                assert own is not None, f"{block}: {words[0]} is not run here: name a reason"
                code = main(own)
                assert code == 0, f"{block}: clothsim {shlex.join(own)} ends with {code}\n{out.getvalue()[-2000:]}"
        return True
