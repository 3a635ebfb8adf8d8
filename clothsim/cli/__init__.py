"""The command `clothsim`: simulation, fitting, studies, gradients, and what is made of their output."""

import contextlib
import gc
import os
import re
import sys
import warnings
from collections.abc import Sequence

from clothsim.base.errors import ClothsimError, IntersectionWarning
from clothsim.cli import (
    bundle_command,
    check_command,
    completion_command,
    design_command,
    dress_command,
    explain_command,
    export_command,
    fabrics_command,
    farm_command,
    fit_command,
    gradient_command,
    keys_command,
    learn_command,
    preview_command,
    recover_command,
    render_command,
    run_command,
    scenes_command,
    study_command,
    sweep_command,
    unpose_command,
    view_command,
)
from clothsim.cli.arguments import Parser, join_vectors, refuse_empty
from clothsim.cli.events import events, stream

COMMANDS = (
    run_command,
    dress_command,
    fit_command,
    study_command,
    sweep_command,
    farm_command,
    learn_command,
    preview_command,
    gradient_command,
    recover_command,
    design_command,
    bundle_command,
    render_command,
    export_command,
    unpose_command,
    view_command,
    check_command,
    explain_command,
    fabrics_command,
    scenes_command,
    keys_command,
    completion_command,
)

_RUN_DIRECTORY = "Name the directory that `clothsim run SCENE -o DIR` left."
REMEDIES = {
    "run": "`clothsim check SCENE` examines a scene, `clothsim keys` lists its keys.",
    "study": "`clothsim check SCENE` examines a scene, `clothsim keys` lists its keys.",
    "gradient": "`clothsim check SCENE` examines a scene, `clothsim keys` lists its keys.",
    "sweep": "`clothsim check SCENE` examines a scene, `clothsim keys` lists its keys.",
    "design": "`clothsim check SCENE` examines a scene, `clothsim keys` lists its keys.",
    "farm": "`clothsim farm --help` has an example.",
    "learn": "`clothsim farm --help` has an example.",
    "recover": "`clothsim check SCENE` examines a scene, `clothsim keys` lists its keys.",
    "explain": "`clothsim check SCENE` examines a scene, `clothsim keys` lists its keys.",
    "dress": "The formats are those of GarmentCode and Garment-Pattern-Generator; units are given by --scale.",
    "fit": "`clothsim check FILE` examines a mesh; units are given by --scale.",
    "check": "Repair the file, or read a part of it: --group or --component.",
    "resume": _RUN_DIRECTORY,
    "bundle": _RUN_DIRECTORY,
    "render": _RUN_DIRECTORY,
    "export": _RUN_DIRECTORY,
    "unpose": _RUN_DIRECTORY,
    "repose": "`clothsim unpose RUN -o canonical.npz` writes canonical garments.",
    "view": _RUN_DIRECTORY,
    "preview": "`clothsim learn DIR -o model.npz` makes a model.",
}
"""Remedies of errors that have none of their own, by command."""

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


def parser_of_all() -> Parser:
    """The parser of all commands."""
    parser = Parser(prog="clothsim", description=_DESCRIPTION)
    parser.add_argument("--version", action="store_true", help="print the version and stop")
    commands = parser.add_subparsers(metavar="COMMAND", title="commands", dest="command", parser_class=Parser)
    for module in COMMANDS:
        module.add_to(commands)
    return parser


def _dispatch(words: Sequence[str]) -> int:
    refuse_empty(words)
    parser = parser_of_all()
    arguments = parser.parse_args(words)
    if arguments.version:
        from clothsim import __version__

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
    command = next((word for word in words if word in REMEDIES), "")
    return REMEDIES.get(
        command, f"`clothsim {command} --help` lists what it takes." if command else "See `clothsim --help`."
    )


def _two_lines(sentence: str, remedy: str) -> None:
    if (own := stream()) is not None:
        own.event("error", sentence=" ".join(sentence.split()), remedy=remedy)
        return
    print(f"{' '.join(sentence.split())}\n{remedy}", file=sys.stderr)
