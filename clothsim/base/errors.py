"""Errors for the user: one sentence with the fault and its location, and a remedy."""

import re

from clothsim.base.text import printable

LONGEST = 400
"""Largest length of a line. The middle of a longer line, such as a value as long as its file, is left out."""


class ClothsimError(Exception):
    """An error with a remedy. The command line prints it as two short lines and exits with code 2.

    Parameters
    ----------
    sentence : str
        The fault, with names, indices and numbers.
    remedy : str
        A change that avoids the fault, with options of the command line; may be empty. In Python, the text of the error
        has keyword arguments instead of these options.

    Examples
    --------
    >>> str(ClothsimError("drape holds an earlier run.", "Choose another with -o, or replace it: --overwrite."))
    'drape holds an earlier run. Choose another with output=..., or replace it: overwrite=True.'
    """

    def __init__(self, sentence: str, remedy: str = "") -> None:
        self.sentence = _readable(sentence)
        self.remedy = _readable(remedy)
        super().__init__(f"{self.sentence} {_OPTION.sub(_keyword, self.remedy)}".strip())

    def __reduce__(self) -> tuple[type, tuple[str, str]]:
        """Pickled as what it was made of."""
        return type(self), (self.sentence, self.remedy)


class InputError(ClothsimError):
    """A scene, mesh or array that cannot be simulated as given."""


class MachineError(InputError):
    """Fault of the machine, such as a full disk; the input may be correct."""


class MissingPackageError(ClothsimError):
    """An optional package that is needed but not installed."""


class IntersectionWarning(UserWarning):
    """Cloth intersects a body or cloth, and the contact that would prevent this is off."""


_OPTION = re.compile(r"`[^`]*`|(?<![\w-])(?:--([a-z][a-z-]*)|-o\b)( (?=\d))?")
"""An option, and the blank before its number; commands in backticks are left as they are."""
SWITCHES = ("overwrite", "force", "estimate", "symmetric", "finer")
"""Options without a value, which are True in Python."""


def _keyword(option: re.Match[str]) -> str:
    """The keyword argument of an option."""
    if option[0].startswith("`"):
        return option[0]
    name = (option[1] or "output").replace("-", "_")
    return f"{name}=True{option[2] or ''}" if name in SWITCHES else f"{name}={'' if option[2] else '...'}"


def _readable(text: str) -> str:
    """`text` without control characters, its lines of bounded length."""
    return printable("\n".join(shortened(line, LONGEST) for line in text.split("\n")))


def shortened(text: str, longest: int) -> str:
    """`text`, or both its ends where it has more than `longest` letters."""
    half = longest // 2
    return text if len(text) <= longest else f"{text[:half]} ... {text[-half:]}"
