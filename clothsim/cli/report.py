"""What a command answers, printed in one place: its text, or one document with `--json`."""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from clothsim import __version__
from clothsim.cli import on_demand


@dataclass(frozen=True)
class Report:
    """The answer of a command.

    Parameters
    ----------
    document : object
        What `--json` prints.
    text : str
        What is printed else; not with `--quiet`.
    code : int
        Exit code.
    verdict : bool
        True where the text is the end of a long command: printed with `--quiet` too, and with `--json` on stderr.
    """

    document: Any
    text: str
    code: int = 0
    verdict: bool = False

    def show(self, arguments: argparse.Namespace) -> int:
        """Print it as the arguments ask for; returns the exit code."""
        if arguments.json:
            print(on_demand.to_json(self.document), flush=True)
        if self.verdict:
            print(self.text, file=side(arguments), flush=True)
        elif not arguments.json and not getattr(arguments, "quiet", False):
            print(self.text, flush=True)
        return self.code


def side(arguments: argparse.Namespace) -> Any:
    """Where a command with a document puts its text: stderr, else stdout."""
    return sys.stderr if arguments.json else sys.stdout


def messages(arguments: argparse.Namespace, subject: object = None) -> Callable[[str], None]:
    """A callback that prints a line while a command works, nothing with `--quiet`; subject: of a first line."""

    def message(line: str) -> None:
        if not getattr(arguments, "quiet", False):
            print(line, file=side(arguments), flush=True)

    if subject is not None:
        message(f"clothsim {__version__}: {arguments.command} {subject}")
    return message
