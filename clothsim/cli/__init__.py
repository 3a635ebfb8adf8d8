"""The command `clothsim`: simulation, fitting, studies, gradients, and what is made of their output."""

import contextlib
import gc
import os
import re
import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from clothsim import __version__
from clothsim.base.errors import ClothsimError, IntersectionWarning
from clothsim.cli.arguments import Parser, join_vectors, refuse_empty
from clothsim.cli.events import events, stream

_RUN_DIRECTORY = "Name the directory that `clothsim run SCENE -o DIR` left."
_SCENE = "`clothsim check SCENE` examines a scene, `clothsim keys` lists its keys."
_FARM = "`clothsim farm --help` has an example."


@dataclass(frozen=True)
class Command:
    """A command: its module in this folder, imported when the command is given, a line of help, a remedy of errors."""

    module: str
    summary: str
    remedy: str = ""


COMMANDS = {
    "run": Command("run_command", "simulate a scene", _SCENE),
    "resume": Command("run_command", "continue a stopped run", _RUN_DIRECTORY),
    "check": Command(
        "check_command",
        "examine a mesh, a scene or a run",
        "Repair the file, or read a part of it: --group or --component.",
    ),
    "explain": Command("explain_command", "list the effects and their cost", _SCENE),
    "view": Command("view_command", "show a run in a browser", _RUN_DIRECTORY),
    "export": Command("export_command", "write a run for other programs", _RUN_DIRECTORY),
    "render": Command("render_command", "draw a picture or a movie of a run", _RUN_DIRECTORY),
    "bundle": Command("bundle_command", "pack a run to replay it elsewhere", _RUN_DIRECTORY),
    "fit": Command(
        "fit_command",
        "fit a garment onto a body",
        "`clothsim check FILE` examines a mesh; units are given by --scale.",
    ),
    "dress": Command(
        "dress_command",
        "sew a pattern on a body",
        "The formats are those of GarmentCode and Garment-Pattern-Generator; units are given by --scale.",
    ),
    "unpose": Command("unpose_command", "garments of a run in the rest pose", _RUN_DIRECTORY),
    "repose": Command(
        "unpose_command",
        "a canonical garment on another body",
        "`clothsim unpose RUN -o canonical.npz` writes canonical garments.",
    ),
    "study": Command("study_command", "measure error against computing time", _SCENE),
    "sweep": Command("sweep_command", "run a scene with several values of its keys", _SCENE),
    "farm": Command("farm_command", "make many drapes of one recipe", _FARM),
    "learn": Command("learn_command", "learn a model of the drapes of a farm", _FARM),
    "preview": Command(
        "preview_command",
        "show a model of drapes in a browser",
        "`clothsim learn DIR -o model.npz` makes a model.",
    ),
    "gradient": Command("gradient_command", "derive a loss of a run", _SCENE),
    "recover": Command("recover_command", "find numbers of a scene from a drape", _SCENE),
    "design": Command("design_command", "find a pattern that hangs as wished", _SCENE),
    "scenes": Command("scenes_command", "list the example scenes"),
    "fabrics": Command("fabrics_command", "list the named fabrics"),
    "keys": Command("keys_command", "list the keys of a scene file"),
    "completion": Command("completion_command", "complete words in a shell"),
}
"""The commands, those of every day first."""

BAD_INPUT, UNEXPECTED, INTERRUPTED = 2, 1, 130

_MANY_OBJECTS = 100_000, 50
"""Thresholds of Python's cyclic garbage collector. The compiler makes millions of lasting objects: with Python's
defaults, 700 and 10, collection takes a tenth of a cold start."""

