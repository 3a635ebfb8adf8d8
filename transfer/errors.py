"""The error raised for invalid input."""


class TransferError(ValueError):
    """Invalid input.

    Parameters
    ----------
    sentence : str
        The fault, with the name and the index of the array entry at fault.
    remedy : str
        A way to correct it; may be empty.

    Examples
    --------
    >>> error = TransferError("The body has no triangles.", "Give a closed surface.")
    >>> str(error), error.remedy
    ('The body has no triangles. Give a closed surface.', 'Give a closed surface.')
    """

    def __init__(self, sentence: str, remedy: str = "") -> None:
        super().__init__(f"{sentence} {remedy}".strip())
        self.sentence = sentence
        self.remedy = remedy
