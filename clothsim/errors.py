"""The errors a user sees: one sentence that says what is wrong and where, and what to do about it."""


class ClothsimError(Exception):
    """An error with a remedy. The command line prints it as two short lines and exits with code 2."""

    def __init__(self, sentence: str, remedy: str = "") -> None:
        super().__init__(f"{sentence} {remedy}".strip())
        self.sentence = sentence
        self.remedy = remedy


class InputError(ClothsimError):
    """A scene, a mesh or an array that cannot be simulated as given."""


class MissingPackageError(ClothsimError):
    """An optional package that this job needs is not installed."""
