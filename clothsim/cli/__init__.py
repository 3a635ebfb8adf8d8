"""The command `clothsim`: simulation, fitting, studies, gradients, and what is made of their output."""

import argparse
import contextlib
import errno
import gc
import os
import re
import sys
import warnings
from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import NamedTuple, TextIO

from clothsim import __version__
from clothsim.base.errors import ClothsimError, InputError, IntersectionWarning
from clothsim.base.inputs import did_you_mean
from clothsim.base.text import printable
from clothsim.cli.arguments import Parser, join_vectors, refuse_empty
from clothsim.cli.report import BAD_INPUT, DONE, FAILED, INTERRUPTED, Report, events, never_silent, stream


class Command(NamedTuple):
    """A command: its module, imported when it is called; what it does; the remedy of errors that have none."""

    module: str
    summary: str
    remedy: str = ""


_SCENE = "`clothsim check SCENE` examines a scene, `clothsim keys` lists its keys."
_RUN = "Name the directory that `clothsim run SCENE -o DIR` wrote."
_MESH = "Repair the file, or read a part of it: --group or --component."
_GARMENT = "`clothsim check FILE` examines a mesh; units are given by --scale."
_FARM = "`clothsim farm --help` has an example."
_PATTERN = "The formats are those of GarmentCode and Garment-Pattern-Generator; units are given by --scale."

COMMANDS = {
    "run": Command("run_command", "simulate a scene", _SCENE),
    "resume": Command("run_command", "continue a stopped run", _RUN),
    "check": Command("check_command", "examine a mesh, a scene or a run", _MESH),
    "explain": Command("check_command", "list the effects and their cost", _SCENE),
    "view": Command("export_command", "show a run in a browser", _RUN),
    "render": Command("export_command", "draw a picture or a movie of a run", _RUN),
    "export": Command("export_command", "write a run for other programs", _RUN),
    "bundle": Command("export_command", "pack a run to replay it elsewhere", _RUN),
    "fit": Command("garment_command", "fit a garment onto a body", _GARMENT),
    "dress": Command("garment_command", "sew a pattern on a body", _PATTERN),
    "body": Command("body_command", "make a body from measurements"),
    "unpose": Command("body_command", "bring the garments of a run to the rest pose", _RUN),
    "repose": Command(
        "body_command",
        "put a canonical garment on another body",
        "`clothsim unpose RUN -o canonical.npz` writes canonical garments.",
    ),
    "wrinkle": Command("run_command", "add fine wrinkles to a coarse run", _RUN),
    "author": Command("author_command", "make a clip from edited frames of a run", _RUN),
    "study": Command("study_command", "measure error against computing time", _SCENE),
    "farm": Command("farm_command", "make many drapes from one recipe", _FARM),
    "sweep": Command("sweep_command", "run a scene with several values of its keys", _SCENE),
    "learn": Command("learn_command", "train a model on the drapes of a farm", _FARM),
    "preview": Command(
        "export_command", "show a model of drapes in a browser", "`clothsim learn DIR -o model.npz` makes a model."
    ),
    "gradient": Command("design_command", "differentiate a loss of a run", _SCENE),
    "recover": Command("recover_command", "find parameters of a scene from a drape or pictures", _SCENE),
    "design": Command("design_command", "find a pattern that hangs as you wish", _SCENE),
    "scenes": Command("info_command", "list the example scenes"),
    "keys": Command("info_command", "list the keys of a scene file"),
    "fabrics": Command("info_command", "list the named fabrics"),
    "test": Command("study_command", "test a fabric", "`clothsim fabrics` lists the named fabrics."),
    "completion": Command("info_command", "print a script that completes commands in a shell"),
}

GROUPS = {
    "": ("run", "resume", "check", "explain", "view", "render", "export", "bundle"),
    "garment": ("fit", "dress", "body", "unpose", "repose", "wrinkle", "author"),
    "study": ("study", "test"),
    "farm": ("farm", "sweep", "learn", "preview"),
    "design": ("gradient", "recover", "design"),
    "info": ("scenes", "keys", "fabrics", "completion"),
}
"""Commands by group: `clothsim garment fit` is `clothsim fit`; those of daily use have none."""

