"""Events of a command with `--json`: what it would print on stderr as lines of JSON, an object each."""

import io
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import IO, Any

from clothsim.cli import on_demand


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
