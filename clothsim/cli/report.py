"""What a command answers: its text, or one document with `--json`, and events in place of what it prints on stderr."""

import argparse
import io
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from time import monotonic
from typing import IO, Any, TextIO, cast

from clothsim import __version__
from clothsim.base.text import printable
from clothsim.cli import on_demand

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: done; a failed run, a found fault or a fault of clothsim itself; bad input; stopped by Ctrl-C."""


@dataclass(frozen=True)
class Report:
    """The answer of a command.

    Parameters
    ----------
    document : object
        What `--json` prints.
    text : str
        What is printed else; not with `--quiet`.
    good : bool
        False where the command failed or found a fault: exit code FAILED, else DONE.
    verdict : bool
        True where the text is the end of a long command: printed with `--quiet` too, and with `--json` on stderr.
    """

    document: Any
    text: str
    good: bool = True
    verdict: bool = False

    def show(self, arguments: argparse.Namespace) -> int:
        """Print it as the arguments ask for; returns the exit code."""
        if arguments.json:
            print(on_demand.to_json(self.document), flush=True)
        if self.verdict:
            print(printable(self.text), file=side(arguments), flush=True)
        elif not arguments.json and not getattr(arguments, "quiet", False):
            print(printable(self.text), flush=True)
        return DONE if self.good else FAILED


def side(arguments: argparse.Namespace) -> Any:
    """Where a command with a document puts its text: stderr, else stdout."""
    return sys.stderr if arguments.json else sys.stdout


def messages(arguments: argparse.Namespace, subject: object = None) -> Callable[[str], None]:
    """A callback that prints a line while a command works, nothing with `--quiet`; subject: of a first line."""

    def message(line: str) -> None:
        if not getattr(arguments, "quiet", False):
            print(printable(line), file=side(arguments), flush=True)

    if subject is not None:
        message(f"clothsim {__version__}: {arguments.command} {subject}")
    return message


class EventStream(io.TextIOBase):
    """A text stream that writes each line as {"event": "message", "text": ...} to another one."""

    def __init__(self, target: IO[str]) -> None:
        self._target = target
        self._rest = ""

    def writable(self) -> bool:
        """True."""
        return True

    def write(self, text: str) -> int:
        """Take text; whole lines are written."""
        *lines, self._rest = f"{self._rest}{text}".replace("\r", "\n").split("\n")
        for line in lines:
            if line.strip():
                self.event("message", text=line.rstrip())
        return len(text)

    def event(self, kind: str, **content: Any) -> None:
        """Write one event; numbers that are not finite as null."""
        self._target.write(f"{on_demand.to_json({'event': kind, **content})}\n")
        self._target.flush()

    def finish(self) -> None:
        """Write the last line where it has no end."""
        if self._rest:
            self.write("\n")


SILENCE = 8.0
"""Longest time of a command without a line [s]."""


class _WatchedStream:
    """A stream that notes when it was written to; all else is that of the stream itself."""

    def __init__(self, stream: IO[str], written: deque[float], over: Event) -> None:
        self._stream, self._written, self.over = stream, written, over

    def write(self, text: str) -> int:
        """Write, and note the time."""
        self._written.append(monotonic())
        return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def never_silent(words: Sequence[str]) -> Iterator[None]:
    """A line on stderr where a command has printed nothing for a while: a long step, a large file. --quiet: none."""
    if "--quiet" in words:
        yield
        return
    before, over = (sys.stdout, sys.stderr), Event()
    written: deque[float] = deque([monotonic()], maxlen=1)
    sys.stdout, sys.stderr = (cast("TextIO", _WatchedStream(stream, written, over)) for stream in before)

    def watch() -> None:
        while not over.wait(1.0):
            if monotonic() - written[-1] > SILENCE:
                print(f"still at work ({monotonic() - began:.0f} s)", file=sys.stderr, flush=True)

    began = monotonic()
    Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        over.set()
        sys.stdout, sys.stderr = before


def end_watch() -> None:
    """No further line of `never_silent`: from here on a command waits for a person, as a page does."""
    if isinstance(sys.stdout, _WatchedStream):  # stderr may be the stream of --json
        sys.stdout.over.set()


@contextmanager
def events(words: Sequence[str]) -> Iterator[None]:
    """Make stderr a stream of events where the words of a command have --json; else do nothing."""
    if "--json" not in words:
        yield
        return
    before = sys.stderr
    stream = EventStream(before)
    sys.stderr = stream
    try:
        yield
    finally:
        stream.finish()
        sys.stderr = before


def stream() -> EventStream | None:
    """The stream of events; None for a command without --json."""
    return sys.stderr if isinstance(sys.stderr, EventStream) else None


def program() -> str:
    """The name of the command line as it was called."""
    return "python -m clothsim" if Path(sys.argv[0]).name == "__main__.py" else "clothsim"