OF_GARMENTS = {
    "pattern": ("check", "list the panels, edges and seams of a sewing pattern"),
    "penetration": ("check", "find what part of a garment is inside a body: --on BODY"),
}
"""Words of the group garment that are cases of another command."""

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

    A run that completed with cloth through cloth is DONE: it prints a warning, and `check` of it returns FAILED.
    """
    words = join_vectors(sys.argv[1:] if argv is None else argv)
    if argv is None:  # called as a program, whose settings are its own
        gc.set_threshold(*_MANY_OBJECTS)
        # what is printed to a stream that the caller has closed goes nowhere
        for name in ("stdout", "stderr"):
            if getattr(sys, name) is None:
                setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115, it lasts
    with never_silent(words), events(words):
        return _guarded(words)


def _guarded(words: Sequence[str]) -> int:
    """The exit code of a command; errors become two lines, or an event."""
    try:
        code = _dispatch(words)
        sys.stdout.flush()
        return code
    except ClothsimError as error:
        if "--debug" in words:
            raise
        _two_lines(*_short(error, words))
        return BAD_INPUT
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # `clothsim explain | head` has closed the pipe
        _print_nothing_more(sys.stdout)
        return FAILED
    except Exception as error:
        if "--debug" in words:
            raise
        if (
            isinstance(error, OSError) and error.filename is not None
        ):  # a name that is too long, a folder without rights
            lines = f"{error.filename} cannot be used: {error.strerror}.", "Choose another name, or change its rights."
        elif isinstance(error, OSError) and error.errno == errno.ENOSPC:
            lines = "No space is left for what is written or printed.", "Make room, or send it elsewhere."
        elif isinstance(error, MemoryError):
            lines = f"There is not enough memory ({error}).", "Use a coarser mesh, or a part of it."
        else:
            lines = None
        if isinstance(error, OSError) and error.errno == errno.ENOSPC and error.filename is None:
            _print_nothing_more(sys.stdout)
        _two_lines(*lines or (f"{type(error).__name__}: {error}", "This is a fault of clothsim; --debug shows where."))
        return BAD_INPUT if lines else FAILED


def _print_nothing_more(to: TextIO) -> None:
    """Leave out what is still to be printed to a stream, which Python would try again at its end."""
    with contextlib.suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), to.fileno())


def parser_of_all() -> Parser:
    """The parser of all commands."""
    return _parser_of(COMMANDS)


def _parser_of(words: Iterable[str]) -> Parser:
    """The parser of some commands."""
    parser = Parser(prog="clothsim")
    commands = parser.add_subparsers(metavar="COMMAND", dest="command", parser_class=Parser)
    for module in dict.fromkeys(COMMANDS[word].module for word in words):
        import_module(f"clothsim.cli.{module}").add_to(commands)
    return parser


def _dispatch(words: Sequence[str]) -> int:
    refuse_empty(words)
    words = without_group(words)
    if not words or words[0] not in COMMANDS:
        return _without_command(words)
    arguments = _parser_of(words[:1]).parsed(words)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IntersectionWarning)  # the commands print it with the result
        done = arguments.handler(arguments)
    return done.show(arguments) if isinstance(done, Report) else int(done)


def without_group(words: Sequence[str]) -> list[str]:
    """The words of a command without those of its group.

    Examples
    --------
    >>> without_group(["garment", "fit", "suit.obj"]), without_group(["design", "skirt.toml"])
    (['fit', 'suit.obj'], ['design', 'skirt.toml'])
    """
    group, action = [*words, "", ""][:2]
    if group == "garment" and action in OF_GARMENTS:
        return [OF_GARMENTS[action][0], *words[2:]]
    is_target = group == action and (not words[2:] or words[2].startswith("-"))  # `clothsim study study -o out`
    return [*words[1:]] if group and action in GROUPS.get(group, ()) and not is_target else [*words]


def _without_command(words: Sequence[str]) -> int:
    """Version and help; InputError for a word that is not a command."""
    group = words[0] if words and words[0] in GROUPS else ""
    parser = Parser(
        prog="clothsim",
        usage=f"clothsim {group or '[--version]'} COMMAND ...",
        description=_DESCRIPTION,
        epilog=_listing(group),
    )
    parser.add_argument("--version", action="store_true", help="print the version and stop")
    parser.add_argument("command", nargs="?", help=argparse.SUPPRESS)
    arguments, others = parser.parse_known_args(words[1:] if group else words)
    if arguments.command is not None:
        names = GROUPS[group] if group else (*COMMANDS, *GROUPS)
        hint = did_you_mean(arguments.command, [name for name in names if name], 0.6)
        hint = hint or f"`clothsim {group}{' ' * bool(group)}--help` lists them."
        if arguments.command.endswith(".toml"):
            hint = f"Write `clothsim run {arguments.command}`."
        if arguments.command in ("help", "version"):
            hint = f"Write `clothsim --{arguments.command}`, or `clothsim COMMAND --help`."
        if arguments.command in names:
            raise InputError("An option stands before the command.", f"Write `clothsim {arguments.command} ...` first.")
        raise InputError(f"There is no command {arguments.command!r}.", hint)
    if others:
        parser.error(f"unrecognized arguments: {' '.join(others)}")
    if arguments.version:
        print(f"clothsim {__version__}")
        return DONE
    parser.print_help()
    return BAD_INPUT


def _listing(only: str) -> str:
    """The commands of all groups, or of one, a line each."""
    parts = []
    for group in [only] if only else GROUPS:
        summaries = {name: COMMANDS[name].summary for name in GROUPS[group]}
        if only == "garment":  # without the group's name these words are not commands
            summaries |= {name: summary for name, (_, summary) in OF_GARMENTS.items()}
        lines = [f"  {name:<11} {summary}" for name, summary in summaries.items()]
        parts.append("\n".join([f"{group or 'commands'}:", *lines]))
    return "\n\n".join(parts)


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
    command = next((word for word in words if word in COMMANDS), "")
    if not command:
        return "See `clothsim --help`."
    return COMMANDS[command].remedy or f"`clothsim {command} --help` lists what it takes."


LONGEST = 1000
"""Letters of a word in a sentence beyond which it is cut: a name may have any length."""


def _two_lines(sentence: str, remedy: str) -> None:
    sentence = re.sub(rf"\S{{{LONGEST},}}", lambda word: f"{word[0][:100]}... ({len(word[0]):,} letters)", sentence)
    if (own := stream()) is not None:
        own.event("error", sentence=" ".join(sentence.split()), remedy=remedy)
        return
    try:
        print(printable(f"{' '.join(sentence.split())}\n{remedy}"), file=sys.stderr, flush=True)
    except OSError:  # a full disk behind it: the exit code says it
        _print_nothing_more(sys.stderr)
