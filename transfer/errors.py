"""What is wrong with an input, in one sentence, and what to do about it."""


class TransferError(ValueError):
    """An input that cannot be used: `sentence` names the thing and its index, `remedy` says what to do."""

    def __init__(self, sentence: str, remedy: str = "") -> None:
        super().__init__(f"{sentence} {remedy}".strip())
        self.sentence = sentence
        self.remedy = remedy
