"""Hostile case: files, a command line, the class of answer that it must get; and what came of it."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

Files = Mapping[str, str | bytes | None] | Callable[[Path], None]
"""Content by name, None for a directory; or a function that makes them in a folder."""
Check = Callable[[Path, str], str]
"""An independent test of what a command left in its folder and printed: a sentence for a fault, else empty."""

RUN = "run a.toml -o out --no-picture"
BAD, ANY = "refused|found", "refused|found|completed"
CODES = {0: "completed", 1: "found", 2: "refused", 130: "stopped"}
"""Classes by exit code; "warned" is completed with the words that the case asks for."""
FALLS = re.compile(r"Traceback \(most recent|fault of clothsim|Fatal Python error|Segmentation fault")

CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")
"""What no line may hold: control characters of a file, printed raw."""

MOST_SECONDS, MOST_SILENCE, MOST_MEMORY = 60.0, 10.0, 2e9
"""Bounds: processor time [s], processor time without a line [s], memory [bytes]."""


@dataclass(frozen=True)
class Case:
    """One hostile input.

    Attributes
    ----------
    name : str
        Room and what is hostile: "mesh: a face of 10^12".
    words : str or sequence of str
        Command line, without `clothsim`.
    wanted : str
        Classes that are right, separated by "|": refused (exit 2), found (1: a check's finding, a failed run), warned,
        completed (0), stopped (130).
    files : Files
        What is in its folder before.
    says : str
        Regular expression that what is printed must match; of a case that must be "warned", its warning.
    check : Check
        Asked where the command completed.
    before : sequence of str
        Command lines that come first, whatever they answer.
    limits : mapping of str to int
        Bounds of the process: "FSIZE" [bytes].
    interrupt : sequence of (int, str)
        Signals to send, each once the file of that name is in the folder.
    small : bool
        True: one of the small form, in the process of the tests.
    """

    name: str
    words: str | Sequence[str]
    wanted: str
    files: Files = field(default_factory=dict)
    says: str = ""
    check: Check = lambda folder, text: ""
    before: Sequence[str] = ()
    limits: Mapping[str, int] = field(default_factory=dict)
    interrupt: Sequence[tuple[int, str]] = ()
    small: bool = False

    @property
    def line(self) -> list[str]:
        """The words of the command."""
        return self.words.split() if isinstance(self.words, str) else list(self.words)

    def make(self, folder: Path) -> None:
        """Write its files."""
        if callable(self.files):
            self.files(folder)
            return
        for name, content in self.files.items():
            path = folder / name
            (path if content is None else path.parent).mkdir(parents=True, exist_ok=True)
            if content is not None:
                path.write_bytes(content.encode() if isinstance(content, str) else content)


@dataclass(frozen=True)
class Outcome:
    """What came of a case.

    Attributes
    ----------
    got : str
        Class; "fell" for a traceback, an unknown code or a signal, "hung" beyond the time.
    seconds, silence : float
        Processor time, and the longest part of it without a line [s].
    memory : float
        Peak [bytes].
    wrong : str
        What is wrong, in a sentence; empty where all is as it must be.
    text : str
        What was printed.
    """

    got: str
    seconds: float
    silence: float
    memory: float
    wrong: str
    text: str


def checked(case: Case, folder: Path, code: int | None, text: str, figures: tuple[float, float, float]) -> Outcome:
    """The outcome by exit code (None: it did not end; below 0: a signal), output and (seconds, silence, memory)."""
    seconds, silence, memory = figures
    got = "hung" if code is None else CODES.get(code, "fell")
    if FALLS.search(text):
        got = "fell"
    said = re.search(case.says, text) is not None
    if got == "completed" and "warned" in case.wanted.split("|") and case.says and said:
        got = "warned"
    wrong = "" if got in case.wanted.split("|") else f"{got}, not {case.wanted}"
    if not wrong and not said:
        wrong = f"it does not say {case.says!r}"
    if not wrong and got == "refused" and not 1 <= len(text.strip().splitlines()[-2:]) <= 2:
        wrong = "no sentence"
    if not wrong and CONTROL.search(text):
        wrong = "a control character is printed"
    if not wrong and got in ("completed", "warned"):
        wrong = case.check(folder, text)
    for what, value, most in (
        ("seconds", seconds, MOST_SECONDS),
        ("seconds without a line", silence, MOST_SILENCE),
        ("bytes of memory", memory, MOST_MEMORY),
    ):
        if not wrong and value > most:
            wrong = f"{value:.3g} {what}"
    return Outcome(got, seconds, silence, memory, wrong, text)
