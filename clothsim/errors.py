"""The errors a user sees: one sentence that says what is wrong and where, and what to do about it."""

LONGEST = 400
"""Letters of a line; what stands in the middle of a longer one (a value as long as its file) is left out."""


class ClothsimError(Exception):
    """An error with a remedy. The command line prints it as two short lines and exits with code 2."""

    def __init__(self, sentence: str, remedy: str = "") -> None:
        self.sentence = _readable(sentence)
        self.remedy = _readable(remedy)
        super().__init__(f"{self.sentence} {self.remedy}".strip())


class InputError(ClothsimError):
    """A scene, a mesh or an array that cannot be simulated as given."""


class MissingPackageError(ClothsimError):
    """An optional package that this job needs is not installed."""


def _readable(text: str) -> str:
    """`text` without what a terminal would obey, its lines of bounded length."""
    lines = ("".join(c if c.isprintable() else ascii(c)[1:-1] for c in _cut(line)) for line in text.split("\n"))
    return "\n".join(lines)


def _cut(line: str) -> str:
    half = LONGEST // 2
    return line if len(line) <= LONGEST else f"{line[:half]} ... {line[-half:]}"
