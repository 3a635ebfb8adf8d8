"""Execute the notebooks and store what they print and draw: `python -m tests.notebooks [NAME ...]`."""

import os
import sys
import tempfile
from collections.abc import Sequence
from time import perf_counter
from typing import Any

from tests.notebooks import FOLDER

LONGEST = 600
"""Bound on the time of a cell [s]."""


def without_progress(outputs: Sequence[Any]) -> list[Any]:
    """The outputs of a cell without the bars and dots of a command that is at work; its lines as one output."""
    lines = [line for each in outputs if each.output_type == "stream" for line in each.text.splitlines()]
    said = [line for line in lines if line.strip() and "\x1b[" not in line and not line.startswith("still at work")]
    shown = [each for each in outputs if each.output_type != "stream"]
    if not said:
        return shown
    from nbformat.v4 import new_output

    return [new_output("stream", name="stdout", text="\n".join(said) + "\n"), *shown]


def main(names: Sequence[str]) -> int:
    """Execute the named notebooks, or all."""
    import nbformat
    from nbclient import NotebookClient

    os.environ["PYTHONWARNINGS"] = "ignore"
    root = str(FOLDER.parents[1])
    os.environ["PYTHONPATH"] = os.pathsep.join([root, os.environ.get("PYTHONPATH", "")])
    for file in sorted(FOLDER.glob("*.ipynb")):
        if names and file.stem not in names:
            continue
        book, started = nbformat.read(file, as_version=4), perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            where = {"metadata": {"path": folder}}
            NotebookClient(book, timeout=LONGEST, kernel_name="python3", resources=where).execute()
        for cell in book.cells:
            cell.metadata.pop("execution", None)
            if "outputs" in cell:
                cell.outputs = without_progress(cell.outputs)
        nbformat.write(book, file)
        print(f"{file.name}: {perf_counter() - started:.0f} s, {file.stat().st_size // 1000} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
