"""Errors for the user: one sentence with the fault and its location, and a remedy."""

from clothsim.base.text import printable

LONGEST = 400
"""Bound on the length of a line; the middle of a longer one (a value as long as its file) is left out."""


class ClothsimError(Exception):
    """Error with a remedy. The command line prints it as two short lines and exits with code 2.

    Parameters
    ----------
    sentence : str
        The fault, with names, indices and numbers.
    remedy : str
        A change that avoids it; may be empty.
    """

    def __init__(self, sentence: str, remedy: str = "") -> None:
        self.sentence = _readable(sentence)
        self.remedy = _readable(remedy)
        super().__init__(f"{self.sentence} {self.remedy}".strip())

    def __reduce__(self) -> tuple[type, tuple[str, str]]:
        """Pickled as what it was made of."""
        return type(self), (self.sentence, self.remedy)


class InputError(ClothsimError):
    """Scene, mesh or array that cannot be simulated as given."""


class MachineError(InputError):
    """Fault of the machine, as a full disk: it says nothing of what was to be simulated."""


class MissingPackageError(ClothsimError):
    """Optional package that is needed but not installed."""


class IntersectionWarning(UserWarning):
    """Cloth that intersects a body or cloth in a simulation without the contact that would prevent it."""


def _readable(text: str) -> str:
    """`text` without control characters, its lines of bounded length."""
    return printable("\n".join(_cut(line) for line in text.split("\n")))


def _cut(line: str) -> str:
    half = LONGEST // 2
    return line if len(line) <= LONGEST else f"{line[:half]} ... {line[-half:]}"