_DESCRIPTION = """\
Finite-element cloth with intersection-free contact.

  clothsim run sphere -o drape

Exit codes: 0 done; 1 the run failed or a check found a fault; 2 bad input; 130 stopped by Ctrl-C.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code.

    0: done; 1: the run failed or `check` found a fault; 2: bad input; 130: stopped by Ctrl-C. A run that completed with
    cloth through cloth is done: it prints a warning, and `check` of it returns 1.
    """
    words = join_vectors(sys.argv[1:] if argv is None else argv)
    if argv is None:  # called as a program, whose settings are its own
        gc.set_threshold(*_MANY_OBJECTS)
    with events(words):
        return _guarded(words)


def _guarded(words: Sequence[str]) -> int:
    """The exit code of a command; errors become two lines, or an event."""
    try:
        return _dispatch(words)
    except ClothsimError as error:
        if "--debug" in words:
            raise
        _two_lines(*_short(error, words))
        return BAD_INPUT
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # `clothsim explain | head` has closed the pipe
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return UNEXPECTED
    except Exception as error:
        if "--debug" in words:
            raise
        _two_lines(f"{type(error).__name__}: {error}", "This is a fault of clothsim; --debug shows where.")
        return UNEXPECTED


def parser_of(words: Sequence[str]) -> Parser:
    """The parser of these commands, whose modules are imported; of the others it knows word and line of help."""
    parser = Parser(prog="clothsim", description=_DESCRIPTION)
    parser.add_argument("--version", action="store_true", help="print the version and stop")
    commands = parser.add_subparsers(metavar="COMMAND", title="commands", dest="command", parser_class=Parser)
    full = {COMMANDS[word].module for word in words if word in COMMANDS}
    made: set[str] = set()
    for word, command in COMMANDS.items():
        if command.module not in full:
            commands.add_parser(word, help=command.summary, add_help=False)
        elif command.module not in made:  # a module may have several commands
            made.add(command.module)
            import_module(f"clothsim.cli.{command.module}").add_to(_WithSummaries(commands))
    return parser


def parser_of_all() -> Parser:
    """The parser of all commands."""
    return parser_of(list(COMMANDS))


@dataclass(frozen=True)
class _WithSummaries:
    """Commands of a parser, each with its line of help from the table."""

    commands: Any

    def add_parser(self, word: str, **keywords: Any) -> Any:
        """The parser of a command."""
        return self.commands.add_parser(word, help=COMMANDS[word].summary, **keywords)


def _dispatch(words: Sequence[str]) -> int:
    refuse_empty(words)
    parser = parser_of(words[:1])
    arguments = parser.parse_args(words)
    if arguments.version:
        print(f"clothsim {__version__}")
        return 0
    if arguments.command is None:
        parser.print_help()
        return BAD_INPUT
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IntersectionWarning)  # the commands print it with the result
        return int(arguments.handler(arguments))


def _short(error: ClothsimError, words: Sequence[str]) -> tuple[str, str]:
    """The sentence and the remedy, a line each: of many sentences the first, and how many more there are."""
    first, *more = error.sentence.splitlines() or [""]
    if more:
        first = f"{first} ({len(more)} more: `clothsim check` lists them)"
    return first, " ".join(error.remedy.split()) or _remedy(error.sentence, words)


def _remedy(sentence: str, words: Sequence[str]) -> str:
    """The remedy of an error that has none of its own: the keys of the section it names, or what the command takes."""
    section = re.search(r"\b(effects\.\w+|(?:cloth|body|solver|run|seed|contact)(?=(?:\[\d+\])?(?::|\.\w)))", sentence)
    if section is not None:
        return f"`clothsim keys {section[1]}` lists its keys with units and ranges."
    command = next((word for word in words if word in COMMANDS and COMMANDS[word].remedy), "")
    return COMMANDS[command].remedy if command else "See `clothsim --help`."


def _two_lines(sentence: str, remedy: str) -> None:
    if (own := stream()) is not None:
        own.event("error", sentence=" ".join(sentence.split()), remedy=remedy)
        return
    print(f"{' '.join(sentence.split())}\n{remedy}", file=sys.stderr)
